"""Measures how accurate `slosh calibrate` is on images at rest with known camera pose.

    tools/run python validation/studies/calibration_accuracy.py [FOLDER ...] [--docs]

A folder holds sequences of the shared data's format, or is one; default: the shared data. Beside
the errors that the found pose makes of heights stands what the calibration claims of them.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import with_tools  # noqa: F401
from camera_sequences import (
    RenderedSequence,
    fit_still,
    read_sequence,
    sequences_in,
    shared_sequences,
)
from camera_tables import replace_table

from slosh_camera.calibrate.still_fit import HEIGHTS, warnings_of
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.cup import CupView, Wall

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "results" / "calibration_accuracy.md"
HEAD = (
    "| still | front wall, largest | claimed σ | rear wall, largest | claimed σ | "
    "distance | pitch | z | warned |"
)
# Errors of so many claimed standard errors are no chance.
MOST = 3.0
_ARC = np.deg2rad(np.linspace(-60.0, 60.0, 25))


def main() -> int:
    """Prints the table; returns 1 if an image could not be calibrated."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "folder", nargs="*", type=Path, help="sequences (default: the shared data)"
    )
    parser.add_argument(
        "--half", choices=("even", "odd"), help="scenes whose name ends in such a number alone"
    )
    parser.add_argument("--table", default="calibration", help="which table of the page to write")
    parser.add_argument("--docs", action="store_true", help=f"write the table into {PAGE.name}")
    arguments = parser.parse_args()
    folders = [found for folder in arguments.folder for found in sequences_in(folder)]
    lines, refused = [HEAD, "|---|" + "--:|" * 8], []
    for folder in folders or shared_sequences():
        if arguments.half and int(folder.name[-1]) % 2 != ("even", "odd").index(arguments.half):
            continue
        sequence = read_sequence(folder)
        try:
            lines.append(row(sequence))
        except SloshCameraError as error:
            print(f"{sequence.name}: {error}", file=sys.stderr)
            refused.append(sequence.name)
    print("\n".join(lines) + "\n" + summary(lines[2:], refused))
    table = "\n".join([*lines, "", f"Refused: {', '.join(refused) or 'none'}."])
    if arguments.docs:
        replace_table(PAGE, arguments.table, table)
    return 1 if refused else 0


def row(sequence: RenderedSequence) -> str:
    """Formats one sequence's errors: heights and distance [mm], pitch [deg]."""
    truth = sequence.calibration.view
    fit = fit_still(sequence)
    cells, ratio = [sequence.name], 0.0
    for wall in Wall:
        error = height_errors(truth, fit.view, wall)
        worst = error[np.argmax(np.abs(error))]
        cells += [f"{1e3 * worst:+.2f}", f"{1e3 * fit.height_stddev[wall]:.2f}"]
        ratio = max(ratio, abs(worst) / fit.height_stddev[wall])
    rotation = fit.view.pose.rotation @ truth.pose.rotation.T
    distance = np.hypot(*fit.view.pose.camera_centre[:2]) - np.hypot(*truth.pose.camera_centre[:2])
    cells += [
        f"{1e3 * distance:+.1f}",
        f"{np.rad2deg(np.arcsin(np.clip(rotation[2, 1], -1.0, 1.0))):+.2f}",
        f"{ratio:.1f}",
        "yes" if warnings_of(fit) else "",
    ]
    return "| " + " | ".join(cells) + " |"


def summary(rows: list[str], refused: list[str]) -> str:
    """Summarises how many images were refused, and how many errors exceed the stated ones."""
    given = [[cell.strip() for cell in row.split("|")] for row in rows]
    off = [row for row in given if not float(row[-3]) <= MOST]
    silent = [row[1] for row in off if not row[-2]]
    return (
        f"{len(given) + len(refused)} stills, {len(refused)} refused, {len(off)} off by more than "
        f"{MOST:g} claimed standard errors, {len(silent)} of them without a warning {silent}"
    )


def height_errors(truth: CupView, found: CupView, wall: Wall) -> np.ndarray:
    """Returns the errors of heights from -20 to 20 mm that a calibrated pose causes [m]."""
    middle = truth.camera_azimuth + (np.pi if wall is Wall.REAR else 0.0)
    azimuth, height = np.tile(middle + _ARC, len(HEIGHTS)), np.repeat(HEIGHTS, _ARC.size)
    _, read = found.on_wall(truth.project_wall(azimuth, height, wall), wall)
    return np.asarray(read - height)[np.isfinite(read)]


if __name__ == "__main__":
    sys.exit(main())
