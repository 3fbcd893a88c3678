"""Compares filters that leave no residual wave; fills the tables in docs/shape.md.

    tools/run python validation/studies/shaping_tables.py [--docs]

Each motion is a quintic law along its path that accelerates with 2 m/s² at most. It is shaped by
each filter for the first mode of DL22's cup, and simulated with the linear and the nonlinear
model, also of a cup whose frequency is 5 % lower or higher than the filter believes.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import with_tools  # noqa: F401
from numpy.typing import NDArray
from result_tables import fill

from slosh_bringup.cell.motions import make_motion
from slosh_model import Cylinder, Model
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.checked import CheckedMotion, checked
from slosh_plan.planning.known_laws import known_laws, leg_durations
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Path as Route
from slosh_plan.planning.path import path_through
from slosh_plan.planning.time_law import PlannedMotion, motion_along, whole_rows
from slosh_plan.shaping.filters import FILTERS, Damped
from slosh_plan.shaping.shaped import (
    POLYNOMIAL,
    PathCourse,
    course_of,
    deviation,
    filter_for,
    residual_free_motion,
    shaped,
    shaped_per_axis,
)
from slosh_plan.trajectory import Trajectory

Array = NDArray[np.float64]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "shape.md"
CUP = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
MODE = Damped(CUP.mode_constants()[0].natural_frequency, CUP.mode_constants()[0].damping_ratio)
ACCELERATION = 2.0
ERROR = 0.05
LIMITS = PlanLimits(0.015, 0.002, 9.5, 74.0)
SHORTEST, LONGEST, RATIO, TOGETHER = 0.2, 20.0, 1.02, 16
NAMES = ("none", *FILTERS, POLYNOMIAL)


@dataclass(frozen=True, slots=True)
class Row:
    """Results of one motion and filter; times in s, heights and distances in m."""

    motion: str
    name: str
    duration: float
    peak: float
    linear: float
    exact: float
    lower: float
    higher: float
    bent: float
    fastest: float


def routes() -> dict[str, Route]:
    """Returns the paths by name."""
    points = {name: make_motion(name).position for name in ("l3", "e3", "c3")}
    points["p2p"] = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
    return {name: path_through(points[name]) for name in ("p2p", "l3", "e3", "c3")}


def base(route: Route, duration: float) -> PathCourse:
    """Creates a motion with a quintic law on every leg of a path."""
    durations = leg_durations(route, whole_rows(duration))
    laws = tuple(known_laws(route)["quintic"].laws(whole_rows(duration)))
    motion = motion_along(route, laws, durations)
    course = course_of(Trajectory(motion.t, motion.acceleration, position=motion.position))
    # The law itself, not what is read back of it.
    return replace(course, path=route, laws=laws, durations=durations)


def shape(course: PathCourse, name: str) -> PlannedMotion:
    """Shapes a motion with the named filter.

    Raises:
        SloshPlanError: it is too short for the polynomial.
    """
    if name == "none":
        return course.motion()
    if name == POLYNOMIAL:
        return residual_free_motion(course, MODE)
    return shaped(course, filter_for(CUP, name, course.motion().acceleration))


def usual_duration(route: Route) -> float:
    """Returns the duration [s] at which the peak acceleration is ACCELERATION."""
    trial = 4.0
    motion = base(route, trial).motion()
    reached = float(np.linalg.norm(motion.acceleration, axis=1).max())
    return trial * float(np.sqrt(reached / ACCELERATION))


def fastest(route: Route, name: str) -> float:
    """Returns the shortest duration that keeps LIMITS [s]; infinite above LONGEST."""
    duration, ahead = SHORTEST, []
    while duration < LONGEST:
        duration *= RATIO
        try:
            ahead.append(shape(base(route, duration), name))
        except SloshPlanError:
            continue
        if len(ahead) == TOGETHER:
            for one in checked(CUP, ahead, None):
                if one.keeps(LIMITS):
                    return one.motion.duration
            ahead = []
    return float("inf")


def measure(motion: str, route: Route, name: str) -> Row:
    """Shapes one motion and returns its results."""
    course = base(route, usual_duration(route))
    made = shape(course, name)

    def of(model: Model) -> CheckedMotion:
        return checked(model, [made], None)[0]

    exact = of(CUP)
    lower, higher = (
        of(replace(CUP, natural_frequency=MODE.frequency * (1.0 + error))).residual
        for error in (-ERROR, ERROR)
    )
    bent = 0.0
    if name in FILTERS:
        chosen = filter_for(CUP, name, course.motion().acceleration)
        bent = deviation(course, shaped_per_axis(course, chosen))
    return Row(
        motion, name, made.duration, exact.peak, of(CUP.linear()).residual, exact.residual, lower,
        higher, bent, fastest(route, name),
    )  # fmt: skip


def table(rows: list[Row]) -> str:
    """Formats the results as a table."""
    lines = [
        "| motion | filter | lasts [s] | peak [mm] | left, L [mm] | left, NL [mm] | −5 % [mm] "
        "| +5 % [mm] | bent per axis [mm] | fastest safe [s] |",
        "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    lines.extend(
        f"| {row.motion} | {row.name} | {row.duration:.2f} | "
        + " | ".join(
            f"{1e3 * value:.2f}"
            for value in (row.peak, row.linear, row.exact, row.lower, row.higher)
        )
        + f" | {f'{1e3 * row.bent:.1f}' if row.name in FILTERS else '–'} | {row.fastest:.2f} |"
        for row in rows
    )
    return "\n".join(lines) + "\n"


def robustness() -> str:
    """Formats the theoretical residual of each filter for frequency errors as a table."""
    errors = (-0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2)
    head = " | ".join(f"{100.0 * error:+.0f} %".replace("-", "−") for error in errors)
    lines = [f"| filter | longer by | {head} |", "|---|--:|" + len(errors) * "--:|"]
    for name, make in FILTERS.items():
        made = make(MODE)
        others = (Damped(MODE.frequency * (1.0 + error), MODE.damping_ratio) for error in errors)
        cells = " | ".join(f"{100.0 * made.residual(other):.1f} %" for other in others)
        lines.append(f"| {name} | {made.length / MODE.period:.1f} periods | {cells} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Shapes all motions and prints the tables; with --docs also writes them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--docs", action="store_true", help="write docs/shape.md")
    arguments = parser.parse_args()
    rows = []
    for motion, route in routes().items():
        for name in NAMES:
            try:
                rows.append(measure(motion, route, name))
            except SloshPlanError as error:
                print(f"{motion}, {name}: {error}", file=sys.stderr)
                continue
            print(rows[-1], flush=True)
    text = (
        f"{table(rows)}\nTheoretical residual of the linear model's wave, "
        f"by the error of the frequency:\n\n{robustness()}"
    )
    print(text)
    if arguments.docs:
        fill(PAGE, "filters", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
