"""Measures image after image, on several processor cores, in order.

An image is measured alone, whatever the others are: the numbers do not depend on how many
processes share the work. Only whether an image repeats the one before is decided here, in order.
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
from typing import NamedTuple

import cv2

from slosh_bringup.detect.frame import SourceFrame
from slosh_bringup.errors import SloshBringupError
from slosh_camera.detection.detectors import SurfaceDetector
from slosh_camera.detection.learnt import learnt_detector
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.repeats import Digest, RepeatedFrames, digest
from slosh_camera.measurement import Flag, Measurement, bad_image
from slosh_camera.optics.calibration import AnyCalibration

_WAITING_PER_PROCESS = 3
"""Images that wait for each process: enough to keep it busy, few enough to hold in memory."""


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """What every process needs to measure alike.

    Attributes:
        calibration: camera, container and settings.
        still_image: image of the liquid at rest to learn from first; None: the one that the
            calibration names, if any.
    """

    calibration: AnyCalibration
    still_image: Path | None = None

    def detector(self) -> SurfaceDetector:
        """A detector that has learnt from the still image.

        Raises:
            SloshCameraError: the calibration or the still image cannot be used.
        """
        return learnt_detector(self.calibration, self.still_image)


class Result(NamedTuple):
    """An image, what was measured in it, and in words why nothing could be."""

    frame: SourceFrame
    measurement: Measurement
    problem: str


class _Answer(NamedTuple):
    measurement: Measurement
    mark: Digest | None
    problem: str


def measure_all(
    detection: Detection, frames: Iterable[SourceFrame], jobs: int = 1
) -> Generator[Result]:
    """Measures images.

    Args:
        detection: how.
        frames: the images; no more are taken than the processes soon need.
        jobs: number of processes; 1: this one.

    Returns:
        The results in the order of the images.

    Raises:
        SloshCameraError: the calibration or the still image cannot be used.
        SloshBringupError: a process has ended before its work.
    """
    detector = detection.detector()
    answers: Iterator[tuple[SourceFrame, _Answer]]
    if jobs == 1:
        answers = ((frame, _measure(detector, frame)) for frame in frames)
    else:
        answers = _in_processes(detection, frames, jobs)
    return _told_repeats(answers)


def _told_repeats(answers: Iterable[tuple[SourceFrame, _Answer]]) -> Generator[Result]:
    repeated = RepeatedFrames()
    for frame, (measurement, mark, problem) in answers:
        if mark is not None and repeated.repeats(mark):
            measurement = measurement.flagged(Flag.FROZEN)
        yield Result(frame, measurement, problem)


def _measure(detector: SurfaceDetector, frame: SourceFrame) -> _Answer:
    try:
        image = frame.image()
        measurement = detector.measure(frame.stamp_ns, image)
    except SloshCameraError as error:
        told = str(error) if frame.name in str(error) else f"{frame.name}: {error}"
        return _Answer(bad_image(frame.stamp_ns), None, told)
    return _Answer(measurement, digest(image), "")


def _in_processes(
    detection: Detection, frames: Iterable[SourceFrame], jobs: int
) -> Iterator[tuple[SourceFrame, _Answer]]:
    # A fork would copy OpenCV's threads in whatever state they are.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, context, _begin, (detection,))
    waiting: deque[tuple[SourceFrame, Future[_Answer]]] = deque()
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
            "a process that measures has ended by itself, perhaps for want of memory; try --jobs 1"
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Processes started meanwhile never see Ctrl-C, which is this process's to handle."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_detector: SurfaceDetector | None = None


def _begin(detection: Detection) -> None:
    """Prepares a process: its detector, one thread, and an end with that of its parent."""
    global _detector
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _detector = detection.detector()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _work(frame: SourceFrame) -> _Answer:
    if _detector is None:
        raise SloshBringupError("a process has no detector")
    return _measure(_detector, frame)
