"""`slosh detect`: measures liquid heights in a video, a folder of images or a bag."""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from pathlib import Path

from slosh_base.files import check_apart, new_text
from slosh_base.files.plain_text import plain_line
from slosh_base.files.quiet_decoders import quiet_decoders
from slosh_bringup.cli.output_names import TABLE, check_ending
from slosh_bringup.cli.progress import Progress, Unit, say
from slosh_bringup.cli.quantities import RATE
from slosh_bringup.detect.frame import FOLDER_RATE, FrameSource
from slosh_bringup.detect.measuring import Detection, Result, measure_all
from slosh_bringup.detect.pictures import (
    WORST_LENGTH,
    AnnotatedVideo,
    PictureSink,
    PictureStrip,
    Worst,
)
from slosh_bringup.detect.source import open_source
from slosh_bringup.detect.table import COLUMNS, DetectionSummary, row
from slosh_bringup.errors import SloshBringupError
from slosh_camera.calibrate.camera_file import read_any_calibration
from slosh_camera.optics.calibration import AnyCalibration

WORST_LIMIT = 60
# Starting a process takes as long as measuring so many images.
_WORTH_A_PROCESS = 60
_MOST_JOBS = 64
# Of a thousand broken images the first few say enough.
_TOLD_PROBLEMS = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh detect` to the argument parser."""
    parser.add_argument(
        "source", nargs="+", help="video, folder of images, image(s), 'pattern*.png' or bag"
    )
    parser.add_argument(
        "--camera", type=Path, required=True, help="calibration file of the camera (camera.yaml)"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help="CSV table to write: heights, with columns in s, m, rad and px",
    )
    parser.add_argument(
        "--still",
        type=Path,
        metavar="IMAGE",
        help="image of the liquid at rest, used as reference",
    )
    parser.add_argument(
        "--video",
        type=Path,
        metavar="OUT.mp4",
        help="video to write: all images with the measured line",
    )
    parser.add_argument(
        "--strip",
        type=Path,
        metavar="OUT.png",
        help="contact sheet to write: a selection of images with the measured line",
    )
    parser.add_argument(
        "--worst", nargs="+", metavar=("OUT.png", "N"),
        help="contact sheet to write: the N images with the largest uncertainty, the worst "
        f"first (default N: {WORST_LENGTH})",
    )  # fmt: skip
    parser.add_argument(
        "--rate", type=RATE, metavar="HZ",
        help=f"images per second (default: {FOLDER_RATE:g} for image files, the video's own "
        "rate for a video)",
    )  # fmt: skip
    parser.add_argument(
        "--topic",
        metavar="TOPIC",
        help="image topic to measure (needed if the bag has several image topics)",
    )
    parser.add_argument(
        "--jobs", type=int, metavar="N", help="number of processes (default: one per core)"
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Measures the liquid height in every image and prints how many images were measured."""
    rate = arguments.rate
    if rate is not None and not (math.isfinite(rate) and 0.0 < rate <= 1e6):
        raise SloshBringupError(f"--rate {rate:g}: must be positive, at most 1e6 Hz")
    calibration = read_any_calibration(arguments.camera)
    detection = Detection(calibration, arguments.still)
    with quiet_decoders(), ExitStack() as unfinished:
        source = open_source(arguments.source, rate, arguments.topic)
        _check_outputs(arguments, [*source.files, calibration.still_image])
        sinks = _sinks(arguments, calibration, source)
        for sink in sinks:
            unfinished.callback(sink.discard)
        if source.note:
            _tell(f"{source.name}: {source.note}")
        jobs = _jobs(arguments.jobs, source.total)
        detector = detection.detector()
        if detector.doubt:
            _tell(f"warning: still image: {detector.doubt}")
        with closing(measure_all(detection, detector, source.frames, jobs)) as results:
            summary = _write_table(arguments.output, source, results, sinks)
        pictures = [sink.finish() for sink in sinks]
    warnings = [detector.doubt] if detector.doubt else []
    _print(arguments, summary, source, pictures, [*warnings, *source.warnings])
    return 0 if summary.measured else 1


def _check_outputs(arguments: argparse.Namespace, images: Sequence[Path | None]) -> None:
    """Raises an error if an output file would overwrite an input image."""
    inputs = [*images, arguments.camera, arguments.still]
    worst = Path(arguments.worst[0]) if arguments.worst else None
    check_apart([arguments.output, arguments.video, arguments.strip, worst], inputs)
    check_ending(arguments.output, "a table", TABLE)
    if arguments.video is not None:
        # Where no codec works, a sheet takes the video's place.
        check_apart([arguments.video.with_suffix(".png")], inputs)


def _sinks(
    arguments: argparse.Namespace, calibration: AnyCalibration, source: FrameSource
) -> list[PictureSink]:
    """Creates the requested picture outputs; raises an error for an invalid file name."""
    sinks: list[PictureSink] = []
    if arguments.video is not None:
        sinks.append(AnnotatedVideo(arguments.video, calibration, source.rate))
    if arguments.strip is not None:
        sinks.append(PictureStrip(arguments.strip, calibration))
    if arguments.worst is not None:
        path, *further = arguments.worst
        sinks.append(Worst(Path(path), calibration, _worst_length(further)))
    return sinks


def _worst_length(words: Sequence[str]) -> int:
    if not words:
        return WORST_LENGTH
    if len(words) > 1 or not words[0].isdecimal() or not 1 <= int(words[0]) <= WORST_LIMIT:
        raise SloshBringupError(
            f"--worst {' '.join(words)}: must be a picture's name and a number from 1 to "
            f"{WORST_LIMIT}"
        )
    return int(words[0])


def _jobs(wanted: int | None, total: int | None) -> int:
    """Returns the number of worker processes; the default depends on the number of images."""
    if wanted is not None:
        if not 1 <= wanted <= _MOST_JOBS:
            raise SloshBringupError(f"--jobs {wanted}: must be from 1 to {_MOST_JOBS}")
        return wanted
    cores = min(len(os.sched_getaffinity(0)), _MOST_JOBS)
    return cores if total is None else max(min(cores, total // _WORTH_A_PROCESS), 1)


def _write_table(
    output: Path, source: FrameSource, results: Iterator[Result], sinks: Sequence[PictureSink]
) -> DetectionSummary:
    """Writes the table of measurements, one row per image.

    Raises:
        SloshBringupError: there are none; the old table stays.
    """
    summary, first_ns = DetectionSummary(), None
    progress = Progress("detect", source.total, Unit("images"))
    with new_text(output) as file, progress:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for result in results:
            measurement = result.measurement
            first_ns = measurement.stamp_ns if first_ns is None else first_ns
            writer.writerow(row(measurement, plain_line(result.frame.name), first_ns))
            summary.add(measurement, result.problem)
            if result.problem and summary.problems <= _TOLD_PROBLEMS:
                _tell(result.problem)
            for sink in sinks:
                sink.add(result)
            progress.add()
        for warning in source.warnings:
            _tell(f"warning: {warning}")
        if not summary.frames:
            raise SloshBringupError(f"{source.name}: no image could be read")
    if summary.problems > _TOLD_PROBLEMS:
        _tell(f"{summary.problems - _TOLD_PROBLEMS} more images like these, see the table's flags")
    return summary


def _tell(sentence: str) -> None:
    say(f"slosh detect: {sentence}")


def _print(
    arguments: argparse.Namespace, summary: DetectionSummary, source: FrameSource,
    pictures: Sequence[str], warnings: Sequence[str],
) -> None:  # fmt: skip
    if arguments.json:
        facts = {"source": source.name, "table": str(arguments.output), **summary.facts()}
        print(json.dumps({**facts, "warnings": warnings, "pictures": pictures}))
        return
    print(f"{summary.text()}, in {plain_line(arguments.output)}")
    if summary.mostly_unseen:
        _tell(
            f"most images show no liquid surface at the place given by {arguments.camera}: "
            "check that this file belongs to the camera and that nothing has moved since; run "
            "`slosh calibrate` on an image at rest"
        )
    for sentence in pictures:
        print(plain_line(sentence))
