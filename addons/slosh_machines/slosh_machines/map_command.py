"""`slosh motion-map`: finds the stroke with the lowest waves for each speed of a machine."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np

from slosh_base.files import new_folder, write_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli import quantities
from slosh_bringup.cli.progress import share_bar
from slosh_bringup.cli.quantities import FRACTION, HEIGHT
from slosh_bringup.cli.rim_option import add_rim_distance
from slosh_bringup.errors import SloshBringupError
from slosh_machines.design import Stroke
from slosh_machines.map_page import map_document
from slosh_machines.motion_map import MOST, MotionMap, motion_map
from slosh_machines.structured_text import structured_text, table_text
from slosh_model.model_text import read_model
from slosh_plan.errors import SloshPlanError
from slosh_plan.limits import HeightLimits
from slosh_plan.planning.limits import ACCELERATION, JERK, RESIDUAL, PlanLimits
from slosh_report.text import printed, write_document

TABLE, BLOCK, PAGE = "map.csv", "stroke.st", "report.html"
EXIT_ENDS = 1
SPEEDS = 0.1, 6000.0
SHORTEST = 1e-4
"""Stroke for which laws are sought [m]."""
EPILOG = """In each cycle the container moves by the stroke along its x axis during a share of the
cycle (--ratio) and rests in what remains. For each speed the law with the lowest wave is found. A
controller interpolates between the speeds; interpolated laws are simulated, too, over many cycles.

files in DIR:
  map.csv      polynomials of the seventh degree by speed and segment
  stroke.st    the same as a function block in structured text (IEC 61131-3)
  report.html  page with table and pictures

exit code: 0, 1 where the map ends below the highest speed asked for, 2 for wrong input"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh motion-map` to the argument parser."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("model", type=Path, help="model of the liquid (model.yaml)")
    parser.add_argument(
        "--stroke", type=quantities.length(10.0), required=True, metavar="S",
        help="distance that the container moves, in one direction, in each cycle [m]",
    )  # fmt: skip
    parser.add_argument(
        "--speeds", type=speeds, required=True, metavar="FROM:TO[:STEP]",
        help="speeds of the machine, in cycles per minute [1/min]; the step is 1 by default",
    )  # fmt: skip
    parser.add_argument(
        "--limit", type=HEIGHT, metavar="M",
        help="largest allowed height of the liquid [m]; or give --rim-distance",
    )  # fmt: skip
    add_rim_distance(parser)
    parser.add_argument(
        "--residual", type=HEIGHT, metavar="M",
        help="largest allowed height during the dwell [m] (default: half of --limit)",
    )  # fmt: skip
    parser.add_argument(
        "--ratio", type=FRACTION, default=0.4, metavar="B",
        help="share of the cycle in which the container moves (default: 0.4)",
    )  # fmt: skip
    parser.add_argument(
        "--max-acceleration", type=quantities.ACCELERATION, default=ACCELERATION, metavar="A",
        help="largest allowed acceleration [m/s²] (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--max-jerk", type=quantities.JERK, default=JERK, metavar="J",
        help="largest allowed jerk [m/s³] (default: %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR",
        help="folder for results, new or empty",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def speeds(text: str) -> list[float]:
    """Parses speeds such as `20:60`, `20:60:5` or `0.5Hz:1Hz` (lowest, highest, step) [1/min].

    Raises:
        argparse.ArgumentTypeError: not two or three numbers with or without a unit of cycles by
            time, or impossible speeds.
    """
    parts = text.split(":")
    if len(parts) not in (2, 3):
        one = "; for one speed give a range that contains it" if len(parts) == 1 else ""
        raise argparse.ArgumentTypeError(
            f"{text!r:.60} is not FROM:TO or FROM:TO:STEP, such as 20:60{one}"
        )
    low, high, step = (quantities.SPEED(part) for part in [*parts, "1"][:3])
    least, most = SPEEDS
    if not (least <= low < high <= most and 0.0 < step <= high - low):
        raise argparse.ArgumentTypeError(
            f"{text!r:.60}: speeds must rise within {least:g} … {most:g}/min, by steps above 0"
        )
    count = math.ceil(round((high - low) / step, 9))
    if count >= MOST:
        raise argparse.ArgumentTypeError(f"{text!r:.60}: {count + 1} speeds; at most {MOST}")
    return [*(low + step * np.arange(count)).tolist(), high]


def run(arguments: argparse.Namespace) -> int:
    """Finds the time laws of the strokes, writes the result folder and prints a summary."""
    if not 0.05 <= arguments.ratio <= 1.0:
        raise SloshBringupError(f"--ratio {arguments.ratio:g}: must be 0.05 … 1")
    if not arguments.stroke >= SHORTEST:
        raise SloshBringupError(
            f"--stroke {arguments.stroke:g}: must be {SHORTEST:g} m or more; the direction "
            "does not matter"
        )
    model = read_model(arguments.model)
    limit = arguments.limit
    if limit is None:
        if arguments.rim_distance == 0.0:
            raise SloshBringupError("--limit or --rim-distance is needed")
        limit = HeightLimits(rim_distance=arguments.rim_distance).under_rim(model).height
    limits = PlanLimits(
        limit, RESIDUAL * limit if arguments.residual is None else arguments.residual,
        arguments.max_acceleration, arguments.max_jerk, rim_distance=arguments.rim_distance,
    )  # fmt: skip
    stroke = Stroke(arguments.stroke, arguments.ratio)
    try:
        with new_folder(arguments.output) as folder:
            with share_bar("speeds") as progress:
                found = motion_map(
                    model, stroke, arguments.speeds, limits, lambda share: progress("", share)
                )
            write_text(folder / TABLE, table_text(found))
            write_text(folder / BLOCK, structured_text(found))
            lines = tuple(summary(found, arguments.output))
            document = map_document(model, found, str(arguments.model), facts(found), lines)
            write_document(folder / PAGE, document)
    except SloshPlanError as error:
        print(plain_line(f"slosh motion-map: {error}"), file=sys.stderr)
        return EXIT_ENDS
    print(printed(document, arguments.json), end="")
    return EXIT_ENDS if found.reason else 0


def facts(found: MotionMap) -> dict[str, object]:
    """Returns the motion map's results in SI units; speeds are per minute."""
    return {
        "safe_to": found.rows[-1].speed,
        "fastest": found.fastest,
        "reason": found.reason or None,
        "height_limit": found.limits.height,
        "residual_limit": found.limits.residual,
        "checked": len(found.checked),
        "rows": [
            {
                "speed": row.speed, "duration": found.stroke.duration(row.speed),
                "peak": row.found.peak, "residual": row.found.residual,
                "acceleration": row.found.acceleration, "jerk": row.found.jerk,
            }
            for row in found.rows
        ],
    }  # fmt: skip


def summary(found: MotionMap, output: Path) -> list[str]:
    """Describes the motion map in a few lines of text."""
    first, last = found.rows[0], found.rows[-1]
    return [
        f"{first.speed:g} to {last.speed:g}/min in {len(found.rows)} rows, "
        f"{len(found.checked)} interpolated speeds simulated: all keep "
        f"{1e3 * found.limits.height:.4g} mm, in the dwell {1e3 * found.limits.residual:.4g} mm",
        *(
            f"{row.speed:g}/min: {found.stroke.duration(row.speed):.3f} s, peak "
            f"{1e3 * row.found.peak:.1f} mm, in the dwell {1e3 * row.found.residual:.1f} mm, "
            f"{row.found.acceleration:.2f} m/s², {row.found.jerk:.0f} m/s³"
            for row in (first, last)
        ),
        *([f"no safe stroke above {last.speed:.4g}/min: {found.reason}"] if found.reason else []),
        plain_line(f"{output / TABLE}, {output / BLOCK}, {output / PAGE}"),
    ]
