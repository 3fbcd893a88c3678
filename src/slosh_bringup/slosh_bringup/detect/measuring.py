"""Measures images in parallel processes and returns the results in order.

Most of the work is to look at an image by itself, whatever the others are. What the images before
tell of it, and whether it repeats the one before, is decided here, in order: the numbers do not
depend on how many processes share the work.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import connection
from pathlib import Path
from typing import Any, NamedTuple

import cv2

from slosh_bringup.detect.frame import SourceFrame
from slosh_bringup.errors import SloshBringupError
from slosh_camera.detection.detectors import SurfaceDetector, learnt_detector
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.seams import Digest, RepeatedFrames, digest
from slosh_camera.measurement import Flag, Measurement, bad_image
from slosh_camera.optics.calibration import AnyCalibration

_WAITING_PER_PROCESS = 3
"""Images that wait for each process: enough to keep it busy, few enough to hold in memory."""


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """Camera calibration and image of the liquid at rest, for all measuring processes.

    Attributes:
        calibration: camera, container and settings.
        still_image: image of the liquid at rest to learn from first; None: the one that the
            calibration names, if any.
    """

    calibration: AnyCalibration
    still_image: Path | None = None

    def detector(self) -> SurfaceDetector:
        """Creates a detector and initialises it with the image of the liquid at rest.

        Raises:
            SloshCameraError: the calibration or the still image cannot be used.
        """
        return learnt_detector(self.calibration, self.still_image)


class Result(NamedTuple):
    """An image with its measurement, or with the reason why it was not measured."""

    frame: SourceFrame
    measurement: Measurement
    problem: str


class _Look(NamedTuple):
    """An image prepared for measuring, its hash, and the reason if it cannot show a surface."""

    sighting: Any
    mark: Digest | None
    problem: str


def measure_all(
    detection: Detection, detector: SurfaceDetector, frames: Iterable[SourceFrame], jobs: int = 1
) -> Generator[Result]:
    """Measures the images in order and yields one result per image.

    Args:
        detection: how.
        detector: made by it.
        frames: the images; no more are taken than the processes soon need.
        jobs: number of processes; 1: this one.

    Returns:
        The results in the order of the images.

    Raises:
        SloshBringupError: a process has ended before its work.
    """
    looks: Iterator[tuple[SourceFrame, _Look]]
    if jobs == 1:
        looks = ((frame, _look(detector, frame)) for frame in frames)
    else:
        looks = _in_processes(detection, frames, jobs)
    return _followed(detector, looks)


def _followed(
    detector: SurfaceDetector, looks: Iterable[tuple[SourceFrame, _Look]]
) -> Generator[Result]:
    repeated = RepeatedFrames()
    for frame, (sighting, mark, problem) in looks:
        if mark is None:
            yield Result(frame, bad_image(frame.stamp_ns), problem)
            continue
        measurement = detector.follow(frame.stamp_ns, sighting)
        if repeated.repeats(mark, frame.stamp_ns):
            measurement = measurement.flagged(Flag.FROZEN)
        yield Result(frame, measurement, problem)


def _look(detector: SurfaceDetector, frame: SourceFrame) -> _Look:
    try:
        image = frame.image()
        sighting = detector.look(image)
    except SloshCameraError as error:
        told = str(error) if frame.name in str(error) else f"{frame.name}: {error}"
        return _Look(None, None, told)
    return _Look(sighting, digest(image), "")


def _in_processes(
    detection: Detection, frames: Iterable[SourceFrame], jobs: int
) -> Iterator[tuple[SourceFrame, _Look]]:
    # A fork would copy OpenCV's threads in whatever state they are.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, context, _begin, (detection,))
    waiting: deque[tuple[SourceFrame, Future[_Look]]] = deque()
    try:
        for frame in frames:
            with _interrupts_later():
                waiting.append((frame, pool.submit(_work, frame)))
            if len(waiting) >= _WAITING_PER_PROCESS * jobs:
                first, future = waiting.popleft()
                yield first, future.result()
        while waiting:
            first, future = waiting.popleft()
            yield first, future.result()
    except BrokenProcessPool:
        raise SloshBringupError(
            "a measuring process ended unexpectedly, perhaps for lack of memory; try --jobs 1"
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Blocks Ctrl-C in child processes that are started inside a `with` block."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_detector: SurfaceDetector | None = None


def _begin(detection: Detection) -> None:
    """Prepares a worker process: creates its detector and makes it exit with its parent."""
    global _detector
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _detector = detection.detector()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _work(frame: SourceFrame) -> _Look:
    if _detector is None:
        raise SloshBringupError("a process has no detector")
    return _look(_detector, frame)
