"""A camera image on a report page."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_report.errors import SloshReportError

NAN = float("nan")
MEDIA_TYPES = ("image/png", "image/jpeg")


@dataclass(frozen=True, slots=True)
class Frame:
    """A camera image with annotations, and its caption.

    Attributes:
        image: the encoded image.
        caption: one line.
        media_type: one of MEDIA_TYPES.
        time: its moment on the report's time axis [s]; the charts mark it where it is known.

    Raises:
        SloshReportError: another media type.
    """

    image: bytes
    caption: str
    media_type: str = "image/jpeg"
    time: float = NAN

    def __post_init__(self) -> None:
        if self.media_type not in MEDIA_TYPES:
            raise SloshReportError(
                f"frame {self.caption!r}: media type {self.media_type!r} is not one of "
                f"{', '.join(MEDIA_TYPES)}"
            )
