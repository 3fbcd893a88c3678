"""Draws free-surface measurements into images, for visual inspection."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.images.colour import WHITE, letter_size, put_text, text_width, to_colour
from slosh_camera.measurement import Flag, Measurement, PeakSide
from slosh_camera.optics.box import BoxView
from slosh_camera.optics.calibration import AnyCalibration
from slosh_camera.optics.cup import CupView

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

# Colours are blue, green, red.
FRONT = (70, 220, 70)
REAR = (255, 170, 40)
FITTED = (60, 220, 255)
PEAK = (60, 60, 255)
_SCALE = (230, 140, 40)
_ALARM = (110, 170, 255)
# Drawing coordinates carry this many fractional bits.
_SHIFT = 4
_TICK = 0.010
_GAP = 8.0
_DASH = 4
_MARGIN = 0.15
_LEAST_DETAIL = 8.0


@dataclass(frozen=True, slots=True)
class _Canvas:
    """A drawing canvas that shows a magnified part of an image."""

    picture: Image
    size: float
    zoom: float = 1.0
    origin: tuple[float, float] = (0.0, 0.0)

    def place(self, pixels: FloatArray) -> FloatArray:
        """Converts image pixels (N, 2) to pixels of the magnified canvas."""
        placed: FloatArray = (pixels - np.array(self.origin) + 0.5) * self.zoom - 0.5
        return placed

    def line(self, pixels: FloatArray, colour: tuple[int, int, int], width: float = 1.0) -> None:
        """Draws a line through image pixels, with gaps at NaN."""
        for part in _whole_parts(self.place(pixels)):
            fixed = np.round(part * (1 << _SHIFT)).astype(np.int32)
            thickness = max(round(width * self.size), 1)
            cv2.polylines(self.picture, [fixed], False, colour, thickness, cv2.LINE_AA, _SHIFT)

    def dots(self, pixels: FloatArray, colour: tuple[int, int, int], radius: float) -> None:
        """Draws a dot at each of the given image pixels."""
        reach = round(radius * self.size * (1 << _SHIFT))
        for pixel in self.place(pixels):
            cv2.circle(self.picture, _fixed(pixel), reach, colour, -1, cv2.LINE_AA, _SHIFT)

    def ring(self, pixel: FloatArray, colour: tuple[int, int, int]) -> None:
        """Draws a ring around an image pixel, which leaves the pixel visible."""
        centre, width = _fixed(self.place(pixel)), max(round(1.5 * self.size), 1)
        reach = round(7.0 * self.size * (1 << _SHIFT))
        cv2.circle(self.picture, centre, reach, colour, width, cv2.LINE_AA, _SHIFT)

    def beside(self, pixel: FloatArray, words: str) -> None:
        """Writes text beside a ring around an image pixel."""
        x, y = self.place(pixel)
        width, away = text_width(words, self.size), 10.0 * self.size
        right = x + away + width < self.picture.shape[1]
        self.text(words, np.array([x + away if right else x - away - width, y + 5.0 * self.size]))

    def text(self, words: str, corner: FloatArray, colour: tuple[int, int, int] = WHITE) -> None:
        """Writes text on a dark plate, which is readable on any background."""
        put_text(self.picture, words, (round(corner[0]), round(corner[1])), self.size, colour)


def draw_measurement(
    image: Image, calibration: AnyCalibration, measurement: Measurement, note: str = ""
) -> Image:
    """Draws the measured line, the fit, the peak, a scale in millimetres and the values.

    Green is the line on the front wall, blue that on the rear wall, dashed yellow the fitted
    surface's line on both, the red ring the peak, with its height in millimetres beside it.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red; not changed.
        calibration: the calibration with which it was measured.
        measurement: what was measured in it.

    Returns:
        (height, width, 3) blue-green-red picture.
    """
    picture = np.array(to_colour(image), order="C")
    canvas = _Canvas(picture, letter_size(picture))
    _draw_marks(canvas, calibration, measurement)
    lines = [*captions(measurement), *([note] if note else [])]
    for index, words in enumerate(lines):
        colour = _ALARM if index and index >= len(lines) - bool(measurement.flags) else WHITE
        canvas.text(words, canvas.size * np.array([_GAP, 20.0 + 21.0 * index]), colour)
    return picture


def draw_detail(
    image: Image, calibration: AnyCalibration, measurement: Measurement, size: tuple[int, int]
) -> Image:
    """Draws only the container, scaled to a given size, with the measured line but no text.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red; not changed.
        calibration: the calibration with which it was measured.
        measurement: what was measured in it.
        size: width and height of the picture [px].

    Returns:
        (height, width, 3) blue-green-red picture.
    """
    left, top, right, bottom = _surroundings(calibration.view, image, size[0] / size[1])
    zoom = min(size[0] / (right - left), size[1] / (bottom - top))
    part = to_colour(image[top:bottom, left:right])
    kind = cv2.INTER_AREA if zoom < 1.0 else cv2.INTER_CUBIC
    width, height = round(zoom * (right - left)), round(zoom * (bottom - top))
    picture = np.zeros((size[1], size[0], 3), np.uint8)
    inside = picture[: min(height, size[1]), : min(width, size[0])]
    inside[:] = cv2.resize(part, (width, height), interpolation=kind)[: size[1], : size[0]]
    canvas = _Canvas(picture, letter_size(picture), zoom, (left, top))
    _draw_marks(canvas, calibration, measurement)
    return picture


def captions(measurement: Measurement) -> list[str]:
    """Returns the measured values as lines of text; the last line lists the flags."""
    lines = []
    if np.isfinite(measurement.msh):
        bound = ">= " if Flag.SATURATED in measurement.flags else ""
        where = f"{_degrees(measurement.azimuth, 0)}, {measurement.peak_side.name.lower()} wall"
        if measurement.peak_side is PeakSide.UNKNOWN:
            where = _degrees(measurement.azimuth, 0)
        sigma = _number(1e3 * measurement.msh_stddev, 2)
        lines.append(f"MSH {bound}{_millimetres(measurement.msh)} +- {sigma}, {where}")
    if np.isfinite(measurement.fitted_msh):
        sigma = _number(1e3 * measurement.fitted_msh_stddev, 2)
        where = _degrees(measurement.fitted_azimuth, 0)
        lines.append(f"fitted {_millimetres(measurement.fitted_msh)} +- {sigma}, {where}")
    if np.isfinite(measurement.slope_angle):
        lines.append(f"slope {_degrees(measurement.slope_angle, 2)}")
    if np.isfinite(measurement.sh_left) or np.isfinite(measurement.sh_right):
        left, right = _millimetres(measurement.sh_left), _millimetres(measurement.sh_right)
        lines.append(f"left {left}, right {right}")
    if measurement.flags:
        lines.append(" ".join(str(flag.name) for flag in measurement.flags))
    return lines


def _draw_marks(canvas: _Canvas, calibration: AnyCalibration, measurement: Measurement) -> None:
    view = calibration.view
    _draw_scale(canvas, view)
    fitted = view.fitted_line(measurement)
    for first in range(0, len(fitted), _DASH):
        canvas.line(fitted[first : first + _DASH // 2 + 1], FITTED)
    on_front = _on_front(view, measurement)
    radius = 0.7 * max(canvas.zoom / canvas.size, 1.0)
    canvas.dots(measurement.edge_pixels[~on_front], REAR, radius)
    canvas.dots(measurement.edge_pixels[on_front], FRONT, radius)
    peak = np.asarray(measurement.peak_pixel)
    if np.all(np.isfinite(peak)):
        canvas.ring(peak, PEAK)
        bound = ">= " if Flag.SATURATED in measurement.flags else ""
        canvas.beside(peak, f"{bound}{_number(1e3 * measurement.msh, 1)} mm")


def _draw_scale(canvas: _Canvas, view: CupView | BoxView) -> None:
    """Draws a height scale along the container's right edge, with marks every 10 mm."""
    floor, top = view.levels()
    ticks = np.arange(int(np.ceil(floor / _TICK)), int(np.floor(top / _TICK)) + 1)
    heights = np.asarray(_TICK * ticks, dtype=np.float64)
    unit = canvas.size / canvas.zoom
    pixels = view.scale_places(heights) + np.array([_GAP * unit, 0.0])
    if not np.all(np.isfinite(pixels)):
        return
    canvas.line(pixels, _SCALE)
    for height, pixel in zip(heights, pixels, strict=True):
        at_rest = abs(height) < 0.5 * _TICK
        end = pixel + np.array([(10.0 if at_rest else 5.0) * unit, 0.0])
        canvas.line(np.vstack((pixel, end)), _SCALE, 2.0 if at_rest else 1.0)
        if round(height / _TICK) % 2 == 0:
            label = f"{height * 1e3:.0f}" + (" mm" if at_rest else "")
            canvas.text(label, canvas.place(end) + canvas.size * np.array([4.0, 5.0]))


def _on_front(view: CupView | BoxView, measurement: Measurement) -> NDArray[np.bool_]:
    """Returns a mask of the points of the measured line on the wall that faces the camera."""
    azimuth = measurement.profile_azimuth
    if len(azimuth) != len(measurement.edge_pixels):
        return np.ones(len(measurement.edge_pixels), dtype=np.bool_)
    return view.on_front(azimuth)


def _surroundings(
    view: CupView | BoxView, image: Image, aspect: float
) -> tuple[int, int, int, int]:
    """Returns the image region around the container: left, top, right and bottom.

    Args:
        aspect: width / height that is aimed at, as far as the image goes.
    """
    height, width = image.shape[:2]
    ends = view.outline()
    if not np.any(np.isfinite(ends)):
        return 0, 0, width, height
    low, high = np.nanmin(ends, axis=0), np.nanmax(ends, axis=0)
    margin = _MARGIN * (high[0] - low[0])
    upper, lower = max(low[1] - 0.5 * margin, 0.0), min(high[1] + 0.5 * margin, height)
    wanted = max(high[0] - low[0] + 2.5 * margin, aspect * (lower - upper))
    middle = 0.5 * (low[0] + high[0]) + 0.5 * margin
    left, right = max(middle - 0.5 * wanted, 0.0), min(middle + 0.5 * wanted, width)
    if right - left < _LEAST_DETAIL or lower - upper < _LEAST_DETAIL:
        return 0, 0, width, height
    return int(left), int(upper), int(right), int(lower)


def _whole_parts(points: FloatArray) -> list[FloatArray]:
    known = np.all(np.isfinite(points), axis=1)
    cuts = np.flatnonzero(np.diff(known)) + 1
    return [part for part in np.split(points, cuts) if len(part) > 1 and np.isfinite(part[0, 0])]


def _millimetres(height: float) -> str:
    return f"{height * 1e3:.1f} mm" if np.isfinite(height) else "unknown"


def _degrees(angle: float, digits: int) -> str:
    return f"{_number(float(np.degrees(angle)), digits)} deg"


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "?"


def _fixed(pixel: FloatArray) -> tuple[int, int]:
    scale = 1 << _SHIFT
    return round(float(pixel[0]) * scale), round(float(pixel[1]) * scale)
