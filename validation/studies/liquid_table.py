"""Measures rendered scenes of many liquids; fills docs/results/liquids.md.

tools/run python validation/scenes/render.py liquids --no-masks -o out/liquids
tools/run python validation/studies/liquid_table.py out/liquids --docs
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import with_tools  # noqa: F401
from camera_figures import FrameResult, Options, figures, measure_sequence
from camera_sequences import ROOT, Image, RenderedSequence, read_image, read_sequence, sequences_in
from camera_tables import replace_table

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.detection.drawing import draw_measurement
from slosh_camera.errors import SloshCameraError

PAGE = ROOT / "docs" / "results" / "liquids.md"
SHEET = ROOT / "docs" / "images" / "liquids.jpg"
HEAD = (
    "| | | verdict | heights | RMS [mm] | largest [mm] | within 2σ | median σ [mm] | silent |\n"
    "|--:|---|---|--:|--:|--:|--:|--:|--:|"
)
GOOD, DOUBTFUL = 0.8, 0.2
"""Shares of the images with a height, for the verdict."""
COLUMNS, SIZE = 4, (360, 270)


def main() -> int:
    """Measures every scene in a folder and prints or writes the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--docs", action="store_true", help="write table and pictures")
    arguments = parser.parse_args()
    rows, pictures = [], []
    for number, folder in enumerate(sequences_in(arguments.folder), start=1):
        sequence = read_sequence(folder)
        about = json.loads((folder / "truth.json").read_text())["about"]
        row, picture = measured(sequence, about)
        rows.append(f"| {number} | {row}")
        pictures.append(labelled(picture, str(number)))
    table = "\n".join([HEAD, *rows])
    print(table)
    if arguments.docs:
        replace_table(PAGE, "liquids", f"{table}\n")
        cv2.imwrite(str(SHEET), sheet(pictures), [cv2.IMWRITE_JPEG_QUALITY, 82])
    return 0


def measured(sequence: RenderedSequence, about: str) -> tuple[str, Image]:
    """Measures a liquid's scene; returns its table row and the image of the highest wave."""
    highest = max(sequence.frames, key=lambda frame: frame.msh)
    plain = read_image(highest.path)
    try:
        frames = measure_sequence(sequence, FreeSurfaceDetector, Options())
    except SloshCameraError as error:
        return f"{about} | refused: {error} | 0 of {len(sequence.frames)} | | | | | |", plain
    found = figures(sequence.name, frames).raw
    share = found.count / max(found.count + found.missing, 1)
    heights = f"{found.count} of {found.count + found.missing}"
    row = f"{about} | {verdict(share, found.silent, frames)} | {heights} | "
    if found.count:
        row += (
            f"{1e3 * found.rms:.2f} | {1e3 * found.largest:.2f} | {100 * found.within_2:.0f} % | "
            f"{1e3 * found.sigma:.2f} | {found.silent} |"
        )
    else:
        row += "– | – | – | – | 0 |"
    shown = next(frame for frame in frames if frame.truth.index == highest.index)
    return row, draw_measurement(plain, sequence.calibration, shown.measured)


def verdict(share: float, silent: int, frames: Sequence[FrameResult]) -> str:
    """Describes in words how well a liquid can be measured."""
    if share < DOUBTFUL:
        flags = {str(flag.name) for frame in frames for flag in frame.measured.flags}
        return f"not measurable ({', '.join(sorted(flags))})"
    if silent:
        return "with silent errors"
    return "measurable" if share >= GOOD else "in part"


def labelled(picture: Image, text: str) -> Image:
    """Scales an image to the sheet's cell and writes its number on it."""
    small = cv2.resize(picture, SIZE, interpolation=cv2.INTER_AREA)
    for colour, width in (((0, 0, 0), 5), ((255, 255, 255), 2)):
        cv2.putText(small, text, (8, 34), cv2.FONT_HERSHEY_SIMPLEX, 1.1, colour, width,
                    cv2.LINE_AA)  # fmt: skip
    return np.asarray(small, np.uint8)


def sheet(pictures: Sequence[Image]) -> Image:
    """Arranges all images in rows of COLUMNS."""
    blank = np.full_like(pictures[0], 255)
    padded = [*pictures, *[blank] * (-len(pictures) % COLUMNS)]
    rows = [np.hstack(padded[k : k + COLUMNS]) for k in range(0, len(padded), COLUMNS)]
    return np.asarray(np.vstack(rows), np.uint8)


if __name__ == "__main__":
    sys.exit(main())
