"""`slosh mounting`: checks a sensor's axes, signs and units against a recorded motion."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.input_options import add_robot_options, wanted_robot
from slosh_bringup.cli.quantities import RADIANS, length
from slosh_motion.mounting.in_recording import (
    REFERENCES,
    SENSORS,
    MountingCheck,
    MountingWanted,
    check_mounting,
)
from slosh_motion.mounting.verdict import MountingVerdict
from slosh_report.text_table import aligned

RIGHT, WRONG = 0, 1
ALONE = {
    "imu": "a turn about the vertical, and the unit of the angular velocity if nothing tilts",
    "accel": "axes and unit",
}
"""What a sensor does not tell by itself."""
EPILOG = """Record the sensor beside poses, joint states, transforms or odometry while the robot
moves along two directions and tilts or turns. Exit code 1: something is wrong; each line says what
and the remedy. What the motion did not show is listed."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh mounting` to the argument parser."""
    parser.epilog = EPILOG
    parser.add_argument("bag", type=Path, metavar="BAG", help="folder of the bag, or MCAP file")
    parser.add_argument(
        "--sensor",
        choices=SENSORS,
        help="sensor to check (default: imu if the bag has one)",
    )
    parser.add_argument(
        "--reference", choices=REFERENCES,
        help="source of the motion with which the sensor is compared (default: the first of these "
        "that the bag contains)",
    )  # fmt: skip
    add_robot_options(parser)
    parser.add_argument(
        "--sensor-rotation", type=RADIANS, nargs=3, metavar=("ROLL", "PITCH", "YAW"),
        help="mounting to check: roll, pitch, yaw of the sensor on the container [rad] (default: "
        "as recorded, or from /tf_static)",
    )  # fmt: skip
    parser.add_argument(
        "--sensor-to-origin", type=length(5.0), nargs=3, metavar=("X", "Y", "Z"),
        help="mounting to check: vector from the sensor to the container's origin, in the "
        "container's axes [m] (default: as recorded, or from /tf_static)",
    )  # fmt: skip
    parser.add_argument(
        "--namespace",
        metavar="NAMESPACE",
        help="namespace of the cell, if the bag contains several cells",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Prints the result of the mounting check; returns 1 if something is wrong."""
    wanted = MountingWanted(
        arguments.sensor, arguments.reference, wanted_robot(arguments),
        _three(arguments.sensor_rotation), _three(arguments.sensor_to_origin), arguments.namespace,
    )  # fmt: skip
    found = check_mounting(arguments.bag, wanted)
    if arguments.json:
        print(json.dumps(document(found), indent=1))
    else:
        print("\n".join(map(plain_line, lines(found))))
    return WRONG if found.wrong or _reference_wrong(found) else RIGHT


def _three(values: list[float] | None) -> tuple[float, float, float] | None:
    return None if values is None else (values[0], values[1], values[2])


def _reference_wrong(found: MountingCheck) -> list[str]:
    return [doubt for doubt in found.reference_doubts if doubt.wrong]


def lines(found: MountingCheck) -> list[str]:
    """Formats the compared topics, the measured values and the conclusion as text lines."""
    frame = f", frame {found.frame!r}" if found.frame else ""
    rows = [("sensor", f"{found.topic} ({found.kind}), {found.messages} messages{frame}")]
    if found.reference[0]:
        rows.append(("motion", f"{found.reference[1]} ({found.reference[0]})"))
    if found.verdict is not None:
        rows += measured(found.verdict, found.motions)
    told = list(aligned(rows, "<<"))
    told += [f"wrong: {found.reference[0]}: {text}" for text in _reference_wrong(found)]
    told += [f"wrong: {found.kind}: {text}" for text in found.wrong]
    if found.verdict is None:
        told.append(f"not compared with a motion: {found.missing}")
        told += [f"remark: {doubt}" for doubt in found.doubts if not doubt.wrong]
        told.append(f"not seen: {ALONE[found.kind]}")
        if not found.wrong:
            told.append("right: what rest tells of gravity")
        return told
    told += [f"remark: {text}" for text in found.verdict.remarks]
    told += [f"not seen: {text}" for text in found.verdict.unseen]
    if not found.wrong:
        told.append("right: axes, signs and units as far as they were seen")
    return told


def measured(verdict: MountingVerdict, motions: int) -> list[tuple[str, str]]:
    """Returns rows (name, value) of the measured quantities with their standard errors."""
    fit = verdict.fit
    angles = ", ".join(f"{angle + 0.0:.4f}" for angle in verdict.sensor_rotation)
    count = f"{motions} motion{'s' if motions > 1 else ''}"
    rows = [
        ("compared", f"{count}, {fit.seconds:.1f} s with the rest beside them"),
        ("explained", f"{100.0 * max(fit.explained, 0.0):.1f} % of the motion"),
        ("lag", f"{1e3 * fit.lag:.1f} ± {1e3 * fit.lag_error:.1f} ms"),
        ("gain", f"{fit.gain:.4g} ± {fit.gain_error:.2g}"),
        ("gravity", f"{fit.gravity:.4g} ± {fit.gravity_error:.2g} of 9.81 m/s²"),
        ("sensor_rotation", f"[{angles}] ± {math.degrees(verdict.error):.2g}°"),
    ]
    if fit.turn is not None:
        rows.append(("gain of angular velocity", f"{fit.turn.gain:.4g}"))
    return rows


def document(found: MountingCheck) -> dict[str, Any]:
    """Returns the mounting check's result for JSON in SI units; unknown values are None."""
    told: dict[str, Any] = {
        "sensor": {"kind": found.kind, "topic": found.topic, "messages": found.messages},
        "reference": {"kind": found.reference[0], "topic": found.reference[1]},
        "wrong": list(found.wrong),
        "reference_wrong": _reference_wrong(found),
        "not_compared": found.missing,
    }
    verdict = found.verdict
    if verdict is None:
        return told
    fit = verdict.fit
    numbers = {
        "lag": fit.lag, "lag_error": fit.lag_error, "gain": fit.gain,
        "gain_error": fit.gain_error, "gravity": fit.gravity, "explained": fit.explained,
        "rotation_error": verdict.error,
        "angular_velocity_gain": fit.turn.gain if fit.turn is not None else math.nan,
    }  # fmt: skip
    return told | {
        "remarks": list(verdict.remarks),
        "not_seen": list(verdict.unseen),
        "motions": found.motions,
        "sensor_rotation": list(verdict.sensor_rotation),
        "rotation_matrix": fit.rotation.T.tolist(),
        **{name: value if math.isfinite(value) else None for name, value in numbers.items()},
    }
