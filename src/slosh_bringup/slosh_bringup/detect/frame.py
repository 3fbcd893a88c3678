"""Undecoded images of a folder, a video or a bag, each small enough to send to a process."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image
from slosh_camera.images.decoding import decode_compressed, read_image, read_page, to_image


@dataclass(frozen=True, slots=True, eq=False)
class RawMessage:
    """The fields of a sensor_msgs/Image."""

    encoding: str
    height: int
    width: int
    step: int
    data: Any
    big_endian: bool


@dataclass(frozen=True, slots=True, eq=False)
class CompressedMessage:
    """The fields of a sensor_msgs/CompressedImage."""

    format: str
    data: Any


@dataclass(frozen=True, slots=True)
class NoImage:
    """The reason why a source frame contains no image."""

    reason: str


class TiffPage(NamedTuple):
    """One picture of a TIFF file that holds several; its number counts from 0."""

    path: Path
    number: int


@dataclass(frozen=True, slots=True, eq=False)
class SourceFrame:
    """An undecoded image and its stamp, from a folder, a video or a bag.

    Attributes:
        stamp_ns: when it was taken [ns].
        name: what people call it: a file's name, a frame's number.
        content: where its pixels are: a file, a page, a message, the pixels themselves, or none.
    """

    stamp_ns: int
    name: str
    content: Path | TiffPage | RawMessage | CompressedMessage | NoImage | Image

    def image(self) -> Image:
        """Decodes the pixels to (height, width) grey or (height, width, 3) BGR values.

        Raises:
            SloshCameraError: they cannot be read; the text names the image.
        """
        content = self.content
        if isinstance(content, Path):
            return read_image(content)
        if isinstance(content, TiffPage):
            return read_page(*content)
        try:
            if isinstance(content, RawMessage):
                return to_image(
                    content.encoding,
                    content.height,
                    content.width,
                    content.step,
                    content.data,
                    big_endian=content.big_endian,
                )
            if isinstance(content, CompressedMessage):
                return decode_compressed(content.format, content.data)
            if isinstance(content, NoImage):
                raise SloshCameraError(content.reason)
        except SloshCameraError as error:
            raise SloshCameraError(f"{self.name}: {error}") from None
        return content


FOLDER_RATE = 60.0
"""Images without a time count as taken at this rate [Hz], in natural order."""


@dataclass(slots=True)
class FrameSource:
    """An ordered source of images to measure: a folder, a video or a bag.

    Attributes:
        name: what people call the source.
        frames: the images, decoded by who needs them.
        total: how many there are; None: not known.
        rate: images per second [Hz]; None: as their stamps say.
        files: that hold them, and images of the same folder that were left out.
        note: what was left out, in words; empty: nothing.
        warnings: what went wrong on the way, complete when the frames are at their end.
    """

    name: str
    frames: Iterator[SourceFrame]
    total: int | None = None
    rate: float | None = None
    files: Sequence[Path] = ()
    note: str = ""
    warnings: list[str] = field(default_factory=list)
