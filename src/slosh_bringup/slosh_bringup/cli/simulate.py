"""`slosh simulate`: open-loop prediction of a motion table."""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path

import numpy as np

from slosh_bag.motion_table import read_motion_table
from slosh_estimator.model_file import read_model
from slosh_model.simulate import Inputs, Response, simulate

COLUMNS = ("t", "msh", "azimuth", "sh_x", "sh_y")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument("model", type=Path, help="model.yaml")
    parser.add_argument("motion", type=Path, help="motion table: t,ax,ay,az[,...] (.csv, .csv.gz)")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="table of heights [m, rad]"
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Simulates and writes the table; prints the peak."""
    model = read_model(arguments.model)
    motion = read_motion_table(arguments.motion)
    inputs = Inputs(
        t=motion.t,
        acceleration=motion.acceleration,
        attitude=motion.attitude,
        angular_velocity=motion.angular_velocity,
    )
    response, _ = simulate(model, inputs)
    write_response(arguments.output, response)
    print(summary(model.name, response, arguments.output, as_json=arguments.json))
    return 0


def write_response(path: Path, response: Response) -> None:
    """Writes t, msh, azimuth, sh_x, sh_y [s, m, rad], one row per input sample."""
    columns = [getattr(response, name) for name in COLUMNS]
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(
            [repr(float(value)) for value in row] for row in zip(*columns, strict=True)
        )


def summary(name: str, response: Response, output: Path, *, as_json: bool) -> str:
    """The peak height in one line, or as JSON."""
    peak = int(np.argmax(response.msh))
    if as_json:
        facts = {
            "model": name,
            "peak": float(response.msh[peak]),
            "peak_time": float(response.t[peak]),
            "samples": len(response.t),
            "output": str(output),
        }
        return json.dumps(facts)
    height, moment = 1e3 * response.msh[peak], response.t[peak]
    return (
        f"{name}: peak {height:.1f} mm at t = {moment:.3f} s, {len(response.t)} rows in {output}"
    )
