"""Tests that a parameter that changes with time is not named as a constant effect."""

import json
from dataclasses import replace

import numpy as np
import pytest
from example_motions import BASE, DURATION, inputs_of, measured

from slosh_discovery.discover import Verdict, discover
from slosh_discovery.discovery_report import (
    DiscoveryReport,
)
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.identify import identify
from slosh_model import Inputs
from slosh_testing.example_finding import forms_of


def warming(truth, factors):
    """Returns motions of a session along which damping changes."""
    return [
        measured(truth.with_effect("damping_mismatch", factor=factor), seed)
        for seed, factor in enumerate(factors)
    ]


def creeping(truth, growth):
    """Returns motions in each of which the sensor's gain grows from 1."""
    motions = [measured(truth, seed) for seed in range(3)]
    return [replace(one, msh=one.msh * growth ** (one.t / DURATION)) for one in motions]


@pytest.mark.long
@pytest.mark.parametrize(
    ("motions", "when"),
    [
        (warming(BASE, (1.0, 3.0, 6.0)), "from motion to motion"),
        pytest.param(
            warming(BASE, (6.0, 3.0, 1.5)), "from motion to motion", marks=pytest.mark.long
        ),
        (creeping(BASE, 1.5), "with time within the motions"),
        pytest.param(
            creeping(BASE, 1.0 / 1.5), "with time within the motions", marks=pytest.mark.long
        ),
    ],
    ids=["growing damping", "falling damping", "growing gain", "falling gain"],
)
def test_what_changes_with_time_is_unexplained(motions, when):
    finding = discover(motions, BASE)
    assert (finding.verdict, finding.effects, finding.model) == (Verdict.UNEXPLAINED, (), BASE)
    (remark,) = [remark for remark in finding.remarks if remark.startswith("Something changes")]
    assert f" {when}: " in remark


def test_what_is_the_same_all_along_is_named():
    finding = discover(warming(BASE, (3.0, 3.0, 3.0)), BASE)
    assert finding.verdict is Verdict.NAMED
    (effect,) = finding.effects
    assert effect.name == "damping_mismatch"
    assert effect.parameters["factor"] == pytest.approx(
        3.0, abs=5 * effect.standard_errors["factor"]
    )
    assert not finding.remarks


# Motions for which a model has no finite solution end in a sentence, not in a traceback.


SOFT = BASE.with_effect("swirl_stiffening", gamma=-3.0)
"""Beyond the highest waves it has no spring left."""


def in_millimetres(truth):
    """Returns a motion whose acceleration is in mm/s² by mistake."""
    inputs = inputs_of(9)
    strong = Inputs(inputs.t, 1000.0 * inputs.acceleration)
    return replace(measured(truth, 9), inputs=strong, name="strong")


def check_report(finding):
    report = DiscoveryReport(finding)
    document, text, page = forms_of(report)
    assert "strong" in page
    return json.loads(document), text


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


def test_a_motion_of_the_fit_to_which_the_base_has_no_answer_is_refused():
    motions = [measured(SOFT, 0), in_millimetres(SOFT)]
    with pytest.raises(SloshDiscoveryError, match=r"strong: .* reaches 1\.\d+e\+03 m/s².*unit"):
        discover(motions, SOFT)


# A faulty accelerometer is told before a discovery or an identification blames physics.


def faulty(seed, kind):
    motion = measured(BASE, seed)
    t, values = motion.inputs.t, motion.inputs.acceleration.copy()
    if kind == "clipped":
        limit = 0.7 * np.abs(values).max()
        values = values.clip(-limit, limit)
    else:
        row = np.searchsorted(t, 1.2)
        values[row : row + 50] = values[row]  # 0.2 s
    return replace(motion, inputs=Inputs(t, values))


@pytest.mark.first(1)
@pytest.mark.parametrize(("kind", "what"), [("clipped", "is clipped at"), ("frozen", "repeats")])
@pytest.mark.parametrize("ask", [discover, identify])
def test_motions_with_a_faulty_input_are_left_out_and_told(ask, kind, what):
    sound = [measured(BASE, seed) for seed in range(2)]
    found = ask([*sound, faulty(2, kind)], BASE, holdout=[faulty(3, kind)])
    told = [remark for remark in found.remarks if "left out" in remark]
    assert [remark[:8] for remark in told] == ["motion 2", "motion 3"]
    assert all(what in remark and "record again" in remark for remark in told)
    kept = [motion.name if ask is identify else motion.motion.name for motion in found.motions]
    assert kept == ["motion 0", "motion 1"]
    if ask is discover:
        assert found.verdict is Verdict.NONE
    with pytest.raises(SloshDiscoveryError, match=f"no motion with a sound input: .*{what}"):
        ask([faulty(seed, kind) for seed in range(3)], BASE)
