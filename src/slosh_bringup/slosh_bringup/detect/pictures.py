"""Pictures of measured images: an annotated video, or a sheet of selected images."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_base.files import NewFile, write_bytes
from slosh_bringup.detect.frame import SourceFrame
from slosh_bringup.detect.measuring import Result
from slosh_bringup.detect.table import flag_names
from slosh_bringup.errors import SloshBringupError
from slosh_camera.detection.drawing import captions, draw_detail, draw_measurement
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import put_text
from slosh_camera.measurement import Measurement
from slosh_camera.optics.calibration import AnyCalibration

Image = NDArray[np.uint8]

STRIP_LENGTH = 12
WORST_LENGTH = 12
DOUBTFUL_SIGMA = 0.3e-3
"""A standard deviation that is worth a look [m]."""
DOUBTFUL_DISAGREEMENT = 3.0
"""Standard deviations between the highest point seen and the fit that are worth a look."""
_VIDEO_CODECS = {".avi": "MJPG", ".mkv": "mp4v"}
_USUAL_CODEC = "mp4v"
_TILE = (480, 400)
_LINES, _LINE, _RIM = 6, 20, 6
_LETTERS = 0.9
_LONGEST = 62
_SHEET_WIDTH = 4
_LEARNT = 8
_UNKNOWN_RATE = 30.0


class ImageDoubt(NamedTuple):
    """Rank and reason of a doubtful measurement; a higher rank is more doubtful."""

    rank: tuple[int, int, float]
    reason: str


class PictureSink(Protocol):
    """Interface of a picture output that takes results one by one and then writes a file."""

    def add(self, result: Result) -> None:
        """Adds the next measured image to the picture."""

    def finish(self) -> str:
        """Writes the remaining data and returns a sentence that describes the picture."""

    def discard(self) -> None:
        """Deletes an unfinished picture file, if there is one."""
        return


def judge(measurement: Measurement) -> ImageDoubt:
    """Ranks how doubtful a measurement is: missing, then flagged, then uncertain."""
    names = flag_names(measurement.flags)
    sigma = measurement.msh_stddev
    apart = disagreement(measurement)
    doubts = [
        (sigma / DOUBTFUL_SIGMA, f"sigma {1e3 * sigma:.2f} mm"),
        (
            apart / DOUBTFUL_DISAGREEMENT,
            f"measured and fitted heights differ by {apart:.1f} sigma",
        ),
    ]
    size, words = max((doubt for doubt in doubts if math.isfinite(doubt[0])), default=(0.0, ""))
    lost = not math.isfinite(measurement.msh)
    reason = " ".join(names) or words or "nothing measured"
    return ImageDoubt((int(lost), len(names), size), reason)


def disagreement(measurement: Measurement) -> float:
    """Returns |measured - fitted| peak height in standard deviations; NaN if unknown."""
    spread = math.hypot(measurement.msh_stddev, measurement.fitted_msh_stddev)
    apart = abs(measurement.msh - measurement.fitted_msh)
    return apart / spread if spread > 0.0 else math.nan


class PictureSheet:
    """A picture file that shows single images in rows and columns.

    Args:
        path: the file, .png or .jpg.
        calibration: with which the images were measured.
    """

    def __init__(self, path: Path, calibration: AnyCalibration) -> None:
        check_picture(path)
        self._path, self._calibration = path, calibration

    def write(self, results: Sequence[tuple[Result, str]]) -> str:
        """Writes a sheet of images with captions; returns a sentence that describes it."""
        if not results:
            return f"no images for {self._path}"
        tiles = [self._tile(result, remark) for result, remark in results]
        columns = min(_SHEET_WIDTH, len(tiles))
        blank = np.zeros_like(tiles[0])
        tiles += [blank] * (-len(tiles) % columns)
        rows = [np.hstack(tiles[k : k + columns]) for k in range(0, len(tiles), columns)]
        _write(self._path, np.vstack(rows))
        return f"{len(results)} images in {self._path}"

    def _tile(self, result: Result, remark: str) -> Image:
        found = captions(result.measurement)
        if remark and result.measurement.flags:
            found = found[:-1]  # the remark tells the flags
        lines = [result.frame.name, *found, remark or result.problem]
        width, height = _TILE
        text = np.zeros((_LINES * _LINE + _RIM, width, 3), np.uint8)
        for k, words in enumerate(line for line in lines if line):
            put_text(text, shortened(words), (_RIM, (k + 1) * _LINE), _LETTERS)
        picture = _decoded(result)
        if picture is None:
            detail = _card(width, height, "no image")
        else:
            detail = draw_detail(picture, self._calibration, result.measurement, _TILE)
        tile = np.vstack((text, detail))
        cv2.rectangle(tile, (0, 0), (width - 1, tile.shape[0] - 1), (90, 90, 90), 1)
        return tile


class PictureStrip(PictureSink):
    """A sheet with a few images, evenly spaced over a source of unknown length.

    Args:
        path: the file, .png or .jpg.
        calibration: with which the images were measured.
        length: how many images.
    """

    def __init__(
        self, path: Path, calibration: AnyCalibration, length: int = STRIP_LENGTH
    ) -> None:
        self._sheet, self._length = PictureSheet(path, calibration), length
        self._kept: list[Result] = []
        self._step, self._count = 1, 0

    def add(self, result: Result) -> None:
        """Adds every n-th image to the sheet; doubles n whenever the sheet is full."""
        if self._count % self._step == 0:
            self._kept.append(result)
        self._count += 1
        if len(self._kept) >= 2 * self._length:
            self._kept, self._step = self._kept[::2], 2 * self._step

    def finish(self) -> str:
        """Writes the sheet and returns a sentence that describes it."""
        count = min(self._length, len(self._kept))
        places = np.linspace(0, len(self._kept) - 1, count).round().astype(int)
        return self._sheet.write([(self._kept[place], "") for place in places])


class Worst(PictureSink):
    """A sheet of the most doubtful images, worst first, each with the reason.

    Args:
        path: the file, .png or .jpg.
        calibration: with which the images were measured.
        length: how many images.
    """

    def __init__(
        self, path: Path, calibration: AnyCalibration, length: int = WORST_LENGTH
    ) -> None:
        self._sheet, self._length = PictureSheet(path, calibration), length
        self._heap: list[tuple[tuple[int, int, float], int, Result, str]] = []
        self._count = 0

    def add(self, result: Result) -> None:
        """Adds the next image; among equally doubtful images the earlier ones are kept."""
        rank, reason = judge(result.measurement)
        entry = (rank, -self._count, result, result.problem or reason)
        self._count += 1
        if len(self._heap) < self._length:
            heapq.heappush(self._heap, entry)
        else:
            heapq.heappushpop(self._heap, entry)

    def finish(self) -> str:
        """Writes the sheet and returns a sentence that describes it."""
        ordered = sorted(self._heap, reverse=True)
        return self._sheet.write(
            [(result, f"{place}. {why}") for place, (_, _, result, why) in enumerate(ordered, 1)]
        )


class AnnotatedVideo(PictureSink):
    """A video of all images with annotations; a sheet of images if no codec works.

    Args:
        path: the file, .mp4, .avi or .mkv.
        calibration: with which the images were measured.
        rate: images per second [Hz]; None: as the first stamps say.
    """

    def __init__(self, path: Path, calibration: AnyCalibration, rate: float | None) -> None:
        self._path, self._calibration, self._rate = path, calibration, rate
        self._file: NewFile | None = None
        camera = calibration.view.camera
        self._size = (camera.width, camera.height)
        self._early: list[Result] = []
        self._strip: PictureStrip | None = None
        self._writer: cv2.VideoWriter | None = None
        self._count = 0

    def add(self, result: Result) -> None:
        """Adds the next image to the video."""
        if self._writer is None and self._strip is None:
            self._early.append(result)
            if self._rate is None and len(self._early) < _LEARNT:
                return
            self._open()
        else:
            self._put(result)

    def finish(self) -> str:
        """Closes the video and returns a sentence that describes it."""
        if self._early:
            self._open()
        if self._strip is not None:
            return f"no video codec for {self._path}: {self._strip.finish()} instead"
        if self._writer is None:
            return f"no images for {self._path}"
        self._writer.release()
        if self._file is not None:
            if not _is_whole(self._file.part, self._count):
                raise SloshBringupError(f"{self._path}: cannot be written, is the disk full?")
            self._file.finish()
        return f"{self._count} images in {self._path}"

    def discard(self) -> None:
        """Deletes an unfinished video."""
        if self._writer is not None:
            self._writer.release()
        if self._file is not None:
            self._file.discard()

    def _open(self) -> None:
        """Opens the video file once the frame rate is known, and writes the buffered images."""
        rate = self._rate or _rate_of([result.frame for result in self._early])
        codec = _VIDEO_CODECS.get(self._path.suffix.lower(), _USUAL_CODEC)
        self._file = NewFile(self._path)
        name = str(self._file.part)
        writer = cv2.VideoWriter(name, cv2.VideoWriter.fourcc(*codec), rate, self._size)
        if writer.isOpened():
            self._writer = writer
        else:
            self._file.discard()
            self._strip = PictureStrip(self._path.with_suffix(".png"), self._calibration)
        early, self._early = self._early, []
        for result in early:
            self._put(result)

    def _put(self, result: Result) -> None:
        if self._strip is not None:
            self._strip.add(result)
        elif self._writer is not None:
            self._writer.write(self._picture(result))
            self._count += 1

    def _picture(self, result: Result) -> Image:
        image = _decoded(result)
        name = result.frame.name
        if image is None or image.shape[1::-1] != self._size:
            return _card(*self._size, f"{name}: {result.problem}")
        return draw_measurement(image, self._calibration, result.measurement, name)


def check_picture(path: Path) -> None:
    """Raises an error for a picture file type that OpenCV cannot write.

    Raises:
        SloshBringupError: another ending.
    """
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise SloshBringupError(f"{path}: a picture's name must end in .png or .jpg")


def shortened(words: str) -> str:
    """Shortens a caption to fit its image; keeps the beginning and the end."""
    if len(words) <= _LONGEST:
        return words
    return f"{words[: _LONGEST // 3]} ... {words[-2 * _LONGEST // 3 + 5 :]}"


def _decoded(result: Result) -> Image | None:
    try:
        return result.frame.image()
    except SloshCameraError:
        return None


def _card(width: int, height: int, words: str) -> Image:
    """Creates a dark placeholder for a missing image, with the reason as text."""
    card = np.full((height, width, 3), 25, np.uint8)
    put_text(card, shortened(words), (2 * _RIM, height // 2))
    return card


def _rate_of(frames: Sequence[SourceFrame]) -> float:
    gaps = np.diff([frame.stamp_ns for frame in frames])
    gaps = gaps[gaps > 0]
    return float(np.clip(1e9 / np.median(gaps), 1.0, 1000.0)) if len(gaps) else _UNKNOWN_RATE


def _write(path: Path, picture: Image) -> None:
    try:
        data = cv2.imencode(path.suffix, picture)[1]
    except cv2.error as error:
        raise SloshBringupError(f"{path}: cannot be written: {error.err}") from None
    write_bytes(path, data.tobytes())


def _is_whole(video: Path, count: int) -> bool:
    """Whether all images of a written video can be read, since OpenCV reports no write errors."""
    if not video.is_file():
        return True  # a pipe
    capture = cv2.VideoCapture(str(video))
    try:
        capture.set(cv2.CAP_PROP_POS_FRAMES, count - 1)
        if capture.read()[0]:
            return True
        # Not every codec finds the last image: then one after another.
        capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
        return all(capture.grab() for _ in range(count))
    finally:
        capture.release()
