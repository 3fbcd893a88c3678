"""Measures the camera's accuracy on rendered sequences with exact heights.

    tools/run python validation/studies/camera_accuracy.py [FOLDER ...] [--disturb] [--docs]

Without folders it takes those of the shared data (SLOSH_SHARED_DATA or ../shared/data). A folder
holds frame_*.jpg, calib.jpg and truth.json as described in the shared data's rendered/README.md,
or folders that do.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import json
import math
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import with_tools  # noqa: F401
from camera_disturbances import UNDISTURBED, all_disturbances
from camera_figures import (
    HIGH,
    Detector,
    FrameResult,
    Options,
    SequenceFigures,
    figures,
    measure_sequence,
    value_of,
)
from camera_robustness import disturbed_figures, measure_disturbed
from camera_sequences import (
    ROOT,
    Image,
    RenderedSequence,
    fit_still,
    read_image,
    read_sequence,
    sequences_in,
    shared_sequences,
)
from camera_tables import accuracy_tables, disturbance_table, replace_table, shortfalls
from tqdm import tqdm

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.detection.drawing import draw_measurement
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.calibration import Calibration

PAGE = ROOT / "docs" / "results" / "accuracy.md"
TOTAL = "**total**"
# Numbered scenes of even number are for tuning, those of odd number to report.
HALVES = ("**even**", "**odd**")


def main() -> int:
    """Measures the sequences named on the command line; returns the exit code."""
    arguments = _parser().parse_args()
    cv2.setNumThreads(1)
    try:
        return run(arguments)
    except SloshCameraError as error:
        print(f"camera_accuracy: {error}", file=sys.stderr)
        return 2


def run(arguments: argparse.Namespace) -> int:
    """Measures the sequences; prints and writes the requested tables and files."""
    given = [path for folder in arguments.folders for path in sequences_in(folder)]
    folders = given or shared_sequences()
    if not folders:
        raise SloshCameraError("no sequences: give folders, or set SLOSH_SHARED_DATA")
    sequences = [read_sequence(folder) for folder in folders]
    options = Options(still=not arguments.no_still, grey=arguments.grey)
    refused: list[str] = []
    if arguments.calibrated:
        sequences, refused = calibrated_sequences(sequences)
    sequences, results, more = measured_sequences(sequences, options)
    refused += more
    if arguments.unflagged:
        results = [tuple(one for one in frames if not one.measured.flags) for frames in results]
    rows = all_figures(sequences, results)
    missed = [line for row in rows[: len(sequences)] for line in shortfalls(row)] + refused
    print(accuracy_tables(rows))
    print("\n".join(missed) or "every requirement is met", flush=True)
    if arguments.docs:
        replace_table(PAGE, "camera", accuracy_tables(rows))
    if arguments.disturb:
        disturbed = disturb(sequences, options)
        print("\n" + "\n".join(disturbed))
        if arguments.docs:
            replace_table(PAGE, "disturbances", disturbed[-1])
    if arguments.frames:
        write_frames(arguments.frames, sequences, results)
    if arguments.json:
        document = [dataclasses.asdict(row) for row in rows]
        arguments.json.write_text(json.dumps(_plain(document), indent=2) + "\n")
    if arguments.worst:
        number, folder = arguments.worst
        write_worst(Path(folder), int(number), sequences, results)
    return 1 if arguments.check and missed else 0


def calibrated_sequences(
    sequences: Sequence[RenderedSequence],
) -> tuple[list[RenderedSequence], list[str]]:
    """Returns the sequences with poses calibrated from their images at rest, and refusals."""
    found, refused = [], []
    for sequence in sequences:
        try:
            fit = fit_still(sequence)
        except SloshCameraError as error:
            refused.append(f"not met: {sequence.name}: refused: {error}")
            continue
        calibration = Calibration(fit.view, detection=sequence.calibration.detection)
        found.append(dataclasses.replace(sequence, calibration=calibration))
    return found, refused


def measured_sequences(
    sequences: Sequence[RenderedSequence], options: Options
) -> tuple[list[RenderedSequence], list[tuple[FrameResult, ...]], list[str]]:
    """Returns measured sequences with their results, and a line for each one that failed.

    Raises:
        SloshCameraError: the detector takes none of them.
    """
    taken, results, refused = [], [], []
    for sequence in sequences:
        try:
            frames = measure_sequence(sequence, make_detector, options)
        except SloshCameraError as error:
            refused.append(f"not met: {sequence.name}: refused: {error}")
            continue
        taken.append(sequence)
        results.append(frames)
    if not taken:
        raise SloshCameraError("; ".join(refused).replace("not met: ", ""))
    return taken, results, refused


def make_detector(calibration: Calibration) -> Detector:
    """Creates the package's detector for a calibration."""
    return FreeSurfaceDetector(calibration)


def all_figures(
    sequences: Sequence[RenderedSequence], results: Sequence[Sequence[FrameResult]]
) -> list[SequenceFigures]:
    """Returns the accuracy of each sequence, of all together, and of each numbered half."""
    pairs = list(zip(sequences, results, strict=True))
    rows = [figures(sequence.name, frames) for sequence, frames in pairs]
    numbers = [re.fullmatch(r"sequence_(\d+)", sequence.name) for sequence in sequences]
    if len(rows) > 1 and all(numbers):
        for half in (0, 1):
            members = [
                frame
                for number, (_, frames) in zip(numbers, pairs, strict=True)
                for frame in frames
                if number and int(number[1]) % 2 == half
            ]
            rows.append(figures(HALVES[half], members))
    if len(rows) > 1:
        rows.append(figures(TOTAL, [frame for _, frames in pairs for frame in frames]))
    return rows


def disturb(sequences: Sequence[RenderedSequence], options: Options) -> list[str]:
    """Formats a table of the accuracy under each image disturbance, by sequence and in total."""
    every = [UNDISTURBED, *all_disturbances()]
    measured = [
        [measure_disturbed(sequence, make_detector, options, change) for sequence in sequences]
        for change in tqdm(every, desc="disturbances")
    ]
    everyone = list(range(len(sequences)))
    groups = [(sequence.name, [index]) for index, sequence in enumerate(sequences)]
    if len(sequences) > 1:
        groups.append((TOTAL, everyone))
    tables = []
    for name, members in groups:
        rows = []
        plain = [measured[0][index] for index in members]
        for change, parts in zip(every, measured, strict=True):
            own = [parts[index] for index in members]
            pairs = zip(own, plain, strict=True)
            single = [
                disturbed_figures(change, one.sequence, [one], [base]) for one, base in pairs
            ]
            rows.append((disturbed_figures(change, name, own, plain), single))
        tables.append(disturbance_table(name, rows))
    return tables


def write_frames(
    folder: Path, sequences: Sequence[RenderedSequence], results: Sequence[Sequence[FrameResult]]
) -> None:
    """Writes a CSV file for each sequence: exact and measured values of each frame."""
    folder.mkdir(parents=True, exist_ok=True)
    for sequence, frames in zip(sequences, results, strict=True):
        with (folder / f"{sequence.name}.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            rows = [frame_row(frame) for frame in frames]
            writer.writerow(rows[0] if rows else [])
            writer.writerows(row.values() for row in rows)


def frame_row(frame: FrameResult) -> dict[str, str]:
    """Formats one frame's exact and measured values as text, by column."""
    truth, measured = frame.truth, frame.measured
    heights = {
        "msh_true": truth.msh,
        "msh": measured.msh,
        "msh_error": measured.msh - truth.msh,
        "msh_sigma": measured.msh_stddev,
        "fitted": value_of(measured, "fitted_msh"),
        "fitted_error": value_of(measured, "fitted_msh") - truth.msh,
        "fitted_sigma": value_of(measured, "fitted_msh_stddev"),
        "left_true": truth.sh_left,
        "left": measured.sh_left,
        "right_true": truth.sh_right,
        "right": measured.sh_right,
    }
    angles = {
        "azimuth_true": truth.azimuth,
        "azimuth": measured.azimuth,
        "fitted_azimuth": value_of(measured, "fitted_azimuth"),
        "slope_angle": value_of(measured, "slope_angle"),
    }
    return {
        "index": str(truth.index),
        **{name: f"{1e3 * value:.3f}" for name, value in heights.items()},
        **{name: f"{math.degrees(value):.2f}" for name, value in angles.items()},
        "side_true": truth.side.name.lower(),
        "side": measured.peak_side.name.lower(),
        "fitted_side": frame.fitted_side.name.lower(),
        "cut": str(int(truth.touches_top)),
        "peak_outside": str(int(truth.peak_outside)),
        "flags": "|".join(str(flag.name) for flag in measured.flags),
    }


def write_worst(
    folder: Path,
    number: int,
    sequences: Sequence[RenderedSequence],
    results: Sequence[Sequence[FrameResult]],
) -> None:
    """Writes annotated images of the frames with the largest errors, for each sequence."""
    folder.mkdir(parents=True, exist_ok=True)
    for sequence, frames in zip(sequences, results, strict=True):
        for rank, frame in enumerate(sorted(frames, key=badness, reverse=True)[:number]):
            picture = _with_truth(read_image(frame.truth.path), sequence, frame)
            picture = draw_measurement(picture, sequence.calibration, frame.measured)
            name = f"{sequence.name}_{rank}_frame_{frame.truth.index:03d}.png"
            cv2.imwrite(str(folder / name), picture)


def badness(frame: FrameResult) -> float:
    """Returns the larger of a frame's two height errors [m]; for a cut frame only excess."""
    values = [frame.measured.msh, value_of(frame.measured, "fitted_msh")]
    errors = [value - frame.truth.msh for value in values if math.isfinite(value)]
    if frame.truth.touches_top:
        return max([0.0, *errors]) if frame.measured.flags else math.inf
    wrong_side = (
        frame.truth.msh > HIGH
        and bool(frame.truth.side)
        and frame.measured.peak_side is not frame.truth.side
    )
    return max([abs(error) for error in errors], default=math.inf) + 1e-3 * wrong_side


def _with_truth(image: Image, sequence: RenderedSequence, frame: FrameResult) -> Image:
    """Returns a copy of the image with the exact wall lines and values drawn."""
    picture = image.copy()
    azimuth = np.linspace(-np.pi, np.pi, 721)
    line = sequence.calibration.view.project_wall(azimuth, frame.truth.height(azimuth))
    line = np.asarray(line)[np.all(np.isfinite(line), axis=1)]
    cv2.polylines(
        picture, [np.rint(8.0 * line).astype(np.int32)], False, (0, 255, 255), 1, cv2.LINE_AA, 3
    )
    truth = frame.truth
    text = (
        f"truth {1e3 * truth.msh:.2f} mm, {math.degrees(truth.azimuth):.0f} deg, "
        f"{truth.side.name.lower()}; raw {1e3 * (frame.measured.msh - truth.msh):+.2f}, "
        f"fitted {1e3 * (value_of(frame.measured, 'fitted_msh') - truth.msh):+.2f} mm"
    )
    place = (8, picture.shape[0] - 10)
    cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0), 3, cv2.LINE_AA)
    cv2.putText(
        picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 255, 255), 1, cv2.LINE_AA
    )
    return picture


def _plain(value: Any) -> Any:
    """Replaces values that JSON cannot represent by None."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Camera heights against exact truth.")
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER")
    parser.add_argument("--no-still", action="store_true", help="do not learn from calib.jpg")
    parser.add_argument("--grey", action="store_true", help="read the images in grey")
    parser.add_argument("--frames", type=Path, metavar="DIR", help="write a CSV per sequence")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures")
    parser.add_argument("--worst", nargs=2, metavar=("N", "DIR"), help="draw the worst frames")
    parser.add_argument(
        "--calibrated", action="store_true", help="by the pose that the still image tells"
    )
    parser.add_argument("--unflagged", action="store_true", help="use only frames without a flag")
    parser.add_argument("--disturb", action="store_true", help="measure also under disturbances")
    parser.add_argument("--docs", action="store_true", help=f"write the tables into {PAGE.name}")
    parser.add_argument("--check", action="store_true", help="exit with 1 if a requirement fails")
    return parser


if __name__ == "__main__":
    sys.exit(main())
