"""Pictures of what the detector found, for reports."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibration import Calibration
from slosh_camera.geometry import CupView
from slosh_camera.measurement import Flag, Measurement

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

# Colours are blue, green, red.
_LINE = (60, 200, 60)
_PEAK = (40, 40, 240)
_SCALE = (230, 140, 40)
_TEXT = (255, 255, 255)
_PLATE = (50, 50, 50)
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_FONT_SCALE = 0.45
# Drawing coordinates carry this many fractional bits.
_SHIFT = 4
_TICK = 0.010
_MARGIN = 8


def draw_measurement(image: Image, calibration: Calibration, measurement: Measurement) -> Image:
    """Draw the detected line, the peak, a scale in millimetres and the numbers.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red; not changed.
        calibration: the calibration with which it was measured.
        measurement: what was measured in it.

    Returns:
        (height, width, 3) blue-green-red picture.
    """
    if image.ndim == 2:
        picture = np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    else:
        picture = image.copy()
    _draw_scale(picture, calibration.view)
    for pixel in measurement.edge_pixels:
        cv2.circle(picture, _fixed(pixel), 1 << _SHIFT, _LINE, -1, cv2.LINE_AA, _SHIFT)
    if np.all(np.isfinite(measurement.peak_pixel)):
        centre = _fixed(np.asarray(measurement.peak_pixel))
        cv2.circle(picture, centre, 7 << _SHIFT, _PEAK, 2, cv2.LINE_AA, _SHIFT)
    for index, line in enumerate(_captions(measurement)):
        _put_text(picture, line, (_MARGIN, 18 + 18 * index))
    return picture


def _captions(measurement: Measurement) -> list[str]:
    lines = []
    if np.isfinite(measurement.msh):
        bound = ">= " if Flag.SATURATED in measurement.flags else ""
        side = measurement.peak_side.name.lower()
        lines.append(
            f"MSH {bound}{measurement.msh * 1e3:.1f} mm +- {measurement.msh_stddev * 1e3:.1f}, "
            f"{np.degrees(measurement.azimuth):.0f} deg, {side} wall"
        )
        lines.append(
            f"left {_millimetres(measurement.sh_left)}, right {_millimetres(measurement.sh_right)}"
        )
    if measurement.flags:
        lines.append(" ".join(str(flag.name) for flag in measurement.flags))
    return lines


def _millimetres(height: float) -> str:
    return f"{height * 1e3:.1f} mm" if np.isfinite(height) else "unknown"


def _draw_scale(picture: Image, view: CupView) -> None:
    """Height scale along the right edge of the container, every 10 mm, still level marked."""
    azimuth = view.tangent_azimuths()[1]
    top = view.cup.rim_level or view.cup.radius
    first = int(np.ceil(-view.cup.fill_height / _TICK))
    heights = _TICK * np.arange(first, int(np.floor(top / _TICK)) + 1)
    pixels = view.project_wall(azimuth, heights) + np.array([_MARGIN, 0.0])
    if not np.all(np.isfinite(pixels)):
        return
    cv2.line(picture, _fixed(pixels[0]), _fixed(pixels[-1]), _SCALE, 1, cv2.LINE_AA, _SHIFT)
    for height, pixel in zip(heights, pixels, strict=True):
        at_rest = abs(height) < 0.5 * _TICK
        end = pixel + np.array([10.0 if at_rest else 5.0, 0.0])
        cv2.line(picture, _fixed(pixel), _fixed(end), _SCALE, 1, cv2.LINE_AA, _SHIFT)
        if round(height / _TICK) % 2 == 0:
            label = f"{height * 1e3:.0f}" + (" mm" if at_rest else "")
            _put_text(picture, label, (round(end[0]) + 3, round(end[1]) + 4))


def _put_text(picture: Image, text: str, place: tuple[int, int]) -> None:
    """White text on a dark plate, so that it is read before any background."""
    (width, height), below = cv2.getTextSize(text, _FONT, _FONT_SCALE, 1)
    x, y = place
    cv2.rectangle(picture, (x - 2, y - height - 2), (x + width + 2, y + below), _PLATE, -1)
    cv2.putText(picture, text, place, _FONT, _FONT_SCALE, _TEXT, 1, cv2.LINE_AA)


def _fixed(pixel: FloatArray) -> tuple[int, int]:
    scale = 1 << _SHIFT
    return round(float(pixel[0]) * scale), round(float(pixel[1]) * scale)
