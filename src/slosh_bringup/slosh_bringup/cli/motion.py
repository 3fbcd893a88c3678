"""`slosh motion`: generates a machine's cyclic motion (stroke and dwell) as a motion table."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import numpy as np

from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.quantities import RATE, SPEED, length
from slosh_bringup.errors import SloshBringupError
from slosh_model.motion_profiles import LAWS, Cycle
from slosh_motion.tables.motion_table import (
    SUFFIXES,
    MotionTable,
    is_motion_table,
    write_motion_table,
)

AXES = ("x", "y")
MOST_ROWS = 10_000_000
"""Of a table: more is a rate or a speed mistaken for another."""
EPILOG = """The container moves by the stroke in the first part of each cycle (ratio b) and dwells
in the rest: motion time b * 60/n, cycle time 60/n [s]. For example TM20, Fig. 4:

  slosh motion acceleration_pulse --speed 48 --stroke 0.1 -o pulse_48.csv"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh motion` to the argument parser."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("profile", metavar="PROFILE", help=f"motion law: {', '.join(LAWS)}")
    parser.add_argument(
        "--speed",
        type=SPEED,
        required=True,
        metavar="N",
        help="operating speed n: machine cycles per minute [1/min]",
    )
    parser.add_argument(
        "--stroke",
        type=length(10.0),
        required=True,
        metavar="S",
        help="distance that the container moves, in one direction, in each cycle [m]",
    )
    parser.add_argument(
        "--ratio", type=float, default=0.4, metavar="B",
        help="share of the cycle in which the container moves (default: 0.4)",
    )  # fmt: skip
    parser.add_argument(
        "--rate",
        type=RATE,
        default=1000.0,
        metavar="HZ",
        help="rows per second [Hz] (default: 1000)",
    )
    parser.add_argument(
        "--cycles", type=int, default=1, metavar="K", help="number of cycles (default: 1)"
    )
    parser.add_argument(
        "--axis", choices=AXES, default="x", help="direction of the motion (default: x)"
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="motion table to write (.csv, .csv.gz)"
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Writes the motion table and prints its durations and peak accelerations."""
    if not is_motion_table(arguments.output):
        raise SloshBringupError(f"{arguments.output}: a motion table must end in {SUFFIXES[0]}")
    cycle = Cycle(
        arguments.profile.replace("-", "_"), arguments.speed, arguments.stroke, arguments.ratio
    )
    table = motion_table(cycle, arguments.rate, arguments.cycles, arguments.axis)
    write_motion_table(arguments.output, table)
    print(summary(cycle, table, arguments.output, as_json=arguments.json))
    return 0


def motion_table(cycle: Cycle, rate: float, cycles: int, axis: str) -> MotionTable:
    """Samples a number of machine cycles uniformly and returns them as a motion table.

    Args:
        cycle: what is repeated.
        rate: rows per second [Hz].
        cycles: how many.
        axis: of AXES.

    Raises:
        SloshBringupError: no cycle, too slow a rate for the motion, or too many rows.
    """
    if cycles < 1:
        raise SloshBringupError(f"--cycles {cycles}: must be at least 1")
    if not (math.isfinite(rate) and rate * cycle.motion_time >= 10.0):
        raise SloshBringupError(
            f"--rate {rate:g}: must be at least {10.0 / cycle.motion_time:.4g} Hz, ten rows for "
            f"the {cycle.motion_time:.4g} s in which the container moves"
        )
    intervals = math.ceil(cycles * cycle.cycle_time * rate - 1e-6)
    if intervals >= MOST_ROWS:
        raise SloshBringupError(
            f"{intervals + 1} rows exceed the maximum of {MOST_ROWS}: lower --rate or --cycles"
        )
    t = np.arange(intervals + 1) / rate
    acceleration = np.zeros((len(t), 3))
    acceleration[:, AXES.index(axis)] = cycle.at(t)[2]
    return MotionTable(t, acceleration)


def summary(cycle: Cycle, table: MotionTable, output: Path, *, as_json: bool) -> str:
    """Formats durations and peak acceleration of a cycle, in one line or as JSON."""
    peak = float(np.abs(table.acceleration).max())
    if as_json:
        facts = {
            "profile": cycle.law,
            "cycle_time": cycle.cycle_time,
            "motion_time": cycle.motion_time,
            "peak_acceleration": peak,
            "rows": len(table.t),
            "output": str(output),
        }
        return json.dumps(facts)
    return (
        f"{cycle.law}: moves {cycle.motion_time:.4g} s of each {cycle.cycle_time:.4g} s, "
        f"up to {peak:.3g} m/s², {len(table.t)} rows in {plain_line(output)}"
    )
