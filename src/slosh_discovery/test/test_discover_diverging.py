"""Motions for which a model has no finite solution end in a sentence, not in a traceback."""

import json
from dataclasses import replace

import numpy as np
import pytest
from example_motions import BASE, inputs_of, measured

from slosh_discovery.discover import Verdict, discover
from slosh_discovery.discovery_report import (
    DiscoveryReport,
    discovery_json,
    discovery_text,
    render_discovery,
)
from slosh_model import Inputs

SOFT = BASE.with_effect("swirl_stiffening", gamma=-3.0)
"""Beyond the highest waves it has no spring left."""


def in_millimetres(truth):
    """A motion in mm/s² by mistake: the linear model follows, SOFT does not."""
    inputs = inputs_of(9)
    strong = Inputs(inputs.t, 1000.0 * inputs.acceleration)
    return replace(measured(truth, 9), inputs=strong, name="strong")


def check_report(finding):
    report = DiscoveryReport(finding)
    document = json.loads(discovery_json(report))
    assert "strong" in render_discovery(report)
    return document, discovery_text(report)


@pytest.mark.long
def test_what_has_no_answer_to_a_motion_held_out_is_not_added():
    motions = [measured(SOFT, seed) for seed in range(2)]
    finding = discover(motions, BASE, [in_millimetres(SOFT)])
    assert finding.verdict is Verdict.UNEXPLAINED
    assert (finding.effects, finding.model) == ((), BASE)
    assert finding.candidates[0].effects == ("swirl_stiffening",)
    (remark,) = [remark for remark in finding.remarks if "no finite solution" in remark]
    assert remark.startswith("swirl_stiffening explains the fitted motions best")
    check_report(finding)


@pytest.mark.long
def test_a_motion_held_out_to_which_the_base_has_no_answer_is_named():
    motions = [measured(BASE, seed) for seed in range(2)]
    finding = discover(motions, SOFT, [in_millimetres(BASE)])
    assert [effect.name for effect in finding.effects] == ["swirl_stiffening"]
    assert any(
        remark.startswith("strong: the model has no finite solution")
        and "check its unit" in remark
        for remark in finding.remarks
    )
    document, text = check_report(finding)
    assert document["gap"]["before"]["holdout"] is None
    assert "inf" not in text
    assert np.isnan(finding.motions[-1].before_heights).all()
