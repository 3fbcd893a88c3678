"""`slosh plan`: finds the fastest motion along a path that keeps the liquid below a limit."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from slosh_base.files import check_apart, check_free, new_folder, write_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli import quantities
from slosh_bringup.cli.parser import old_name
from slosh_bringup.cli.plan_path import AskedPath, add_path_arguments, asked_path
from slosh_bringup.cli.quantities import ERROR, FRACTION, HEIGHT, angle, time
from slosh_bringup.cli.rim_option import add_rim_distance, rim_words
from slosh_bringup.cli.table_options import add_table_options
from slosh_bringup.cli.teller import Teller
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.model_error import read_model_error
from slosh_model import Model
from slosh_model.tray import TrayContainer, read_tray
from slosh_plan import HeightLimits, ModelError
from slosh_plan.planning.checked import LooseContainer
from slosh_plan.planning.limits import (
    ACCELERATION,
    JERK,
    RESIDUAL,
    TILT_ACCELERATION,
    TILT_RATE,
    PlanLimits,
)
from slosh_plan.planning.plan import TIME_LIMIT, NoSafeMotionError, Plan, plan, tilting
from slosh_plan.planning.plan_tray import TrayPlan, plan_tray
from slosh_plan.planning.robust import LikelyHeights, plan_robust
from slosh_plan.planning.tolerance import ERRORS, USUAL, Tolerance, frequency_tolerance
from slosh_plan.tables.joint_table import write_joint_table
from slosh_plan.tables.path_table import write_plan_table

EPILOG = """PATH is a table of waypoints, t,x,y,z[,qx,qy,qz,qw]: positions of the container's
origin in the world's axes [s, m]; the plan replaces its times. With --urdf it is a table of the
robot's joints, which keep their path and their limits. The output is a motion table with
the same columns and ax,ay,az, at 1 kHz, from rest to rest. The motion passes all waypoints within
0.1 mm; it stops where the line between them turns by more than 60 degrees. Exit code 1: no motion
keeps the limits, or units or attitude of the path look wrong."""
EXIT_NONE = 1
P = TypeVar("P")
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
        help="largest allowed tilt of the container from upright [deg] (default: 0, constant "
        "attitude)",
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
    name, attitude = asked.name, asked.waypoints.attitude

    if arguments.robust and tray.is_tray:
        raise SloshBringupError("--robust: plans for one container, not for a tray")

    def make(one: TrayContainer, kept: PlanLimits, make_plan: Callable[..., P]) -> P:
        return make_plan(
            one.placed, asked.path, kept, attitude=attitude, margin=arguments.margin,
            error=model_error(arguments, one.model.name), time_limit=arguments.time_limit,
        )  # fmt: skip

    def make_loose(one: TrayContainer, kept: PlanLimits) -> Plan:
        return make(one, kept, partial(plan, loose=LooseContainer.of(one)))

    others, likely = list[str](), None
    try:
        if tray.is_tray:
            error = model_error(arguments, tray.first.model.name)
            planned = plan_tray(
                tray, limits, make_loose, attitude=attitude, margin=arguments.margin, error=error
            )
            answer, of = planned.plan, planned.of
            others = tray_lines(planned)
        elif arguments.robust:
            of, (answer, likely) = "", make(tray.first, limits, plan_robust)
            others = [likely_words(answer, likely)]
        else:
            answer, of = make(tray.first, limits, plan), ""
    except NoSafeMotionError as error:
        print(plain_line(f"slosh plan: {name}: {error}"), file=sys.stderr)
        return EXIT_NONE
    model = next(one.placed for one in tray.containers if one.name == of)
    write_results(arguments, model, answer, asked)
    felt = tilting(model, limits, answer.path)
    borne = frequency_tolerance(felt, answer.found.motion, answer.limits, attitude)
    text = (
        json.dumps(
            facts(answer, borne)
            | ({"container": of} if of else {})
            | ({"likely": asdict(likely)} if likely else {})
        )
        if arguments.json
        else "\n".join([*others, summary(answer, arguments.output, borne)])
    )
    print(text)
    return tell.exit_code


def likely_words(answer: Plan, likely: LikelyHeights) -> str:
    """Describes the peak heights over likely model parameters, and the time that these cost."""
    duration, limits = answer.found.motion.duration, answer.limits
    return (
        f"with {likely.count} likely models ({', '.join(likely.parameters)}; 95 %) up to "
        f"{1e3 * likely.peak:.2f} of {1e3 * limits.height:.4g} mm, after the end "
        f"{1e3 * likely.residual:.2f} of {1e3 * limits.residual:.4g} mm; "
        f"{likely.nominal_duration:.3f} s would do for the model's own parameters "
        f"({100.0 * (duration / likely.nominal_duration - 1.0):+.1f} %)"
    )


def tray_lines(planned: TrayPlan) -> list[str]:
    """Describes for which container a tray's motion is planned, and the heights in all of them."""
    heights = [
        f"{name} {1e3 * each.nonlinear.peak:.2f} of {1e3 * each.limits.height:g} mm"
        for name, each in planned.found.containers.items()
    ]
    return [
        f"planned for container {planned.of}: {', '.join(heights)}",
        *planned.found.loose_words,
    ]


def plan_limits(arguments: argparse.Namespace, model: Model) -> PlanLimits:
    """Returns the limits that the planned motion must satisfy."""
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
        joint_velocity=arguments.velocity_scaling,
        joint_acceleration=arguments.acceleration_scaling,
        rim_distance=distance,
    )


def model_error(arguments: argparse.Namespace, model: str) -> ModelError | None:
    """Returns the model error to subtract from the limits, or None if none is given."""
    given = arguments.sigma, arguments.epsilon
    if arguments.error:
        if given != (None, None):
            raise SloshBringupError(
                "--error: gives MAE and epsilon; do not give --mae or --epsilon as well"
            )
        return read_model_error(arguments.error, model)
    return None if given == (None, None) else ModelError(*(value or 0.0 for value in given))


def write_results(
    arguments: argparse.Namespace, model: Model, answer: Plan, asked: AskedPath
) -> None:
    """Writes the requested motion file and HTML page: both, or neither if one fails."""
    with ExitStack() as stack:
        if arguments.report is not None:
            # It loads the templates: a plan without a page does without.
            from slosh_plan.plan_report.data import plan_json
            from slosh_plan.plan_report.making import make_report
            from slosh_plan.plan_report.page import render_plan

            subtitle = f"{asked.name} with {arguments.model} ({model.name})"
            report = make_report(model, answer, asked.waypoints, subtitle)
            folder = stack.enter_context(new_folder(arguments.report))
            write_text(folder / PAGE, render_plan(report))
            write_text(folder / DOCUMENT, plan_json(report))
        if arguments.output is None:
            return
        if asked.joints:
            write_joint_table(arguments.output, answer.found.motion)
        else:
            write_plan_table(arguments.output, answer.found.motion, asked.waypoints.attitude)


def facts(answer: Plan, borne: Tolerance) -> dict[str, object]:
    """Returns the planned motion's results as a dictionary in SI units."""
    found, scaled = answer.found, answer.scaled
    return {
        "duration": found.motion.duration,
        "method": answer.method,
        "reason": answer.reason or None,
        "height_limit": answer.limits.height,
        "limited_by": answer.limits.height_name,
        "distance_to_rim": answer.distance_to_rim,
        "peak": found.peak,
        "residual": found.residual,
        "acceleration": found.acceleration,
        "jerk": found.jerk,
        "joints": dict(found.joints),
        "tilt": found.tilt,
        "tilt_rate": found.tilt_rate,
        "tilt_acceleration": found.tilt_acceleration,
        "margin": answer.margin,
        "sigma": answer.error and answer.error.sigma,
        "epsilon": answer.error and answer.error.epsilon,
        "error_margin": found.upper - found.peak,
        "residual_error_margin": found.residual_upper - found.residual,
        "upper": answer.upper and answer.upper[0],
        "residual_upper": answer.upper and answer.upper[1],
        "scaled": {"law": scaled.law, "duration": scaled.found.motion.duration},
        "frequency_tolerance": borne.error,
        "peak_at_one_percent": borne.peak,
        "residual_at_one_percent": borne.residual,
        "length": answer.path.length,
        "stops": len(answer.path.legs) - 1,
        "departure": answer.path.departure,
        "seconds": answer.seconds,
    }


def summary(answer: Plan, output: Path | None, borne: Tolerance) -> str:
    """Formats the planned motion's results in a few lines of text."""
    found, limits = answer.found, answer.limits
    duration = found.motion.duration
    count = len(found.motion.t)
    rows = f"{count} rows in {plain_line(output)}" if output else "not written (-o FILE.csv)"
    other = f"{answer.scaled.found.motion.duration:.3f} s by the {answer.scaled.law} law"
    lines = [
        f"{duration:.3f} s, optimal time law ({other}, scaled)"
        if answer.method == "optimal"
        else f"{other}, scaled: {answer.reason}",
        f"height {1e3 * found.peak:.2f} of {1e3 * limits.height:.4g} mm"
        + (f" (the {limits.height_name})" if limits.at_rim else "")
        + rim_words(answer.distance_to_rim)
        + ", after the end "
        f"{1e3 * found.residual:.2f} of {1e3 * limits.residual:.4g} mm, margin "
        + (f"{1e3 * answer.margin:g} mm" if answer.margin else "none"),
        interval(answer),
        tolerance(borne),
        f"acceleration {found.acceleration:.2f} of {limits.acceleration:g} m/s², "
        f"jerk {found.jerk:.1f} of {limits.jerk:g} m/s³",
        *tilted(answer),
        *joints_used(answer),
        path_words(answer),
        f"{rows}, planned in {answer.seconds:.1f} s",
    ]
    return "\n".join(lines)


def tilted(answer: Plan) -> list[str]:
    """Describes the container's tilt, as text lines; empty if tilting is not allowed."""
    found, limits = answer.found, answer.limits
    if limits.tilt == 0.0:
        return []
    pairs = (
        (found.tilt, limits.tilt, "°"),
        (found.tilt_rate, limits.tilt_rate, "°/s"),
        (found.tilt_acceleration, limits.tilt_acceleration, "°/s²"),
    )
    words = (f"{math.degrees(x):.3g} of {math.degrees(most):.3g}{unit}" for x, most, unit in pairs)
    return ["tilt " + ", ".join(words)]


def joints_used(answer: Plan) -> list[str]:
    """Describes how close a joint motion comes to the robot's joint limits."""
    used = answer.found.joints
    if not used:
        return []
    words = (f"{name.removeprefix('joint_')} {100.0 * share:.0f} %" for name, share in used.items()
             if share > 0.0)  # fmt: skip
    return ["joints use of their limits: " + ", ".join(words)]


def path_words(answer: Plan) -> str:
    """Describes the path: its length, its stops and its distance from straight lines."""
    path, motion = answer.path, answer.found.motion
    length, unit = path.length, "mm"
    if motion.joints is not None:
        length = float(np.linalg.norm(np.diff(motion.position, axis=0), axis=1).sum())
        unit = "mrad"
    return (
        f"path {length:.3f} m, {_stops(len(path.legs) - 1)}, up to "
        f"{1e3 * path.departure:.2f} {unit} from straight lines between the waypoints"
    )


def interval(answer: Plan) -> str:
    """Describes the interval of peak heights due to model error and parameter covariance."""
    if answer.upper is None:
        return "the model has no covariance of its parameters: no interval"
    (peak, residual), found, error = answer.upper, answer.found, answer.error
    if error is not None:
        return (
            f"{1e3 * (peak - found.peak):.2f} mm of the limit, and "
            f"{1e3 * (residual - found.residual):.2f} mm of the limit after the end, are "
            f"reserved for the model's error (MAE {1e3 * error.sigma:.3g} mm, ε "
            f"{100.0 * error.epsilon:.3g} %, its covariance; 95 %): up to {1e3 * peak:.2f} "
            f"mm, after the end {1e3 * residual:.2f} mm"
        )
    limits = answer.limits
    missing = max(peak - limits.height, residual - limits.residual)
    kept = (
        "both limits are kept" if missing <= 0.0 else f"exceeds a limit by {1e3 * missing:.2f} mm"
    )
    return (
        f"with the covariance of the model's parameters up to {1e3 * peak:.2f} mm, after the end "
        f"{1e3 * residual:.2f} mm (95 %): {kept}"
    )


def tolerance(borne: Tolerance) -> str:
    """Describes how large a natural-frequency error would make the plan exceed its limit."""
    usual = f"with a frequency {100.0 * USUAL:g} % off up to {1e3 * borne.peak:.2f} mm"
    after = f"after the end {1e3 * borne.residual:.2f} mm"
    if borne.error == 0.0:
        said = f"an error of {100.0 * ERRORS[0]:g} % already exceeds a limit"
    else:
        said = f"the limits hold for errors of up to {100.0 * borne.error:g} %"
    advice = "" if borne.error >= USUAL else "; --margin or --mae leave room for it"
    return f"{usual}, {after}: {said}{advice}"


def _stops(count: int) -> str:
    return {0: "no stop", 1: "1 stop"}.get(count, f"{count} stops")
