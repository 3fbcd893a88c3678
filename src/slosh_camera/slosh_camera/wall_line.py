"""The liquid's line on one wall: its highest point, its ends, and points that do not belong."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.geometry import Wall
from slosh_camera.measurement import NAN

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_SMOOTHING = 5
_MIN_POINTS = 8
_EDGE_ARC = np.radians(60.0)
_EDGE_GAP = np.radians(25.0)
_EDGE_OUTLIER_RATIO = 4.0
_ROBUST_STEPS = 8
# Deviation from the robust fit below which points count fully, and above which they are left
# out, as fractions of the radius; the second leaves room for higher modes.
_FINE = 0.005
_COARSE = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class WallLine:
    """Line on one wall, from left to right in the image.

    Attributes:
        wall: the wall.
        pixels: (N, 2) places in the image [px].
        azimuth: (N,) [rad]; NaN: not seen.
        height: (N,) [m]; NaN: not seen.
        width: (N,) width of the edge in the image [px].
        cut: (N,) whether the view ends there, the line is higher.
    """

    wall: Wall
    pixels: FloatArray
    azimuth: FloatArray
    height: FloatArray
    width: FloatArray
    cut: BoolArray

    @property
    def seen(self) -> BoolArray:
        """(N,) whether there is a point."""
        return np.isfinite(self.height)


@dataclass(frozen=True, slots=True)
class Peak:
    """Highest point of a line; NaN where there is none.

    Attributes:
        height: [m].
        azimuth: [rad].
        pixel: (u, v) [px].
        wall: the wall.
        edge_width: width of the edge there [px].
    """

    height: float
    azimuth: float
    pixel: tuple[float, float]
    wall: Wall
    edge_width: float


def running_median(values: FloatArray, window: int) -> FloatArray:
    """Median over an odd window; the ends are repeated."""
    padded = np.pad(values, window // 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, window)
    median: FloatArray = np.median(windows, axis=1)
    return median


def first_mode(azimuth: FloatArray) -> FloatArray:
    """Wall shapes of level and first mode, (N, 3): 1, cos, sin [DL22, eqs. (18), (19)]."""
    return np.column_stack((np.ones(azimuth.size), np.cos(azimuth), np.sin(azimuth)))


def drop_strays(lines: list[WallLine], radius: float) -> list[WallLine]:
    """Leave out points far from the one first-mode shape that explains most of both lines.

    Dark reflections in the free surface look like liquid and put parts of the front line far
    from where the wall can be wet.

    Args:
        lines: front and rear line.
        radius: the container's radius [m].

    Returns:
        The lines without the strays.
    """
    azimuth = np.concatenate([line.azimuth[line.seen & ~line.cut] for line in lines])
    height = np.concatenate([line.height[line.seen & ~line.cut] for line in lines])
    if height.size < _MIN_POINTS:
        return lines
    shape = first_mode(azimuth)
    weight = np.ones(height.size)
    for _ in range(_ROBUST_STEPS):
        # Weights 1/|residual| make this the fit of least absolute deviations.
        normal = shape.T @ (weight[:, np.newaxis] * shape)
        coefficients = np.linalg.lstsq(normal, shape.T @ (weight * height), rcond=None)[0]
        weight = 1.0 / np.maximum(np.abs(height - shape @ coefficients), _FINE * radius)
    kept = []
    for line in lines:
        residual = np.abs(line.height - first_mode(line.azimuth) @ coefficients)
        stray = ~line.cut & (residual > _COARSE * radius)
        kept.append(replace(line, height=np.where(stray, np.nan, line.height)))
    return kept


def edge_height(lines: list[WallLine], azimuth: float) -> float:
    """Height at one of the container's edges in the image.

    The edge itself is a grazing view, so the line on either side of it is continued with the
    wall's shape of the first mode.

    Args:
        lines: front and rear line.
        azimuth: the edge's azimuth [rad].

    Returns:
        Height [m]; a lower bound where the view cuts the line off beside the edge; NaN where no
        line is seen near the edge.
    """
    front = lines[0]
    away = _away(front, azimuth)
    nearest = int(np.argmin(away))
    if away[nearest] > _EDGE_GAP:
        return NAN
    if front.cut[nearest]:
        return float(front.height[nearest])
    near = [(_away(line, azimuth) < _EDGE_ARC) & ~line.cut for line in lines]
    angle = np.concatenate([line.azimuth[part] for line, part in zip(lines, near, strict=True)])
    height = np.concatenate([line.height[part] for line, part in zip(lines, near, strict=True)])
    if height.size < _MIN_POINTS:
        return NAN
    shape = first_mode(angle - azimuth)
    residual = np.abs(height - shape @ np.linalg.lstsq(shape, height, rcond=None)[0])
    good = residual <= _EDGE_OUTLIER_RATIO * np.median(residual)
    coefficients = np.linalg.lstsq(shape[good], height[good], rcond=None)[0]
    return float(coefficients[0] + coefficients[1])


def _away(line: WallLine, azimuth: float) -> FloatArray:
    """Angles (N,) between a line's points and an azimuth [rad]; inf where nothing is seen."""
    angle = np.abs(np.angle(np.exp(1j * (line.azimuth - azimuth))))
    return np.where(line.seen, angle, np.inf)


def highest(line: WallLine) -> Peak:
    """Highest point of a line, smoothed so that one noisy column does not make the peak."""
    seen = np.flatnonzero(line.seen)
    if seen.size < _SMOOTHING:
        return Peak(NAN, NAN, (NAN, NAN), line.wall, NAN)
    heights = running_median(line.height[seen], _SMOOTHING)
    best = int(np.argmax(heights))
    index = seen[best]
    return Peak(
        height=float(heights[best]),
        azimuth=float(line.azimuth[index]),
        pixel=(float(line.pixels[index, 0]), float(line.pixels[index, 1])),
        wall=line.wall,
        edge_width=float(line.width[index]),
    )


def around_the_wall(lines: list[WallLine]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Azimuths, heights and pixels of what is seen, in one sense around the wall.

    Args:
        lines: front and rear line.

    Returns:
        Azimuths (N,) [rad], heights (N,) [m] and pixels (N, 2).
    """
    front, rear = lines
    azimuth = np.concatenate((front.azimuth, rear.azimuth[::-1]))
    height = np.concatenate((front.height, rear.height[::-1]))
    pixels = np.concatenate((front.pixels, rear.pixels[::-1]))
    seen = np.isfinite(height)
    return azimuth[seen], height[seen], pixels[seen]
