"""Image region of a side view in which the contact line is detected."""

from __future__ import annotations

from dataclasses import dataclass

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

    Returns:
        The region.

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
