"""Camera image for the operator's page: a small JPEG and the measured line."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_base.files.nanoseconds import SECOND
from slosh_camera.calibrate.camera_file import parse_any_calibration
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.calibration import AnyCalibration, Calibration

WIDTH, QUALITY = 640, 70
"""Largest width [px], and the JPEG's quality."""
MOST_POINTS = 60
SMALL = 200_000
"""A JPEG of so many bytes is passed on as it is: decoding it costs more than all else here."""
AT_ONCE = 50_000_000
"""A surface so near to an image is drawn into it [ns]: three of them at 60 fps."""


class Camera:
    """Converts camera images to small JPEG pictures with the measured line."""

    def __init__(self) -> None:
        self._calibration: AnyCalibration | None = None

    def take_calibration(self, text: str, folder: Path) -> None:
        """Sets the calibration from the camera node's camera.yaml; invalid text removes it."""
        try:
            self._calibration = parse_any_calibration(text, "the camera's calibration", folder)
        except SloshCameraError:
            self._calibration = None

    def picture(self, image: NDArray[np.uint8] | bytes, stamp_ns: int, surface: Any) -> bytes:
        """Converts an image to a small picture with the measured line; see `pack` for the format.

        Args:
            image: (height, width) grey or (height, width, 3) blue-green-red, or a JPEG as it is.
            stamp_ns: its stamp [ns].
            surface: the FreeSurface next to it in time; None: there is none.
        """
        jpeg, scale = (image, 1.0) if isinstance(image, bytes) else small_jpeg(image)
        line: list[list[float]] = []
        if surface is not None and self._calibration is not None:
            stamp = surface.header.stamp
            measured_ns = int(stamp.sec) * SECOND + int(stamp.nanosec)
            if abs(measured_ns - stamp_ns) < AT_ONCE:
                places, heights = surface.profile_azimuth, surface.profile_height
                line = line_in_image(self._calibration, places, heights)
        return pack(jpeg, {"line": [[scale * u, scale * v] for u, v in line]})


def is_small_jpeg(data: bytes) -> bool:
    """Whether an image is a JPEG small enough to be sent unchanged."""
    return len(data) <= SMALL and data.startswith(b"\xff\xd8\xff")


def pack(jpeg: bytes, heading: dict[str, Any]) -> bytes:
    """Packs header and JPEG into bytes: length of the header, header as JSON, image."""
    text = json.dumps(heading, allow_nan=False, separators=(",", ":")).encode()
    return struct.pack("<I", len(text)) + text + jpeg


def small_jpeg(image: NDArray[np.uint8]) -> tuple[bytes, float]:
    """Encodes an image as a JPEG that is at most WIDTH pixels wide.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red.

    Returns:
        the JPEG, and by how much it was scaled.
    """
    scale = min(WIDTH / image.shape[1], 1.0)
    if scale < 1.0:
        size = (WIDTH, max(round(scale * image.shape[0]), 1))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    done, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return (coded.tobytes() if done else b""), scale


def line_in_image(
    calibration: AnyCalibration, azimuth: Sequence[float], height: Sequence[float]
) -> list[list[float]]:
    """Projects a measured surface line into the image [px].

    Args:
        calibration: of the camera that measured it.
        azimuth: (N,) on a round wall [rad]; of a side view none.
        height: (N,) above the still level [m].

    Returns:
        (M, 2) pixels, M <= MOST_POINTS; places that the camera does not see are left out.
    """
    levels = np.asarray(height, dtype=np.float64)
    if levels.size == 0:
        return []
    kept = slice(None, None, max(levels.size // MOST_POINTS, 1))
    if isinstance(calibration, Calibration):
        places = np.asarray(azimuth, dtype=np.float64)
        if places.size != levels.size:
            return []
        pixels = calibration.view.project_wall(places[kept], levels[kept])
    else:
        across = np.linspace(-0.5, 0.5, levels.size) * calibration.view.box.width
        pixels = calibration.view.project_face(across[kept], levels[kept])
    seen = pixels[np.isfinite(pixels).all(axis=1)]
    return [[round(float(u), 1), round(float(v), 1)] for u, v in seen]
