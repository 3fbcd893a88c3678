"""`slosh detect`: heights from a video, a folder of images or a bag."""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

from tqdm import tqdm

from slosh_bringup.frame_source import SourceFrame, open_source
from slosh_camera.calibration import read_calibration
from slosh_camera.detector import FreeSurfaceDetector
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag, Measurement, bad_image

COLUMNS = (
    "t", "frame", "msh", "msh_stddev", "azimuth", "sh_left", "sh_right", "peak_u", "peak_v",
    "peak_side", "flags",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument("source", type=Path, help="video, folder of images, or bag")
    parser.add_argument("--camera", type=Path, required=True, help="camera.yaml")
    parser.add_argument("-o", "--output", type=Path, required=True, help="table [s, m, rad, px]")


def run(arguments: argparse.Namespace) -> int:
    """Measures every image; prints how many could be measured."""
    detector = FreeSurfaceDetector(read_calibration(arguments.camera))
    frames = open_source(arguments.source)
    measured = count = 0
    with arguments.output.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        first: int | None = None
        for frame in tqdm(frames, desc="detect", unit="image"):
            first = frame.stamp_ns if first is None else first
            measurement = measure(detector, frame)
            writer.writerow(row(measurement, frame.name, first))
            count += 1
            measured += measurement.msh == measurement.msh
    print(f"{measured} of {count} images measured, in {arguments.output}")
    return 0 if measured else 1


def measure(detector: FreeSurfaceDetector, frame: SourceFrame) -> Measurement:
    """The measurement of an image; one that cannot be used gives a flag and a line."""
    problem = frame.problem
    if frame.gray is not None:
        try:
            return detector.update(frame.stamp_ns, frame.gray)
        except SloshCameraError as error:
            problem = f"{frame.name}: {error}"
    tqdm.write(f"slosh detect: {problem}", file=sys.stderr)
    return bad_image(frame.stamp_ns)


def row(measurement: Measurement, name: str, first_ns: int) -> list[str]:
    """One line of the table; NaN stands for unknown, flags are joined by '|'."""
    numbers = (
        measurement.msh, measurement.msh_stddev, measurement.azimuth, measurement.sh_left,
        measurement.sh_right, *measurement.peak_pixel,
    )  # fmt: skip
    flags = "|".join(str(flag.name) for flag in Flag if flag and flag in measurement.flags)
    t = (measurement.stamp_ns - first_ns) * 1e-9
    side = measurement.peak_side.name.lower()
    return [f"{t:.6f}", name, *(f"{number:.7g}" for number in numbers), side, flags]
