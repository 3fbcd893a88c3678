"""`slosh predict`: predicts peak heights of planned motions, and time scales that are safe."""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from slosh_base.files import check_apart, new_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli import quantities
from slosh_bringup.cli.output_names import PAGE, TABLE, check_ending, check_picture
from slosh_bringup.cli.parser import old_name
from slosh_bringup.cli.predict_gantry import gantry_text
from slosh_bringup.cli.progress import share_bar
from slosh_bringup.cli.quantities import ERROR, FRACTION, HEIGHT, time
from slosh_bringup.cli.rim_option import add_rim_distance
from slosh_bringup.cli.table_options import add_table_options, table_options
from slosh_bringup.cli.teller import Teller
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.predict.document import PredictedMotion, predicted_document
from slosh_model.model import Model
from slosh_model.tilt import added_text, attitude_of
from slosh_model.tray import Tray, read_tray
from slosh_plan import HeightLimits, ModelError, SafeScales, Trajectory
from slosh_plan.doubts import trajectory_doubts
from slosh_plan.robot_file import read_arm
from slosh_plan.tables.joint_table import read_joint_trajectory
from slosh_plan.tables.trajectory_table import read_trajectory
from slosh_plan.tray import TrayPrediction, predict_tray, tray_scales
from slosh_report.text import printed, write_document

EXIT_EXCEEDED = 1
MISSING = "missing: TRAJECTORY; slosh help predict shows how it is given, or give --gantry"
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
    scales = safe_scales_of(arguments, tray, limits, motions, each)
    rows = [
        PredictedMotion(one, scale, answer if tray.is_tray else None)
        for one, scale, answer in zip(found, scales, each, strict=True)
    ]
    if arguments.output is not None:
        write_table(arguments.output, [row.facts for row in rows])
    write_shown(arguments, model, motions, rows)
    document = predicted_document(rows)
    print(printed(document, arguments.json), end="")
    kept = all(one.of_worst.kept and one.stands for one in each)
    return tell.exit_code if kept else EXIT_EXCEEDED


def safe_scales_of(
    arguments: argparse.Namespace,
    tray: Tray,
    limits: HeightLimits,
    motions: Sequence[Trajectory],
    each: Sequence[TrayPrediction],
) -> list[SafeScales | None]:
    """Returns each motion's safe time scales, where a limit was given or is exceeded."""
    scales: list[SafeScales | None] = [None] * len(motions)
    # Of a motion that stays below the rim nobody asked how fast it may be.
    wanted = [
        (one.limits.given if tray.is_tray else limits.given or not one.kept)
        and math.isfinite(one.unresolved)
        for one in (answer.of_worst for answer in each)
    ]
    if any(wanted):
        with share_bar("time scales") as progress:
            for place, motion in enumerate(motions):
                if wanted[place]:
                    scales[place] = tray_scales(
                        tray, motion, limits, each[place], horizon=arguments.horizon
                    )
                progress(motion.name, (place + 1) / len(motions))
    return scales


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


def write_table(path: Path, facts: Sequence[Mapping[str, Any]]) -> None:
    """Writes the predictions as a CSV file, one row per motion, in SI units."""
    with new_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows([row[name] for name in COLUMNS] for row in facts)


def write_shown(
    arguments: argparse.Namespace,
    model: Model,
    motions: Sequence[Trajectory],
    rows: Sequence[PredictedMotion],
) -> None:
    """Writes the picture and the HTML page of the predicted motions, as far as requested."""
    if arguments.plot is None and arguments.page is None:
        return
    # They load matplotlib, which is slow.
    from slosh_bringup.predict.side_by_side import profiles, with_charts, write_picture

    shown = profiles(model, motions, [row.one for row in rows], arguments.horizon)
    if arguments.plot is not None:
        write_picture(arguments.plot, shown)
    if arguments.page is not None:
        problems = [trajectory_doubts(motion, model) for motion in motions]
        page = with_charts(predicted_document(rows, problems), shown)
        write_document(arguments.page, page)
