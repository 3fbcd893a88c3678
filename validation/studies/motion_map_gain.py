"""Compares motion maps with TM20's harmonic law; fills the table in docs/shape.md.

    tools/run python validation/studies/motion_map_gain.py [--docs]

For each of TM20's containers the heights of the harmonic law at the paper's fastest speed are the
limits of a map: how fast may the machine run with the map's laws, and how high are its waves at
the paper's speed? Three modes, the paper's damping ratio and frequency, 300 m/s³.
"""

from __future__ import annotations

import sys
from pathlib import Path

import with_tools  # noqa: F401
from result_tables import fill
from tm20.design import DEPTH, FILL_HEIGHT, GEOMETRIES, RATIO, STROKE, Geometry

from slosh_machines.design import NamedLaw, Stroke, designed, heights
from slosh_machines.motion_map import motion_map
from slosh_model import Model, Rectangle
from slosh_plan.planning.limits import PlanLimits

PAGE = Path(__file__).resolve().parents[2] / "docs" / "shape.md"
CYCLE = Stroke(STROKE, RATIO)
JERK = 300.0
HEAD = (
    "| container | width [mm] | fastest by TM20 [1/min] | peak there [mm] | in the dwell [mm] | "
    "the map's peak [mm] | the map's in the dwell [mm] | fastest by the map [1/min] | gain |\n"
    "|---|--:|--:|--:|--:|--:|--:|--:|--:|"
)


def row(geometry: Geometry) -> str:
    """Computes and formats one container's table row."""
    known = geometry.published
    model = Model(
        Rectangle(geometry.width, DEPTH, FILL_HEIGHT), damping_ratio=known.damping_ratio,
        natural_frequency=known.natural_frequency, modes=3,
    )  # fmt: skip
    now = heights(model, CYCLE, NamedLaw("harmonic"), known.fastest)
    limits = PlanLimits(now.peak, now.residual, jerk=JERK)
    law = designed(model, CYCLE, known.fastest, limits, None)
    assert law is not None
    there = heights(model, CYCLE, law, known.fastest)
    speeds = [known.fastest + 2.0 * n for n in range(60)]
    top = motion_map(model, CYCLE, speeds, limits).rows[-1].speed
    return (
        f"| G{geometry.number} | {1e3 * geometry.width:.0f} | {known.fastest} "
        f"| {1e3 * now.peak:.1f} | {1e3 * now.residual:.2f} | {1e3 * there.peak:.1f} "
        f"| {1e3 * there.residual:.2f} "
        f"| {top:.1f} | {100.0 * (top / known.fastest - 1.0):+.0f} % |"
    )


def main() -> None:
    """Prints the table; with --docs also writes it to the page."""
    text = "\n".join([HEAD, *(row(geometry) for geometry in GEOMETRIES)])
    print(text)
    if "--docs" in sys.argv:
        fill(PAGE, "gain", text)


if __name__ == "__main__":
    main()
