"""Fits given sets of effects to the measured runs of a robot's tilted cup.

    tools/run python validation/studies/robot_fits.py [--docs]

The discovery chooses between effects; here they are given, so that the table of
docs/results/discovery_findings.md shows what a choice would gain. A run is predicted with the
parameters fitted to all other runs; its clock offset and still level are fitted for each run.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from discovery_findings import PAGE, ROBOT_CUP, runs_of_kind
from result_tables import fill

from slosh_discovery.discover.clock import first_offset, slipped_offsets
from slosh_discovery.discover.explanation import Explanation, starts
from slosh_discovery.discover.fitting import Fit, fit
from slosh_discovery.discover.problem import PreparedMotion, prepare
from slosh_model import Model

EVALUATIONS = 40
SHARED, APART = False, True


class Wanted(NamedTuple):
    """A modelled effect, and whether its parameters differ between groups of motions."""

    name: str
    per_group: bool


SETS: dict[str, tuple[Wanted, ...]] = {
    "nothing": (Wanted("lever_arm", SHARED),),
    "`static_tilt`": (Wanted("lever_arm", SHARED), Wanted("static_tilt", SHARED)),
    "`sensor_tilt`": (Wanted("lever_arm", SHARED), Wanted("sensor_tilt", SHARED)),
    "`sensor_tilt` per group": (Wanted("lever_arm", SHARED), Wanted("sensor_tilt", APART)),
    "`sensor_tilt` and `lever_arm` per group": (
        Wanted("lever_arm", APART),
        Wanted("sensor_tilt", APART),
    ),
}


def main() -> int:
    """Prints the table of accuracies; with --docs also writes it to the page."""
    base = Model(ROBOT_CUP).nonlinear().spatial().with_effect("gravity_tilt")
    runs = [prepare(motion) for motions in runs_of_kind("Tilt").values() for motion in motions]
    lines = [
        "| with `gravity_tilt` and `lever_arm` | MAE of the fit to all six | MAE predicted |",
        "|---|--:|--:|",
    ]
    for words, wanted in SETS.items():
        whole = fitted(base, runs, wanted)
        seen = np.mean([sigma(whole, run) for run in runs])
        foretold = np.mean(
            [
                sigma(fitted(base, [one for one in runs if one is not run], wanted), run)
                for run in runs
            ]
        )
        lines.append(f"| {words} | {1e3 * seen:.2f} | {1e3 * foretold:.2f} |")
        print(lines[-1], flush=True)
    if "--docs" in sys.argv[1:]:
        fill(PAGE, "tilted fits", "\n".join(lines))
    return 0


def fitted(base: Model, motions: Sequence[PreparedMotion], wanted: Sequence[Wanted]) -> Fit:
    """Adds effects one after another; fits each from all of its initial values."""
    names = {one.motion.group for one in motions}
    groups = tuple(sorted(name for name in names if name is not None))
    offsets = [first_offset(motion, base) for motion in motions]
    one = fit(Explanation(base, groups=groups), motions, np.zeros(0), offsets)
    for effect in wanted:
        one = min(tried(one, motions, effect), key=lambda found: found.chi_square)
    slipped = slipped_offsets(one, motions)
    if slipped is None:
        return one
    return fit(one.explanation, motions, one.vector, slipped, evaluations=EVALUATIONS)


def tried(one: Fit, motions: Sequence[PreparedMotion], wanted: Wanted) -> list[Fit]:
    """Fits one more effect from each of its initial values."""
    known = one.explanation

    def begun(values: dict[str, float], choices: dict[str, float]) -> Fit:
        wider = known.with_effect(wanted.name, choices, per_group=wanted.per_group)
        vector = wider.vector(
            lambda name, group: (
                values if name == wanted.name else known.part(one.vector, name, group)
            )
        )
        return fit(wider, motions, vector, one.clock_offsets, evaluations=EVALUATIONS)

    return [begun(values, choices) for values, choices in starts(wanted.name)]


def sigma(one: Fit, motion: PreparedMotion) -> float:
    """Returns the mean absolute error of a run's heights [m], with its clock and level fitted."""
    model = one.model_of(motion.motion.group)
    alone = Explanation(model)
    offset = fit(alone, [motion], np.zeros(0), [first_offset(motion, model)]).clock_offsets[0]
    answer = motion.simulate(model)
    if answer is None:
        return float("nan")
    off = motion.heights - answer.at(motion.t, offset)
    return float(np.nanmean(np.abs(off - np.nanmean(off))))


if __name__ == "__main__":
    sys.exit(main())
