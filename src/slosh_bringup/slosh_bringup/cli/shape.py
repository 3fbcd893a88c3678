"""`slosh shape`: shapes a motion so that little residual sloshing remains."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from slosh_base.files import check_apart
from slosh_base.files.plain_text import plain_line
from slosh_base.types import Array
from slosh_bringup.cli.table_options import add_table_options, table_options
from slosh_bringup.errors import SloshBringupError
from slosh_model import Model
from slosh_model.model_text import read_model
from slosh_plan import Trajectory
from slosh_plan.planning.checked import CheckedMotion, checked
from slosh_plan.planning.plan import upright_yaw
from slosh_plan.planning.time_law import PlannedMotion
from slosh_plan.shaping.filters import FILTERS
from slosh_plan.shaping.shaped import (
    POLYNOMIAL,
    PathCourse,
    course_of,
    deviation,
    excited_modes,
    filter_for,
    residual_free_motion,
    shaped,
    shaped_per_axis,
)
from slosh_plan.tables.path_table import write_plan_table
from slosh_plan.tables.trajectory_table import read_trajectory

TURNED = 1e-3
"""By how much a quaternion's components may differ along a motion that does not turn."""
EPILOG = """zv, zvd: sum of two or three copies of the motion, half a period of the liquid apart;
exponential, average: average of the motion over one period; polynomial: another time law along the
same path, in the same time. All use the frequency and damping of the first mode. The filters act
on the distance along the path and keep the path; with --per-axis they act on x, y and z and bend
it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh shape` to the argument parser."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("model", type=Path, help="model of the liquid (model.yaml)")
    parser.add_argument(
        "motion", type=Path,
        help="motion from rest to rest: motion table t,ax,ay,az[,...] or poses "
        "t,x,y,z[,qx,qy,qz,qw]",
    )  # fmt: skip
    parser.add_argument(
        "--filter",
        choices=[*FILTERS, POLYNOMIAL],
        required=True,
        help="input shaper to apply; the text below explains each",
    )
    parser.add_argument(
        "--per-axis",
        action="store_true",
        help="filter x, y and z separately instead of the distance along the path",
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="motion table to write (.csv)"
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    add_table_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Shapes the motion, writes it and prints the results before and after shaping."""
    if arguments.output.suffix != ".csv":
        raise SloshBringupError(f"{arguments.output}: a motion table must end in .csv")
    if arguments.per_axis and arguments.filter == POLYNOMIAL:
        raise SloshBringupError(
            "--per-axis: not possible with --filter polynomial, a time law along the path"
        )
    check_apart([arguments.output], [arguments.model, arguments.motion])
    model = read_model(arguments.model)
    trajectory = read_trajectory(arguments.motion, table_options(arguments))
    attitude = kept_attitude(trajectory)
    course = course_of(trajectory)
    before = course.motion()
    after = shape(arguments, model, course, upright_yaw(attitude))
    found = checked(model, [before, after], attitude)
    linear = checked(model.linear(), [before, after], attitude)
    write_plan_table(arguments.output, after, attitude)
    facts = [as_facts(*pair) for pair in zip(found, linear, strict=True)]
    bent = deviation(course, after)
    if arguments.json:
        print(json.dumps({"before": facts[0], "after": facts[1], "deviation": bent}))
    else:
        print(summary(facts, bent, len(after.t), arguments.output))
    return 0


def shape(
    arguments: argparse.Namespace, model: Model, course: PathCourse, yaw: float
) -> PlannedMotion:
    """Returns the motion after applying the filter that the options choose.

    Raises:
        SloshBringupError: a rectangle's two frequencies, for which there is no polynomial.
        SloshPlanError: a motion that is too short for the polynomial.
    """
    acceleration = course.motion().acceleration
    if arguments.filter == POLYNOMIAL:
        modes = excited_modes(model, acceleration, yaw)
        if len(modes) > 1:
            raise SloshBringupError(
                "--filter polynomial: the motion excites both frequencies of a rectangle; choose "
                "a filter"
            )
        return residual_free_motion(course, modes[0])
    made = filter_for(model, arguments.filter, acceleration, yaw)
    return shaped_per_axis(course, made) if arguments.per_axis else shaped(course, made)


def kept_attitude(trajectory: Trajectory) -> Array | None:
    """Returns a motion's constant orientation as a quaternion (4,), or None if it is upright.

    Raises:
        SloshBringupError: the container turns.
    """
    attitude, rate = trajectory.attitude, trajectory.angular_velocity
    turning = rate is not None and float(np.abs(rate).max()) > TURNED
    if attitude is not None:
        turning = turning or float(np.ptp(attitude, axis=0).max()) > TURNED
    if turning:
        raise SloshBringupError(
            f"{trajectory.name}: the container turns; only motions with a constant attitude "
            "can be shaped"
        )
    return None if attitude is None else attitude[0]


def as_facts(found: CheckedMotion, linear: CheckedMotion) -> dict[str, float]:
    """Returns a motion's results as a dictionary in SI units."""
    return {
        "duration": found.motion.duration,
        "peak": found.peak,
        "residual": found.residual,
        "residual_linear": linear.residual,
        "acceleration": found.acceleration,
        "jerk": found.jerk,
    }


def summary(facts: list[dict[str, float]], bent: float, rows: int, output: Path) -> str:
    """Formats the results before and after shaping in a few lines of text."""
    before, after = facts

    def change(name: str, scale: float, digits: int) -> str:
        return f"{scale * before[name]:.{digits}f} → {scale * after[name]:.{digits}f}"

    return "\n".join(
        [
            f"lasts {change('duration', 1.0, 3)} s, up to {1e3 * bent:.2f} mm from the path",
            f"height {change('peak', 1e3, 2)} mm, after the end "
            f"{change('residual', 1e3, 2)} mm "
            f"(linear model {change('residual_linear', 1e3, 2)} mm)",
            f"acceleration {change('acceleration', 1.0, 2)} m/s², jerk "
            f"{change('jerk', 1.0, 1)} m/s³, {rows} rows in {plain_line(output)}",
        ]
    )
