"""`slosh plan`: finds the fastest motion along a path that keeps the liquid below a height."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from slosh_base.files import check_apart, check_free, new_folder
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli import quantities
from slosh_bringup.cli.parser import old_name
from slosh_bringup.cli.plan_path import AskedPath, add_path_arguments, asked_path
from slosh_bringup.cli.quantities import ERROR, FRACTION, HEIGHT, angle, time
from slosh_bringup.cli.rim_option import add_rim_distance
from slosh_bringup.cli.table_options import add_table_options
from slosh_bringup.cli.teller import Teller
from slosh_bringup.errors import SloshBringupError
from slosh_model import Model
from slosh_model.tray import read_tray
from slosh_plan import HeightLimits, ModelError
from slosh_plan.plan_report.words import answer_document
from slosh_plan.planning.limits import (
    ACCELERATION,
    JERK,
    RESIDUAL,
    TILT_ACCELERATION,
    TILT_RATE,
    PlanLimits,
)
from slosh_plan.planning.plan import TIME_LIMIT, NoSafeMotionError, model_for
from slosh_plan.planning.plan_tray import TrayPlan, plan_container, remarks_of
from slosh_plan.planning.tolerance import Tolerance, frequency_tolerance
from slosh_plan.tables.joint_table import write_joint_table
from slosh_plan.tables.path_table import write_plan_table
from slosh_report.text import printed, write_document

LARGEST_FILE = 200_000_000
"""Bytes."""

EPILOG = """PATH is a table of waypoints, t,x,y,z[,qx,qy,qz,qw]: positions of the container's
origin in the world's axes [s, m]; the plan replaces its times. With --urdf it is a table of the
robot's joints, which keep their path and their limits. The output is a motion table with
the same columns and ax,ay,az, at 1 kHz, from rest to rest. The motion passes all waypoints within
0.1 mm; it stops where the line between them turns by more than 60 degrees. Exit code 1: no motion
keeps the limits, or units or attitude of the path look wrong."""
EXIT_NONE = 1
PAGE, DOCUMENT = "report.html", "plan.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh plan` to the argument parser."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument(
        "model", type=Path, help="model of the liquid (model.yaml), or a tray file"
    )
    add_path_arguments(parser)
    parser.add_argument(
        "--limit",
        type=HEIGHT,
        metavar="M",
        help="largest allowed height of the liquid during the motion [m]; or give --rim-distance",
    )
    add_rim_distance(parser)
    parser.add_argument(
        "--residual", type=HEIGHT, metavar="M",
        help="largest allowed height of the liquid after the motion's end [m] (default: half of "
        "--limit)",
    )  # fmt: skip
    parser.add_argument(
        "--max-acceleration",
        type=quantities.ACCELERATION,
        default=ACCELERATION,
        metavar="A",
        help="largest allowed acceleration [m/s²] (default: %(default)g)",
    )
    parser.add_argument(
        "--max-jerk",
        type=quantities.JERK,
        default=JERK,
        metavar="J",
        help="largest allowed jerk [m/s³] (default: %(default)g)",
    )
    parser.add_argument(
        "--max-tilt", type=angle(), default=0.0, metavar="DEG",
        help="largest allowed tilt of the container from upright [deg] (default: 0, the "
        "container stays upright)",
    )  # fmt: skip
    parser.add_argument(
        "--max-tilt-rate", type=float, default=math.degrees(TILT_RATE), metavar="R",
        help="largest allowed tilt rate [deg/s] (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--max-tilt-acceleration", type=float, default=math.degrees(TILT_ACCELERATION),
        metavar="R", help="largest allowed tilt acceleration [deg/s²] (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--margin", type=HEIGHT, default=0.0, metavar="M",
        help="safety margin below the height limits [m] (default: 0)",
    )  # fmt: skip
    mae = parser.add_argument(
        "--mae", dest="sigma", type=ERROR, metavar="M",
        help="mean absolute error (MAE) of the model, as reported by slosh replay [m]; the upper "
        "end of the 95 %% interval of the heights then stays below the limits",
    )  # fmt: skip
    old_name(parser, mae, "--sigma")
    parser.add_argument(
        "--epsilon", type=FRACTION, metavar="E",
        help="relative error of the model's maximum height, a fraction reported by slosh replay; "
        "widens the 95 %% interval of the heights in addition to --mae",
    )  # fmt: skip
    parser.add_argument(
        "--error", type=Path, nargs="+", action="extend", metavar="RESULT.json",
        help="read MAE and epsilon from results of slosh replay -o, demo or cell; the "
        "largest values count as --mae and --epsilon",
    )  # fmt: skip
    parser.add_argument(
        "--robust", action="store_true",
        help="keep the limits for all likely values (95 %%) of the model's parameters, by the "
        "covariance in model.yaml",
    )  # fmt: skip
    parser.add_argument(
        "--time-limit", type=time(3600.0), default=TIME_LIMIT, metavar="S",
        help="time after which the search stops and returns the best motion so far [s] "
        f"(default: {TIME_LIMIT:g})",
    )  # fmt: skip
    parser.add_argument("-o", "--output", type=Path, help="motion table to write (.csv)")
    parser.add_argument(
        "--report", type=Path, metavar="DIR",
        help="folder for the report, new or empty: report.html shows the plan, plan.json "
        "holds its values",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    add_table_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Plans the motion, writes it and prints the result."""
    if arguments.output is not None:
        if arguments.output.suffix != ".csv":
            raise SloshBringupError(f"{arguments.output}: a motion table must end in .csv")
        given = (arguments.model, arguments.path, *(arguments.error or []))
        check_apart([arguments.output], [path for path in given if path is not None])
    if arguments.report is not None:
        check_free(arguments.report)
    tray = read_tray(arguments.model)
    limits = plan_limits(arguments, tray.first.model)
    tell = Teller("plan")
    asked = asked_path(arguments, tray.turning.model, tell)
    limits = limits.with_shares(
        asked.shares, arguments.velocity_scaling, arguments.acceleration_scaling
    )
    attitude = asked.waypoints.attitude
    try:
        planned = plan_container(
            tray, asked.path, limits, attitude=attitude, margin=arguments.margin,
            errors=partial(model_error, arguments), time_limit=arguments.time_limit,
            robust=arguments.robust,
        )  # fmt: skip
    except NoSafeMotionError as error:
        print(plain_line(f"slosh plan: {asked.name}: {error}"), file=sys.stderr)
        return EXIT_NONE
    answer = planned.plan
    felt = model_for(planned.one.placed, limits, answer.path)
    remarks = remarks_of(planned, limits)
    borne = frequency_tolerance(felt, answer.found.motion, answer.limits, attitude)
    write_results(arguments, felt, planned, asked, borne, remarks)
    document = answer_document(planned, arguments.output, borne, remarks)
    print(printed(document, arguments.json), end="")
    return tell.exit_code


def plan_limits(arguments: argparse.Namespace, model: Model) -> PlanLimits:
    """Returns the limits of liquid height, motion and container tilt from the options."""
    limit, distance = arguments.limit, arguments.rim_distance
    if limit is None:
        if distance == 0.0:
            raise SloshBringupError("--limit or --rim-distance is needed")
        limit = HeightLimits(rim_distance=distance).under_rim(model).height
    tilts = arguments.max_tilt, arguments.max_tilt_rate, arguments.max_tilt_acceleration
    tilt, rate, acceleration = map(math.radians, tilts)
    return PlanLimits(
        limit,
        RESIDUAL * limit if arguments.residual is None else arguments.residual,
        arguments.max_acceleration,
        arguments.max_jerk,
        tilt,
        rate,
        acceleration,
        rim_distance=distance,
    )


def model_error(arguments: argparse.Namespace, model: str) -> ModelError | None:
    """Returns the model error to subtract from the height limits, or None if none is given."""
    given = arguments.sigma, arguments.epsilon
    if arguments.error:
        if given != (None, None):
            raise SloshBringupError(
                "--error: gives MAE and epsilon; do not give --mae or --epsilon as well"
            )
        return read_model_error(arguments.error, model)
    return None if given == (None, None) else ModelError(*(value or 0.0 for value in given))


def write_results(
    arguments: argparse.Namespace,
    model: Model,
    planned: TrayPlan,
    asked: AskedPath,
    borne: Tolerance,
    remarks: Sequence[str],
) -> None:
    """Writes the requested motion file and HTML page: both, or neither if one fails."""
    with ExitStack() as stack:
        if arguments.report is not None:
            # Only a page is compared with other motions.
            from slosh_plan.plan_report.comparison import make_report
            from slosh_plan.plan_report.document import plan_document

            subtitle = f"{asked.name} with {arguments.model} ({model.name})"
            report = make_report(model, planned, asked.waypoints, borne, subtitle, remarks)
            folder = stack.enter_context(new_folder(arguments.report))
            write_document(folder / PAGE, plan_document(report), folder / DOCUMENT)
        if arguments.output is None:
            return
        if asked.joints:
            write_joint_table(arguments.output, planned.plan.found.motion)
        else:
            write_plan_table(arguments.output, planned.plan.found.motion, asked.waypoints.attitude)


def read_model_error(paths: Sequence[Path], model: str) -> ModelError:
    """Returns a model's largest MAE and largest relative peak error ε in several result files.

    Args:
        paths: NAME.json of `slosh replay -o`, or result.json of `slosh demo` or `slosh cell`.
        model: its name, as 3D-NL.

    Raises:
        SloshBringupError: no such file, or nothing of this model in it.
    """
    sigma = epsilon = 0.0
    for path in paths:
        rows = [row for name, row in _accuracies(_document(path)) if name == model]
        if not rows:
            raise SloshBringupError(
                f"{path}: contains no accuracy figures for model {model}: --error takes "
                "NAME.json of slosh replay -o, or result.json of slosh demo or cell"
            )
        for row in rows:
            sigma = max(sigma, _number(path, row, "sigma"))
            epsilon = max(epsilon, abs(_number(path, row, "epsilon")))
    return ModelError(sigma, epsilon)


def _document(path: Path) -> Any:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise SloshBringupError(f"{path}: is larger than any result")
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SloshBringupError(f"{path}: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise SloshBringupError(f"{path}: is not JSON") from None


def _accuracies(document: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yields model names with their accuracy against the camera from a result file."""
    if not isinstance(document, dict):
        return
    replay = document.get("replay")
    told = replay.get("accuracy") if isinstance(replay, dict) else document.get("agreements")
    for row in told if isinstance(told, list) else ():
        if isinstance(row, dict) and isinstance(row.get("name"), str):
            yield row["name"].removesuffix(" / camera"), row


def _number(path: Path, row: dict[str, Any], key: str) -> float:
    value = row.get(key)
    if not isinstance(value, int | float):
        raise SloshBringupError(f"{path}: {key} of {row['name']} is {value!r:.40}, not a number")
    return float(value)
