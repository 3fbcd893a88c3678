"""What changes with time is no effect of constant size, and is not named as one."""

from __future__ import annotations

from dataclasses import replace

import pytest
from example_motions import BASE, DURATION, measured

from slosh_discovery.discover import Verdict, discover


def warming(truth, factors):
    """Motions of a session along which damping changes."""
    return [
        measured(truth.with_effect("damping_mismatch", factor=factor), seed)
        for seed, factor in enumerate(factors)
    ]


def creeping(truth, growth):
    """Motions in each of which the sensor's gain grows from 1."""
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
