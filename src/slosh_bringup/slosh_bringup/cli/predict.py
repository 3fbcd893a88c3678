"""`slosh predict`: predicts peak heights of planned motions, and time scales that are safe."""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from slosh_base.files import check_apart, new_text, write_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli import quantities
from slosh_bringup.cli.output_names import PAGE, TABLE, check_ending, check_picture
from slosh_bringup.cli.parser import old_name
from slosh_bringup.cli.predict_gantry import gantry_text
from slosh_bringup.cli.progress import share_bar
from slosh_bringup.cli.quantities import ERROR, FRACTION, HEIGHT, time
from slosh_bringup.cli.rim_option import add_rim_distance, rim_words
from slosh_bringup.cli.table_options import add_table_options, table_options
from slosh_bringup.cli.teller import Teller
from slosh_bringup.errors import SloshBringupError
from slosh_model.model import Model
from slosh_model.tilt import added_text, attitude_of
from slosh_model.tray import Tray, read_tray
from slosh_plan import (
    HeightLimits,
    ModelError,
    Prediction,
    SafeScales,
    Trajectory,
)
from slosh_plan.doubts import trajectory_doubts
from slosh_plan.robot_file import read_arm
from slosh_plan.tables.joint_table import read_joint_trajectory
from slosh_plan.tables.trajectory_table import read_trajectory
from slosh_plan.tray import TrayPrediction, predict_tray, tray_scales
from slosh_plan.validity import validity_words
from slosh_report.json_values import plain
from slosh_report.text_table import aligned

EXIT_EXCEEDED = 1
MISSING = "missing: TRAJECTORY; slosh help predict shows how it is given, or give --gantry"
HEADING = (
    "motion", "duration [s]", "peak [mm]", "linear peak [mm]", "peak time [s]", "azimuth [deg]",
    "residual [mm]", "settling time [s]", "safe from", "remarks",
)  # fmt: skip
COLUMNS = (
    "trajectory", "duration", "peak_linear", "peak_nonlinear", "peak_lower", "peak_upper",
    "peak_time", "azimuth", "residual_linear", "residual_nonlinear", "settling_time", "excess",
    "residual_excess", "flags", "time_scale",
)  # fmt: skip
EPILOG = """peak and residual: largest height at the wall above the still level during the motion
and after its end, by the nonlinear model; linear peak: by the linear model. With the model's error
(--mae, --epsilon, or the covariance in model.yaml) the peak has an interval; its upper end must
keep the limit. safe from: every run that is slower than this multiple of the duration keeps the
limits; "as given": so does the motion itself, though some slower ones do not.

If model.yaml gives rim_height, the rim limits the height, too, or the distance to it by
--rim-distance: the lower limit applies.

exit code: 0, 1 where a limit or the rim is exceeded, a container slides or tips, or units or axes
look wrong, 2 for wrong input"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh predict` to the argument parser."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument(
        "model", type=Path, help="model of the liquid (model.yaml), or a tray file"
    )
    parser.add_argument(
        "trajectories", type=Path, nargs="*", metavar="TRAJECTORY",
        help="trajectory: motion table t,ax,ay,az[,...] or poses t,x,y,z[,qx,qy,qz,qw] (.csv, "
        ".csv.gz)",
    )  # fmt: skip
    for name, kind, unit, text in (
        (
            "limit",
            HEIGHT,
            "M",
            "largest allowed height above the still level during the motion [m]",
        ),
        ("residual", HEIGHT, "M", "largest allowed height after the motion's end [m]"),
        (
            "horizon",
            time(600.0),
            "S",
            "time after the motion's end that is predicted too [s] (default: three periods of "
            "the liquid)",
        ),
    ):
        parser.add_argument(f"--{name}", type=kind, metavar=unit, help=text)
    add_rim_distance(parser)
    parser.add_argument(
        "--gantry", type=quantities.ACCELERATION, nargs="?", const=math.nan, metavar="A",
        help="without TRAJECTORY: find the acceleration, jerk and waiting time that are safe for "
        "strokes of any length; given the machine's acceleration A [m/s²], also the speed",
    )  # fmt: skip
    mae = parser.add_argument(
        "--mae", dest="sigma", type=ERROR, default=0.0, metavar="M",
        help="mean absolute error (MAE) of the model, as reported by slosh replay [m] (default 0)",
    )  # fmt: skip
    old_name(parser, mae, "--sigma")
    parser.add_argument(
        "--epsilon", type=FRACTION, default=0.0, metavar="E",
        help="relative error of the model's maximum height, as reported by slosh replay; "
        "widens the 95 %% interval of the heights (default 0)",
    )  # fmt: skip
    parser.add_argument(
        "--urdf", type=Path, metavar="FILE",
        help="URDF file of the robot; TRAJECTORY is then a table of t and its joints [s, rad, m]",
    )  # fmt: skip
    parser.add_argument(
        "--tool-frame",
        metavar="LINK",
        help="link of the robot that holds the container; needed with --urdf",
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="TABLE.csv", help="table of results to write"
    )
    parser.add_argument(
        "--plot", type=Path, metavar="OUT.png",
        help="picture to write, with the motions side by side (.png, .svg)",
    )  # fmt: skip
    parser.add_argument(
        "--page", type=Path, metavar="OUT.html", help="HTML page to write, with results and charts"
    )
    parser.add_argument("--json", action="store_true", help="print the results as JSON")
    add_table_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Predicts the motions and prints the results; returns 1 if a height limit is exceeded."""
    if not arguments.trajectories and arguments.gantry is None:
        raise SloshBringupError(MISSING)
    outputs = [arguments.output, arguments.plot, arguments.page]
    check_apart(outputs, [arguments.model, *arguments.trajectories])
    check_picture(arguments.plot)
    check_ending(arguments.page, "a page", PAGE)
    check_ending(arguments.output, "a table", TABLE)
    tray = read_tray(arguments.model)
    model = tray.first.placed
    if tray.is_tray and (arguments.plot or arguments.page):
        raise SloshBringupError("--plot and --page show one container: give its model, no tray")
    limits = HeightLimits(
        *(math.inf if value is None else value for value in (arguments.limit, arguments.residual)),
        rim_distance=arguments.rim_distance,
    )
    if arguments.gantry is not None:
        return _gantry(arguments, tray, limits)
    error = ModelError(arguments.sigma, arguments.epsilon)
    motions = read_motions(arguments)
    each = predict_tray(tray, motions, limits=limits, horizon=arguments.horizon, error=error)
    tell = Teller("predict")
    for motion in motions:
        tell.warn(motion.name, trajectory_doubts(motion, model))
        added = added_text(model, attitude_of(motion))
        if added:
            print(plain_line(f"slosh predict: note: {motion.name}: {added}"), file=sys.stderr)
    found = [one.of_worst for one in each]
    scales: list[SafeScales | None] = [None] * len(motions)
    # Of a motion that stays below the rim nobody asked how fast it may be.
    wanted = [
        (one.limits.given if tray.is_tray else limits.given or not one.kept)
        and math.isfinite(one.unresolved)
        for one in found
    ]
    if any(wanted):
        with share_bar("time scales") as progress:
            for place, motion in enumerate(motions):
                if wanted[place]:
                    scales[place] = tray_scales(
                        tray, motion, limits, each[place], horizon=arguments.horizon
                    )
                progress(motion.name, (place + 1) / len(motions))
    if arguments.output is not None:
        write_table(arguments.output, found, scales)
    of_tray = each if tray.is_tray else None
    write_shown(arguments, model, motions, found, list(_facts(found, scales, of_tray)))
    show = as_json if arguments.json else as_text
    print(show(found, scales, of_tray))
    kept = all(one.of_worst.kept and one.stands for one in each)
    return tell.exit_code if kept else EXIT_EXCEEDED


def _gantry(arguments: argparse.Namespace, tray: Tray, limits: HeightLimits) -> int:
    """Prints safe accelerations for a machine with axes whose strokes are not known in advance."""
    if arguments.trajectories or tray.is_tray:
        raise SloshBringupError("--gantry: needs the model of one container, and no TRAJECTORY")
    if arguments.output or arguments.plot or arguments.page:
        raise SloshBringupError("--gantry: prints its limits; --output, --plot and --page do not "
                                "go with it")  # fmt: skip
    machine = None if math.isnan(arguments.gantry) else arguments.gantry
    if machine is not None and not 0.0 < machine < math.inf:
        raise SloshBringupError(f"--gantry {machine:g}: an acceleration above 0 is needed")
    error = ModelError(arguments.sigma, arguments.epsilon)
    print(gantry_text(tray.first.model, limits, machine, error, as_json=arguments.json))
    return 0


def read_motions(arguments: argparse.Namespace) -> list[Trajectory]:
    """Reads motions of the container, or of a robot's joints if --urdf is given."""
    if (arguments.urdf is None) != (arguments.tool_frame is None):
        raise SloshBringupError("--urdf and --tool-frame must be given together")
    options = table_options(arguments)
    if arguments.urdf is None:
        return [read_trajectory(path, options) for path in arguments.trajectories]
    arm = read_arm(arguments.urdf, arguments.tool_frame)
    return [read_joint_trajectory(path, arm, options) for path in arguments.trajectories]


def write_shown(
    arguments: argparse.Namespace,
    model: Model,
    motions: Sequence[Trajectory],
    found: Sequence[Prediction],
    facts: Sequence[Mapping[str, Any]],
) -> None:
    """Writes the picture and the HTML page of the predicted motions, as far as requested."""
    if arguments.plot is None and arguments.page is None:
        return
    # They load matplotlib, which is slow.
    from slosh_bringup.predict.side_by_side import profiles, render_page, write_picture

    shown = profiles(model, motions, found, arguments.horizon)
    if arguments.plot is not None:
        write_picture(arguments.plot, shown)
    if arguments.page is not None:
        doubts = [trajectory_doubts(motion, model) for motion in motions]
        write_text(arguments.page, render_page(plain(list(facts)), shown, doubts))


def write_table(
    path: Path, found: Sequence[Prediction], scales: Sequence[SafeScales | None]
) -> None:
    """Writes the predictions as a CSV file, one row per motion, in SI units."""
    with new_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for facts in _facts(found, scales):
            writer.writerow([facts[name] for name in COLUMNS])


def as_json(
    found: Sequence[Prediction],
    scales: Sequence[SafeScales | None],
    tray: Sequence[TrayPrediction] | None = None,
) -> str:
    """Formats the predictions as a JSON list with one object per motion; unknown values are null.

    Of a tray they are of the worst container, whose name and the peaks of all they hold, too.
    """
    facts = list(_facts(found, scales, tray))
    for row, each in zip(facts, tray or (), strict=False):
        peaks = {name: one.nonlinear.peak for name, one in each.containers.items()}
        loose = {name: use._asdict() for name, use in each.standing.items()}
        row |= {"container": each.worst, "containers": peaks, "standing": loose}
    return json.dumps(plain(facts), indent=1)


def as_text(
    found: Sequence[Prediction],
    scales: Sequence[SafeScales | None],
    tray: Sequence[TrayPrediction] | None = None,
) -> str:
    """Formats the predictions as a text table; of a tray, the container nearest to its limit."""
    rows = [list(HEADING)]
    for place, (one, scale) in enumerate(zip(found, scales, strict=True)):
        of_tray = tray[place] if tray else None
        answer = one.nonlinear
        rows.append(
            [
                one.name,
                f"{one.duration:.3f}",
                _interval(one),
                f"{1e3 * one.linear.peak:.1f}",
                f"{answer.peak_time:.3f}",
                f"{math.degrees(answer.azimuth):.0f}",
                f"{1e3 * answer.residual:.1f}",
                f"{answer.settling_time:.1f}",
                _safe_from(one, scale),
                "; ".join(_remarks(one, scale, of_tray)) or "-",
            ]
        )
    return "\n".join(aligned(rows, "<>>>>>>>><"))


def _of_tray(each: TrayPrediction) -> Iterator[str]:
    """Yields lines on a tray's container nearest to its limit and on its other containers."""
    others = ", ".join(
        f"{name} {1e3 * one.nonlinear.peak:.1f} mm"
        for name, one in each.containers.items()
        if name != each.worst
    )
    yield f"worst container {each.worst}" + (f" ({others})" if others else "")
    yield from each.loose_words
    for name, one in each.containers.items():
        if name != each.worst:
            yield from (f"{name}: {words}" for words in validity_words(one.flags, one.growth))


def _interval(one: Prediction) -> str:
    peak = f"{1e3 * one.nonlinear.peak:.1f}"
    if one.upper == one.nonlinear.peak:
        return peak
    return f"{peak} ({1e3 * one.lower:.1f} … {1e3 * one.upper:.1f})"


def _remarks(
    one: Prediction, scale: SafeScales | None, of_tray: TrayPrediction | None
) -> Iterator[str]:
    if of_tray is not None:
        yield from _of_tray(of_tray)
    if math.isfinite(one.distance_to_rim):
        yield rim_words(one.distance_to_rim).removeprefix(", ")
    if one.unresolved == math.inf:
        yield "the rows do not tell the motion: no height is certain"
    elif one.excess > 0.0:
        yield f"{1e3 * one.excess:.1f} mm above the {one.limits.height_name}"
    if 0.0 < one.residual_excess < math.inf:
        yield f"{1e3 * one.residual_excess:.1f} mm above the residual limit"
    if scale is not None and scale.islands:
        yield "also safe: " + ", ".join(f"{low:.3f} … {high:.3f}" for low, high in scale.islands)
    if scale is not None and math.isnan(scale.safe_from) and not one.kept:
        yield "no safe time scale"
    yield from validity_words(one.flags, one.growth)


def _safe_from(one: Prediction, scale: SafeScales | None) -> str:
    """Describes from which time scale on a motion keeps the limits, and that it does as given."""
    if scale is None:
        return "-"
    from_there = scale.safe_from
    if one.kept and not from_there <= 1.0:
        return "as given" if math.isnan(from_there) else f"as given, slower {from_there:.3f}"
    return "-" if math.isnan(from_there) else f"{from_there:.3f}"


def _facts(
    found: Sequence[Prediction],
    scales: Sequence[SafeScales | None],
    tray: Sequence[TrayPrediction] | None = None,
) -> Iterator[dict[str, Any]]:
    trays: Sequence[TrayPrediction | None] = tray or [None] * len(found)
    for one, scale, of_tray in zip(found, scales, trays, strict=True):
        linear, nonlinear = one.linear, one.nonlinear
        yield {
            "trajectory": plain_line(one.name),
            "models": [linear.model, nonlinear.model],
            "duration": one.duration,
            "peak_linear": linear.peak,
            "peak_nonlinear": nonlinear.peak,
            "peak_lower": one.lower,
            "peak_upper": one.upper,
            "peak_time": nonlinear.peak_time,
            "azimuth": nonlinear.azimuth,
            "residual_linear": linear.residual,
            "residual_nonlinear": nonlinear.residual,
            "settling_time": nonlinear.settling_time,
            "excess": one.excess,
            "height_limit": one.limits.height,
            "limited_by": one.limits.height_name,
            "distance_to_rim": one.distance_to_rim,
            "residual_excess": one.residual_excess,
            "kept": one.kept,
            "flags": int(one.flags),
            "time_scale": math.nan if scale is None else scale.safe_from,
            "safe_scales": [] if scale is None else [list(pair) for pair in scale.intervals],
            "proven": scale is not None and scale.proven,
            "remarks": list(_remarks(one, scale, of_tray)),
        }
