"""An undecoded image from a folder, a video or a bag, small enough to send to a process."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image
from slosh_camera.images.decoding import decode_compressed, read_image, to_image


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


@dataclass(frozen=True, slots=True, eq=False)
class SourceFrame:
    """An undecoded image and its stamp, from a folder, a video or a bag.

    Attributes:
        stamp_ns: when it was taken [ns].
        name: what people call it: a file's name, a frame's number.
        content: where its pixels are: a file, a message, the pixels themselves, or none.
    """

    stamp_ns: int
    name: str
    content: Path | RawMessage | CompressedMessage | NoImage | Image

    def image(self) -> Image:
        """Decodes the pixels to (height, width) grey or (height, width, 3) BGR values.

        Raises:
            SloshCameraError: they cannot be read; the text names the image.
        """
        content = self.content
        if isinstance(content, Path):
            return read_image(content)
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
