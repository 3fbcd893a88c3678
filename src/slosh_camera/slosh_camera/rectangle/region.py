"""Image region of a side view in which the contact line is detected, and heights round a wall.

Seen from the side, the line of liquid in a round container is the higher one of those on the near
and on the far half of the wall. All first modes are a cosine of the azimuth there; second order
adds the cosine of twice the azimuth. The near half is seen larger than the plane through the axis,
the far half smaller: each of the two readings is fitted, and what they leave of the level, which
no wave changes, tells which one it is.

At rest a camera that is not quite level sees the line bowed. A surface seen so flatly mirrors what
is behind it: the line is the near half's, bowed down from above and up from below, and the far
half's, from which its heights count, is bowed the other way. The far half is seen only where it
is higher in the image than the near one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.box import BoxView
from slosh_camera.optics.round_body import RoundView
from slosh_camera.rectangle.tuning import TUNING
from slosh_camera.settings import RegionOfInterest

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


_SAMPLE_ROWS = 9
_SAMPLE_COLUMN_STEP = 4
_OUTLINE_POINTS = 65
_LEVELS = 9


@dataclass(frozen=True, slots=True, eq=False)
class RegionPlaces:
    """Pixel positions in the image region of a side view, as index arrays of equal shape."""

    rows: IntArray
    columns: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class SideRegion:
    """Image rectangle around the front face; rows and columns count from its corner.

    Attributes:
        top: the image's row of the first row; even number of rows and columns follow.
        left: the image's column of the first column.
        inside: (rows, columns) where the face is seen.
        wet: places that hold liquid nearly always.
        dry: places that hold none nearly always.
        open_above: (columns,) whether a column ends at the rim or the image's border, and not at a
            wall that leans inwards.
        row_of_level: (3, columns) polynomial that gives the row from the height, constant first.
    """

    top: int
    left: int
    inside: BoolArray
    wet: RegionPlaces
    dry: RegionPlaces
    open_above: BoolArray
    row_of_level: FloatArray

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the region in the whole image, as slices."""
        rows, columns = self.inside.shape
        return slice(self.top, self.top + rows), slice(self.left, self.left + columns)

    def rows_at(self, level: FloatArray) -> FloatArray:
        """Returns the fractional image row (columns,) of a height [m] in each image column."""
        constant, linear, square = self.row_of_level
        rows: FloatArray = constant + level * (linear + level * square)
        return rows


def find_side_region(view: BoxView, given: RegionOfInterest | None) -> SideRegion:
    """Returns the image region of the container's front face, cropped to a given rectangle.

    Args:
        view: the container as the camera sees it.
        given: the user's rectangle; None: the whole image.

    Raises:
        SloshCameraError: too little of the face is inside the image or the rectangle.
    """
    camera = view.camera
    limits = given or RegionOfInterest(0, 0, camera.width, camera.height)
    low, high = _levels(view, limits)
    mask = _mask(view, limits, low, high)
    filled_columns = np.flatnonzero(mask.any(axis=0))
    if filled_columns.size < TUNING.least_columns:
        raise SloshCameraError(
            f"pose: only {filled_columns.size} columns of the container are inside the image or "
            f"the region of interest, needs {TUNING.least_columns}"
        )
    filled_rows = np.flatnonzero(mask.any(axis=1))
    # Even sizes, so that every pixel has its place in the copy of half the size.
    top, left = int(filled_rows[0]), int(filled_columns[0])
    height = (int(filled_rows[-1]) + 1 - top) & ~1
    width = (int(filled_columns[-1]) + 1 - left) & ~1
    inside = mask[top : top + height, left : left + width]
    rows_of = _rows_of_levels(view, np.linspace(low, high, _LEVELS), left + np.arange(width))
    rows_of -= top
    visible = _visible(view, inside, rows_of, (low, high))
    powers = np.linspace(low, high, _LEVELS)[:, np.newaxis] ** np.arange(3)
    polynomial = np.linalg.lstsq(powers, rows_of, rcond=None)[0].astype(np.float64)
    region = SideRegion(
        top, left, inside, *visible, _open_above(view, inside, rows_of), polynomial
    )
    _check_level(region)
    return region


def _levels(view: BoxView, limits: RegionOfInterest) -> tuple[float, float]:
    """Returns the lowest and highest height of the face inside a rectangle [m]."""
    box = view.box
    high = box.rim_level
    if high is None:
        right = limits.x_offset + limits.width - 1
        upper = [[limits.x_offset, limits.y_offset], [right, limits.y_offset]]
        high = float(np.max(view.on_face(upper)[1]))
    if not (np.isfinite(high) and high > 0.0):
        raise SloshCameraError(
            "pose: the image or the region of interest ends below the still level"
        )
    return -TUNING.lowest * box.fill_height, high


def _mask(view: BoxView, limits: RegionOfInterest, low: float, high: float) -> BoolArray:
    """Returns a mask of the image where the face is visible between two heights."""
    half = 0.5 * view.box.width
    across = np.linspace(-half, half, _OUTLINE_POINTS)
    up = np.linspace(low, high, _OUTLINE_POINTS)
    outline = np.vstack(
        (
            view.project_face(across, low),
            view.project_face(half, up),
            view.project_face(across[::-1], high),
            view.project_face(-half, up[::-1]),
        )
    )
    if not np.all(np.isfinite(outline)):
        raise SloshCameraError("pose: the container is outside the camera's field of view")
    camera = view.camera
    mask = np.zeros((camera.height, camera.width), np.uint8)
    # Far outside, whole numbers of pixels would not fit.
    near = np.clip(outline, -4.0 * camera.width, 5.0 * max(camera.width, camera.height))
    cv2.fillPoly(mask, [np.rint(near).astype(np.int32)], 1)
    size = 2 * TUNING.edge_inset + 1
    # The frame's border is no edge of the container.
    eroded = cv2.erode(mask, np.ones((size, size), np.uint8), borderValue=1)
    inside = np.zeros(mask.shape, np.bool_)
    window = (
        slice(limits.y_offset, limits.y_offset + limits.height),
        slice(limits.x_offset, limits.x_offset + limits.width),
    )
    inside[window] = eroded[window] > 0
    return inside


def _rows_of_levels(view: BoxView, levels: FloatArray, columns: IntArray) -> FloatArray:
    """Returns image rows (levels, columns) of heights in given columns."""
    half = 0.5 * view.box.width
    # Beyond the walls, so that columns that touch a rolled container are covered as well.
    across = np.linspace(-1.2 * half, 1.2 * half, 4 * _OUTLINE_POINTS)
    rows = np.empty((levels.size, columns.size))
    for index, level in enumerate(levels):
        pixels = view.project_face(across, level)
        pixels = pixels[np.isfinite(pixels[:, 0])]
        rows[index] = np.interp(columns, pixels[:, 0], pixels[:, 1])
    return rows


def _visible(
    view: BoxView, inside: BoolArray, rows_of: FloatArray, levels: tuple[float, float]
) -> tuple[RegionPlaces, RegionPlaces]:
    """Returns masks of visible pixels that are nearly always wet, and nearly always dry."""
    columns = np.flatnonzero(inside.any(axis=0))
    first = np.argmax(inside, axis=0)
    last = inside.shape[0] - 1 - np.argmax(inside[::-1], axis=0)
    still = rows_of[0] + (rows_of[-1] - rows_of[0]) * (-levels[0] / (levels[1] - levels[0]))
    # Beyond the still level's ends a wall that leans shows one of the two alone.
    both = (first + TUNING.least_rows < still) & (still < last - TUNING.least_rows)
    columns = columns[both[columns]]
    if columns.size < TUNING.least_columns:
        raise SloshCameraError(
            "pose: the still level is not inside the image or the region of interest with "
            f"{TUNING.least_rows} rows above and below it"
        )
    columns = columns[_SAMPLE_COLUMN_STEP // 2 :: _SAMPLE_COLUMN_STEP]
    depth = (last - still)[columns]
    freeboard = (still - first)[columns]
    steps = np.linspace(0.0, 1.0, _SAMPLE_ROWS)[:, np.newaxis]
    wet = still[columns] + depth * (TUNING.sure + (TUNING.sure_end - TUNING.sure) * steps)
    dry = still[columns] - freeboard * (TUNING.sure + (TUNING.sure_end - TUNING.sure) * steps)
    limit = inside.shape[0] - 1
    places = np.broadcast_to(columns, wet.shape)
    return (
        RegionPlaces(np.clip(np.rint(wet), 0, limit).astype(np.intp), places),
        RegionPlaces(np.clip(np.rint(dry), 0, limit).astype(np.intp), places),
    )


def _open_above(view: BoxView, inside: BoolArray, rows_of: FloatArray) -> BoolArray:
    """Returns a mask of columns (columns,) that reach the highest level or the image border."""
    if not isinstance(view, RoundView):
        return np.ones(inside.shape[1], np.bool_)
    first = np.argmax(inside, axis=0)
    near = np.maximum(rows_of[-1], 0.0) + 2 * TUNING.edge_inset + 1
    return np.asarray(first <= near, np.bool_)


def _check_level(region: SideRegion) -> None:
    still = region.rows_at(np.zeros(region.inside.shape[1]))
    middle = region.inside.shape[1] // 2
    rows = np.flatnonzero(region.inside[:, middle])
    if rows.size == 0 or not (
        rows[0] + TUNING.least_rows <= still[middle] <= rows[-1] - TUNING.least_rows
    ):
        raise SloshCameraError(
            "pose: the still level is not inside the image or the region of interest with "
            f"{TUNING.least_rows} rows above and below it"
        )


_ANGLES = np.linspace(-np.pi, np.pi, 721)
_LEFT, _RIGHT = 180, 540
NEAR, FAR = False, True


class RoundWall(NamedTuple):
    """Heights around a round wall, estimated from a side view.

    Attributes:
        left, right: at both ends of the line [m].
        ends_stddev: standard deviation of the two [m].
        height: the highest [m].
        stddev: its standard deviation [m].
        azimuth: where it is, from x towards y, away from the camera [rad]; NaN: before or behind
            the axis, not known which.
        spread: standard deviation of it by not knowing which half is seen, and was at rest [m].
    """

    left: float
    right: float
    ends_stddev: float
    height: float
    stddev: float
    azimuth: float
    spread: float


class _Reading(NamedTuple):
    """Contact line taken to lie on one half of the wall: Fourier coefficients and misfit.

    They are those of heights as on an upright wall, see `RoundView.upright`.
    """

    view: RoundView
    coefficients: FloatArray
    covariance: FloatArray
    misfit: float

    def at(self, angles: FloatArray) -> FloatArray:
        """Returns heights on the wall [m] at azimuths measured from the camera's direction."""
        return self.view.leaning(_functions(angles) @ self.coefficients)

    def stddev(self, angle: float) -> float:
        """Returns the standard deviation of the height at an azimuth [m]."""
        functions = _functions(np.array([angle]))[0]
        return float(np.sqrt(functions @ self.covariance @ functions))


def round_wall(
    view: RoundView, x: FloatArray, z: FloatArray, common: float, bow: float = 0.0
) -> RoundWall:
    """Estimates the heights around a round wall from points of the contact line.

    Args:
        view: the container as the camera sees it.
        x: (N,) places across, as `RoundView` has them [m].
        z: (N,) heights above the line at rest in the plane through the axis [m].
        common: standard deviation of what all points are off together [m].
        bow: of the line at rest, positive upwards [m].
    """
    towards = np.cos(view.around(x, np.zeros(x.size), far=NEAR)[0])
    apart = bow * (1.0 + _shrinking(view))
    readings = [_fitted(view, x, z, NEAR), _fitted(view, x, z + apart * towards, FAR)]
    hidden = max(float(readings[FAR].coefficients[2]) + 0.5 * apart, 0.0) / TUNING.level_sure
    misfits = np.array([readings[NEAR].misfit, readings[FAR].misfit + hidden**2])
    likely = np.exp(0.5 * (misfits.min() - misfits))
    likely /= likely.sum()
    best = readings[int(np.argmax(likely))]
    sure = bool(likely.max() > TUNING.sure_reading)
    around = np.array([one.at(_ANGLES) for one in readings])
    tops = around.max(axis=1)
    height, spread = _mixed(tops, likely)
    left, right = (_mixed(around[:, at], likely) for at in (_LEFT, _RIGHT))
    ends = np.hypot(best.stddev(_ANGLES[_RIGHT]), max(left[1], right[1]))
    highest = int(np.argmax(around[int(np.argmax(likely))]))
    # Of a liquid that mirrors nothing a line bowed up may be the far half's, seen from above.
    spread = float(np.hypot(spread, 2.0 * max(bow, 0.0) * np.cos(_ANGLES[highest])))
    azimuth = float(_ANGLES[highest]) - 0.5 * np.pi
    sideways = abs(np.sin(azimuth)) < TUNING.sideways
    return RoundWall(
        left[0],
        right[0],
        float(np.hypot(ends, common)),
        height,
        float(np.sqrt(best.stddev(_ANGLES[highest]) ** 2 + common**2 + spread**2)),
        float(np.angle(np.exp(1j * azimuth))) if sure or sideways else float("nan"),
        spread,
    )


def _shrinking(view: RoundView) -> float:
    """Returns the ratio of far to near half's curvature in the image, for liquid at rest."""
    inner = view.body.size
    return (view.distance - inner) / (view.distance + inner)


def _mixed(values: FloatArray, likely: FloatArray) -> tuple[float, float]:
    """Returns the probability-weighted mean and standard deviation of two values."""
    mean = float(likely @ values)
    return mean, float(np.sqrt(likely @ (values - mean) ** 2))


def _functions(angles: FloatArray) -> FloatArray:
    """Returns columns 1, sin φ, cos φ, cos 2φ, sin 2φ for azimuths φ (N,)."""
    return np.column_stack(
        (np.ones(angles.size), np.sin(angles), np.cos(angles), np.cos(2 * angles),
         np.sin(2 * angles))
    )  # fmt: skip


def _fitted(view: RoundView, x: FloatArray, z: FloatArray, far: bool) -> _Reading:
    """Fits a contact line's points as lying on the near or on the far half of the wall."""
    angles, heights = view.around(x, z, far=far)
    heights = view.upright(heights)
    functions = _functions(angles)
    size = float(np.ptp(heights)) + TUNING.level_sure
    prior = np.array([0.0, np.inf, np.inf, TUNING.second_order, TUNING.second_order]) * size
    prior[0] = np.hypot(TUNING.level_sure, TUNING.level_second * size)
    scatter = TUNING.level_sure
    weight: FloatArray = np.ones(x.size)
    coefficients: FloatArray = np.zeros(5)
    normal = np.eye(5)
    for _ in range(6):
        variance = TUNING.correlated_columns * scatter**2
        weighted = functions * (weight / variance)[:, np.newaxis]
        normal = weighted.T @ functions + np.diag(prior**-2.0)
        coefficients = np.asarray(np.linalg.solve(normal, weighted.T @ heights), np.float64)
        residual = heights - functions @ coefficients
        scatter = max(1.4826 * float(np.median(np.abs(residual))), TUNING.least_scatter)
        weight = np.maximum(1.0 - (residual / (TUNING.tukey * scatter)) ** 2, 0.0) ** 2
    # Both readings are judged by the same error of a point.
    variance = TUNING.correlated_columns * TUNING.reading_error**2
    clipped = np.minimum(np.abs(residual), 3.0 * TUNING.reading_error)
    misfit = float((clipped**2).sum() / variance + ((coefficients / prior) ** 2).sum())
    covariance: FloatArray = np.asarray(np.linalg.inv(normal), dtype=np.float64)
    return _Reading(view, coefficients, covariance, misfit)
