"""Images of a folder, a video or a bag, one after another with their stamps."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import cv2

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.run_data import stamp_ns
from slosh_camera.errors import SloshCameraError
from slosh_camera.image import GrayImage, decode_compressed, to_gray, to_image

IMAGE_ENDINGS = (".png", ".jpg", ".jpeg")
IMAGE_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
FOLDER_RATE = 60.0
"""Images of a folder carry no time: they count as taken at this rate [Hz], in order of name."""


class SourceFrame(NamedTuple):
    """An image: stamp [ns], a name for people, and grey pixels or why there are none."""

    stamp_ns: int
    name: str
    gray: GrayImage | None
    problem: str = ""


def open_source(path: Path) -> Iterator[SourceFrame]:
    """The images of a source.

    Raises:
        SloshBringupError: there is nothing there that holds images.
        SloshBagError: a damaged bag.
    """
    if not path.exists():
        raise SloshBringupError(f"{path}: no such file or folder")
    if path.suffix == ".mcap" or (path.is_dir() and any(path.glob("*.mcap"))):
        return bag_frames(path)
    if path.is_dir():
        return _folder_frames(path)
    return _video_frames(path)


def _folder_frames(path: Path) -> Iterator[SourceFrame]:
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in IMAGE_ENDINGS)
    if not files:
        raise SloshBringupError(f"{path}: no images ({', '.join(IMAGE_ENDINGS)}) in this folder")
    return (_file_frame(index, file) for index, file in enumerate(files))


def _file_frame(index: int, file: Path) -> SourceFrame:
    stamp = round(index * 1e9 / FOLDER_RATE)
    try:
        gray = to_gray(decode_compressed(file.suffix[1:], file.read_bytes()))
    except (SloshCameraError, OSError) as error:
        return SourceFrame(stamp, file.name, None, f"{file}: {error}")
    return SourceFrame(stamp, file.name, gray)


def _video_frames(path: Path) -> Iterator[SourceFrame]:
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise SloshBringupError(f"{path}: neither a video that OpenCV reads, a folder nor a bag")
    return _captured(capture)


def _captured(capture: cv2.VideoCapture) -> Iterator[SourceFrame]:
    index = 0
    while True:
        stamp = round(capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6)
        more, image = capture.read()
        if not more:
            capture.release()
            return
        yield SourceFrame(stamp, f"frame {index}", cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
        index += 1


def bag_frames(path: Path, stamps: Collection[int] | None = None) -> Iterator[SourceFrame]:
    """The images of a bag's first image topic.

    Args:
        path: the bag.
        stamps: only the images with these stamps [ns]; None: all.

    Raises:
        SloshBagError: a damaged bag, or one without images.
    """
    reader = BagReader(path)
    topics = [topic for topic, info in reader.topics().items() if info.message_type in IMAGE_TYPES]
    if not topics:
        raise SloshBagError(f"{path}: holds no images")
    for record in reader.messages(topics[:1]):
        message = reader.decode(record)
        stamp = stamp_ns(message)
        if stamps is None or stamp in stamps:
            yield _decoded(stamp, message, record.message_type)


def _decoded(stamp: int, message: Any, message_type: str) -> SourceFrame:
    """A recorded image message's pixels."""
    name = f"{stamp} ns"
    try:
        if message_type == IMAGE_TYPES[0]:
            gray = to_gray(
                to_image(
                    message.encoding, message.height, message.width, message.step, message.data
                )
            )
        else:
            gray = to_gray(decode_compressed(message.format, message.data))
    except SloshCameraError as error:
        return SourceFrame(stamp, name, None, str(error))
    return SourceFrame(stamp, name, gray)
