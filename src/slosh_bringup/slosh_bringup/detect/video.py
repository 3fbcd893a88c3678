"""Reads the images of a video, and finds out whether its end is missing.

The number of images that a container announces is not what it shows: a clip trimmed on the
telephone keeps the images before its first one (edit list), and a camera that lost images writes
empty chunks. What counts is whether the stamps reach the end, or an AVI its own.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

import cv2
import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.detect.frame import FOLDER_RATE, FrameSource, SourceFrame
from slosh_bringup.errors import SloshBringupError
from slosh_camera.images.headers import too_large

_MOST_BOXES = 10_000
_MOST_EDITS = 1_000
_SLACK = 1.5
"""By so many images the last stamp may be before the end."""


class _Announced(NamedTuple):
    """What a video's container says of it.

    Attributes:
        images: number of them.
        duration: that is shown [s].
        whole: whether the file has the length that it tells; else that is not known.
    """

    images: int
    duration: float
    whole: bool


def video_source(path: Path, asked: float | None) -> FrameSource:
    """Opens a video as a source of images.

    Args:
        path: the file.
        asked: images per second [Hz]; None: as the video says.

    Raises:
        SloshBringupError: no video, or one whose images are too large.
    """
    if not path.stat().st_size:
        raise SloshBringupError(f"{path}: empty file")
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise SloshBringupError(
            f"{path}: neither a video that OpenCV reads (is it complete?), an image, a folder "
            "nor an MCAP bag"
        )
    sides = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
    told = too_large(*(round(capture.get(side)) for side in sides))
    if told:
        raise SloshBringupError(f"{path}: {told}")
    images = max(round(capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0)
    own = _rate(capture.get(cv2.CAP_PROP_FPS))
    source = FrameSource(str(path), iter(()), images or None, _rate(asked or own), [path])
    announced = _Announced(images, edited_duration(path) or images / own, _is_whole_avi(path))
    source.frames = _captured(capture, source, announced, timed=asked is None)
    return source


def _rate(rate: float) -> float:
    return rate if 0.0 < rate < 1e5 else FOLDER_RATE


def _captured(
    capture: cv2.VideoCapture, source: FrameSource, announced: _Announced, *, timed: bool
) -> Iterator[SourceFrame]:
    """Yields the images of a video; skips the last image of a truncated file.

    Args:
        capture: the video.
        source: where problems are noted.
        announced: by the container.
        timed: whether the file's own stamps count; a slow-motion video plays slower than it was
            taken.
    """
    waiting: SourceFrame | None = None
    period = SECOND / (source.rate or FOLDER_RATE)
    stamp, index, first, last = -period, 0, math.nan, math.nan
    while True:
        more, image = capture.read()
        if not more:
            break
        if waiting is not None:
            yield waiting
        # The stamp is that of the image just read; some files have none.
        last = capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6
        first = last if index == 0 else first
        stamp = last if timed and last > stamp else stamp + period
        waiting = SourceFrame(round(stamp), f"frame {index}", np.asarray(image, np.uint8))
        index += 1
    capture.release()
    if _is_cut(announced, index, (last - first) / SECOND):
        source.warnings.append(
            f"{source.name}: should have {announced.images} images but ends after "
            f"{max(index - 1, 0)}: is it cut off?"
        )
    elif waiting is not None:
        yield waiting


def _is_cut(announced: _Announced, count: int, shown: float) -> bool:
    """Whether a video ends before its container says: by its number of images and its stamps.

    Args:
        announced: by the container.
        count: number of images read.
        shown: time from the first of them to the last [s].
    """
    images, duration, whole = announced
    if whole or count >= images - 1:
        return False
    return not shown >= duration * (1.0 - (1.0 + _SLACK) / images)


def _is_whole_avi(path: Path) -> bool:
    """Whether a file is an AVI whose parts end where it ends, so that nothing is cut off."""
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        while at < size:
            file.seek(at)
            head = file.read(12)
            if len(head) < 12 or not head.startswith(b"RIFF") or not head[8:].startswith(b"AVI"):
                return False
            (length,) = struct.unpack("<I", head[4:8])
            at += 8 + length + length % 2
    return at in (size, size + 1)  # the last part may lack its filling


def edited_duration(path: Path) -> float | None:
    """Returns how long an MP4 or QuickTime file shows of its first edited track [s].

    Returns:
        The duration; None where the file has no edit list.
    """
    try:
        with path.open("rb") as file:
            return _edits(file, path.stat().st_size)
    except (OSError, struct.error):
        return None


def _edits(file: BinaryIO, size: int) -> float | None:
    inside = {kind: (at, end) for kind, at, end in _boxes(file, 0, size)}
    if b"moov" not in inside or b"ftyp" not in inside:
        return None
    per_second, found = 0, None
    for kind, at, end in _boxes(file, *inside[b"moov"]):
        if kind == b"mvhd":
            file.seek(at)
            version = file.read(1)
            file.seek(at + (20 if version == b"\x01" else 12))
            (per_second,) = struct.unpack(">I", file.read(4))
        elif kind == b"trak" and found is None:
            found = _track_edits(file, at, end)
    return found / per_second if found and per_second else None


def _track_edits(file: BinaryIO, at: int, end: int) -> int | None:
    """Returns the sum of a video track's edits in the movie's units; None: it has none."""
    parts = {kind: (start, stop) for kind, start, stop in _boxes(file, at, end)}
    if b"mdia" not in parts or b"edts" not in parts:
        return None
    handlers = [start for kind, start, _ in _boxes(file, *parts[b"mdia"]) if kind == b"hdlr"]
    file.seek(handlers[0] + 8 if handlers else end)
    if file.read(4) != b"vide":
        return None
    for kind, start, _ in _boxes(file, *parts[b"edts"]):
        if kind == b"elst":
            return _shown_edits(file, start)
    return None


def _shown_edits(file: BinaryIO, at: int) -> int:
    file.seek(at)
    version, count = struct.unpack(">B3xI", file.read(8))
    form = struct.Struct(">QqI" if version == 1 else ">IiI")
    shown = 0
    for _ in range(min(count, _MOST_EDITS)):
        duration, start, _ = form.unpack(file.read(form.size))
        shown += duration if start >= 0 else 0  # below: nothing is shown for so long
    return shown


def _boxes(file: BinaryIO, at: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Yields kind, start and end of the content of each box of an MP4 file between two places."""
    for _ in range(_MOST_BOXES):
        if at + 8 > end:
            return
        file.seek(at)
        size, kind = struct.unpack(">I4s", file.read(8))
        start = at + 8
        if size == 1:
            (size,) = struct.unpack(">Q", file.read(8))
            start += 8
        stop = at + size if size else end
        if stop < start:
            return
        yield kind, start, min(stop, end)
        at = stop
