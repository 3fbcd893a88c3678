"""Measures how often damaged or unsuitable images give a wrong height without a flag.

    tools/run python validation/studies/camera_damage.py [--data DIR] [--half 1]

Frames of even number are the half to develop with (0), those of odd number the half to judge by
(1). Random numbers come from the name of the damage and the frame: each run does the same.
"""

from __future__ import annotations

import argparse
import zlib
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import with_tools  # noqa: F401
from camera_sequences import RenderedSequence, read_sequence, sequences_in, shared_sequences
from numpy.typing import NDArray

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.decoding import decode_compressed
from slosh_camera.measurement import Measurement

Image = NDArray[np.uint8]
Random = np.random.Generator

WRONG = 1e-3
"""A height that is further from that of the undamaged picture is wrong [m]."""
_END = b"\xff\xd9"
_FIRST = 0.03  # part of a file up to which its header reaches
# How cameras write their images.
_WRITTEN: tuple[dict[int, int], ...] = (
    {},
    {cv2.IMWRITE_JPEG_QUALITY: 50},
    {cv2.IMWRITE_JPEG_QUALITY: 95, cv2.IMWRITE_JPEG_OPTIMIZE: 1},
    {cv2.IMWRITE_JPEG_QUALITY: 80, cv2.IMWRITE_JPEG_RST_INTERVAL: 40},
)


def _cut(data: bytes, other: bytes, random: Random) -> bytes:
    return data[: _place(data, random)]


def _cut_and_closed(data: bytes, other: bytes, random: Random) -> bytes:
    return data[: _place(data, random)] + _END


def _cut_and_filled(data: bytes, other: bytes, random: Random) -> bytes:
    return data[: _place(data, random)].ljust(len(data), b"\0") + _END


def _without_a_part(data: bytes, other: bytes, random: Random) -> bytes:
    first, last = _part(data, random)
    return data[:first] + data[last:]


def _zeros(data: bytes, other: bytes, random: Random) -> bytes:
    first, last = _part(data, random)
    return data[:first] + bytes(last - first) + data[last:]


def _twice(data: bytes, other: bytes, random: Random) -> bytes:
    first, last = _part(data, random)
    return data[:last] + data[first:]


def _torn(data: bytes, other: bytes, random: Random) -> bytes:
    place = _place(data, random)
    return data[:place] + other[place:]


def _flipped_bit(data: bytes, other: bytes, random: Random) -> bytes:
    return _changed(data, _place(data, random), 1 << int(random.integers(8)))


def _flipped_byte(data: bytes, other: bytes, random: Random) -> bytes:
    return _changed(data, _place(data, random), int(random.integers(1, 256)))


def _header_byte(data: bytes, other: bytes, random: Random) -> bytes:
    return _changed(data, int(random.integers(2, 623)), int(random.integers(1, 256)))


def _changed(data: bytes, place: int, by: int) -> bytes:
    return data[:place] + bytes([data[place] ^ by]) + data[place + 1 :]


def _place(data: bytes, random: Random) -> int:
    return int(random.integers(int(_FIRST * len(data)), len(data) - 2))


def _part(data: bytes, random: Random) -> tuple[int, int]:
    first = _place(data, random)
    return first, min(first + int(2 ** random.uniform(3, 12)), len(data) - 2)


DAMAGES: dict[str, Callable[[bytes, bytes, Random], bytes]] = {
    "cut": _cut,
    "cut, with an end": _cut_and_closed,
    "cut, filled with zeros": _cut_and_filled,
    "a part is missing": _without_a_part,
    "a part is zeros": _zeros,
    "a part comes twice": _twice,
    "two images in one": _torn,
    "one bit is wrong": _flipped_bit,
    "one byte is wrong": _flipped_byte,
    "one byte of the header is wrong": _header_byte,
}


def _shifted(across: int, down: int) -> Callable[[Image], Image]:
    matrix = np.array([[1.0, 0.0, across], [0.0, 1.0, down]])
    return lambda image: _warped(image, matrix)


def _turned(degrees: float, scale: float = 1.0) -> Callable[[Image], Image]:
    def turned(image: Image) -> Image:
        middle = (0.5 * (image.shape[1] - 1), 0.5 * (image.shape[0] - 1))
        matrix = cv2.getRotationMatrix2D(middle, degrees, scale)
        return _warped(image, np.asarray(matrix, np.float64))

    return turned


def _warped(image: Image, matrix: NDArray[np.float64]) -> Image:
    size = image.shape[1::-1]
    warped = cv2.warpAffine(image, matrix, size, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, dtype=np.uint8)


MISFITS: dict[str, Callable[[Image], Image]] = {
    "as it is": lambda image: image,
    "upside down": lambda image: np.ascontiguousarray(image[::-1, ::-1]),
    "mirrored top to bottom": lambda image: np.ascontiguousarray(image[::-1]),
    "mirrored left to right": lambda image: np.ascontiguousarray(image[:, ::-1]),
    "on its side": _turned(90.0),
    "turned by 10 degrees": _turned(10.0),
    "100 px to the right": _shifted(100, 0),
    "40 px to the left": _shifted(-40, 0),
    "20 px to the right": _shifted(20, 0),
    "40 px down": _shifted(0, 40),
    "40 px up": _shifted(0, -40),
    "20 px down": _shifted(0, 20),
    "12 px down": _shifted(0, 12),
    "8 px down": _shifted(0, 8),
    "5 px down": _shifted(0, 5),
    "3 px down": _shifted(0, 3),
    "8 px to the left": _shifted(-8, 0),
    "half as large": _turned(0.0, 0.5),
    "20 % larger": _turned(0.0, 1.2),
    "20 % smaller": _turned(0.0, 1.0 / 1.2),
}


class Outcome(NamedTuple):
    """Result for one damaged image: refused, flagged, or wrong without a flag.

    Attributes:
        refused: it was taken for no image.
        flagged: it was measured, with a flag or without a height.
        wrong: it was measured without a flag, and wrongly.
        error: of a height without a flag [m].
    """

    refused: bool
    flagged: bool
    wrong: bool
    error: float


def outcome(measured: Measurement | None, *heights: float) -> Outcome:
    """Judges a measurement of an image that shows one of several heights [m]."""
    if measured is None or measured.flags or not np.isfinite(measured.msh):
        return Outcome(measured is None, measured is not None, False, 0.0)
    error = min(abs(measured.msh - height) for height in heights)
    return Outcome(False, False, bool(error > WRONG), error)


def damaged_files(
    sequence: RenderedSequence, half: int, each: int
) -> Iterator[tuple[str, Outcome]]:
    """Yields the results for damaged files of a sequence, with the name of the damage."""
    detector = _detector(sequence)
    frames = [frame for frame in sequence.frames if frame.index % 2 == half]
    for number, frame in enumerate(frames):
        options = [value for pair in _WRITTEN[number % len(_WRITTEN)].items() for value in pair]
        data, other = (
            cv2.imencode(".jpg", np.asarray(cv2.imread(str(path)), np.uint8), options)[1].tobytes()
            for path in (frame.path, frames[number - 5].path)
        )
        # An image that is torn above the container is the other one.
        heights = []
        for file in (data, other):
            whole = detector.measure(0, decode_compressed("jpeg", file))
            heights += [] if whole.flags else [whole.msh]
        if len(heights) < 2:
            continue
        for name, damage in DAMAGES.items():
            seed = zlib.crc32(f"{sequence.name} {name} {frame.index}".encode())
            random = np.random.default_rng(seed)
            for _ in range(each):
                broken = damage(data, other, random)
                if broken != data:
                    yield name, outcome(_measured(detector, broken), *heights)


def misfits(sequence: RenderedSequence, half: int) -> Iterator[tuple[str, Outcome]]:
    """Yields the results for images that do not fit the calibration, with the change's name."""
    detector = _detector(sequence)
    for frame in sequence.frames:
        if frame.index % 2 == half:
            image = np.asarray(cv2.imread(str(frame.path)), dtype=np.uint8)
            for name, change in MISFITS.items():
                yield name, outcome(detector.measure(0, change(image)), frame.msh)


def _detector(sequence: RenderedSequence) -> FreeSurfaceDetector:
    detector = FreeSurfaceDetector(sequence.calibration)
    if sequence.still is not None:
        detector.learn_still(np.asarray(cv2.imread(str(sequence.still)), dtype=np.uint8))
    return detector


def _measured(detector: FreeSurfaceDetector, data: bytes) -> Measurement | None:
    try:
        return detector.measure(0, decode_compressed("jpeg", data))
    except SloshCameraError:
        return None


def _table(outcomes: dict[str, list[Outcome]]) -> Iterator[str]:
    yield "| | pictures | refused | flagged | right | wrong in silence | largest error [mm] |"
    yield "|---|---|---|---|---|---|---|"
    for name, all_of in outcomes.items():
        refused, flagged, wrong = (sum(one[n] for one in all_of) for n in range(3))
        right = len(all_of) - refused - flagged - wrong
        largest = 1e3 * max(one.error for one in all_of)
        counts = f"{len(all_of)} | {refused} | {flagged} | {right} | {wrong}"
        yield f"| {name} | {counts} | {largest:.1f} |"


def main() -> None:
    """Prints the tables for damaged files and for unsuitable images."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="folder of rendered sequences")
    parser.add_argument(
        "--half", type=int, default=1, choices=(0, 1), help="even (0) or odd (1) frames"
    )
    parser.add_argument(
        "--each", type=int, default=10, help="number of damages of a kind per frame"
    )
    arguments = parser.parse_args()
    folders = sequences_in(arguments.data) if arguments.data else shared_sequences()
    sequences = [read_sequence(folder) for folder in folders]
    half, each = arguments.half, arguments.each
    for title, cases in (
        ("Damaged files", [damaged_files(one, half, each) for one in sequences]),
        ("Pictures that do not fit", [misfits(one, half) for one in sequences]),
    ):
        outcomes: dict[str, list[Outcome]] = {}
        for name, what in chain.from_iterable(cases):
            outcomes.setdefault(name, []).append(what)
        print(f"\n## {title}\n", *_table(outcomes), sep="\n")


if __name__ == "__main__":
    main()
