"""`slosh simulate`: open-loop prediction of a motion table."""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slosh_bag.motion_table import read_motion_table
from slosh_estimator.model_file import read_model
from slosh_files import check_apart, new_text
from slosh_model.measure import predicted_heights
from slosh_model.simulate import Inputs, Response, simulate

COLUMNS = ("t", "msh", "azimuth", "sh_x", "sh_y")
EPILOG = """columns of the table:
  t           the motion's samples [s]
  msh         maximum height over the wall as a sensor would read it: with every effect of the
              model, also those on the measurement (offset, scale, delay, ...) [m]
  azimuth     of the liquid's own maximum, from the container's +x [rad]
  sh_x, sh_y  the liquid's own signed height at the container's +x and +y [m]

Without effects on the measurement msh is the length of (sh_x, sh_y); in a rectangle the sum of
their sizes, the height of its corner."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("model", type=Path, help="model.yaml")
    parser.add_argument("motion", type=Path, help="motion table: t,ax,ay,az[,...] (.csv, .csv.gz)")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="table of heights [m, rad]"
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Simulates and writes the table; prints the peak."""
    check_apart([arguments.output], [arguments.model, arguments.motion])
    model = read_model(arguments.model)
    motion = read_motion_table(arguments.motion)
    inputs = Inputs(
        t=motion.t,
        acceleration=motion.acceleration,
        attitude=motion.attitude,
        angular_velocity=motion.angular_velocity,
    )
    response, _ = simulate(model, inputs)
    msh = predicted_heights(model, inputs, inputs.t)[:, 0]
    write_response(arguments.output, response, msh)
    print(summary(model.name, response.t, msh, arguments.output, as_json=arguments.json))
    return 0


def write_response(path: Path, response: Response, msh: NDArray[np.float64]) -> None:
    """Writes t, msh, azimuth, sh_x, sh_y [s, m, rad], one row per input sample.

    Args:
        path: where to.
        response: the liquid's own answer.
        msh: (N,) what a sensor would read of its maximum [m].
    """
    columns = (response.t, msh, response.azimuth, response.sh_x, response.sh_y)
    with new_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(
            [repr(float(value)) for value in row] for row in zip(*columns, strict=True)
        )


def summary(
    name: str, t: NDArray[np.float64], msh: NDArray[np.float64], output: Path, *, as_json: bool
) -> str:
    """The peak height in one line, or as JSON."""
    peak = int(np.argmax(msh))
    if as_json:
        facts = {
            "model": name,
            "peak": float(msh[peak]),
            "peak_time": float(t[peak]),
            "samples": len(t),
            "output": str(output),
        }
        return json.dumps(facts)
    height, moment = 1e3 * msh[peak], t[peak]
    return f"{name}: peak {height:.1f} mm at t = {moment:.3f} s, {len(t)} rows in {output}"
