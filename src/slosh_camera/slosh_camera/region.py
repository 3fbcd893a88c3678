"""Part of the image in which the liquid's line is looked for, prepared once per calibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_camera.errors import SloshCameraError
from slosh_camera.geometry import CupView
from slosh_camera.settings import RegionOfInterest

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

# Depths, as fractions of the fill height, between which most of the wall is wet at all times; the
# floor's edge and what shines through it lie below.
_BODY_TOP = 0.4
_BODY_BOTTOM = 0.85
_BODY_SAMPLES = 13
# The pixels at the container's two edges mix liquid, wall and background.
_EDGE_INSET = 1.5
_MIN_COLUMNS = 16
_MIN_ROWS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """Rectangle of the image between the container's edges, from its rim down to the liquid.

    Attributes:
        top: first row.
        bottom: row after the last.
        left: first column.
        right: column after the last.
        body_rows: (samples, columns) rows, counted from `top`, of wall that is mostly wet;
            the last is where a column starts to be searched upwards.
    """

    top: int
    bottom: int
    left: int
    right: int
    body_rows: IntArray

    @property
    def seed_rows(self) -> IntArray:
        """(columns,) row, counted from `top`, where a column is liquid at all times."""
        seeds: IntArray = self.body_rows[-1]
        return seeds

    @property
    def columns(self) -> IntArray:
        """(columns,) columns of the image."""
        return np.arange(self.left, self.right)


def find_region(view: CupView, given: RegionOfInterest | None) -> Region:
    """Region of interest from the projected container, cut to the given rectangle.

    Args:
        view: the container as the camera sees it.
        given: the user's rectangle; None: the whole image.

    Returns:
        The region.

    Raises:
        SloshCameraError: the container is not upright in the image, or too little of it is
            inside.
    """
    _check_upright(view)
    camera = view.camera
    limits = given or RegionOfInterest(0, 0, camera.width, camera.height)
    left, right = _edge_columns(view)
    left = max(left, limits.x_offset)
    right = min(right, limits.x_offset + limits.width)
    if right - left < _MIN_COLUMNS:
        raise SloshCameraError(
            f"pose: only {max(0, right - left)} columns of the container are inside the image or "
            f"the region of interest, needs {_MIN_COLUMNS}"
        )
    columns = np.arange(left, right)
    last_row = limits.y_offset + limits.height - 1
    depths = np.linspace(_BODY_TOP, _BODY_BOTTOM, _BODY_SAMPLES) * view.cup.fill_height
    rows = np.array([_front_rows(view, -depth, columns) for depth in depths])
    # Where the image ends above the container's floor, the lowest rows take the place of the body.
    rows = np.minimum(rows, last_row - np.arange(_BODY_SAMPLES)[::-1, np.newaxis])
    top = max(_rim_row(view), limits.y_offset)
    body_rows = np.rint(rows).astype(np.intp) - top
    still = _front_rows(view, 0.0, columns) - top
    if np.any(body_rows[0] - still < _MIN_ROWS) or np.any(still < 0):
        raise SloshCameraError(
            "pose: the still level is not inside the image or the region of interest with "
            f"{_MIN_ROWS} rows of liquid below it"
        )
    return Region(top, top + int(body_rows.max()) + 1, left, right, body_rows)


def _check_upright(view: CupView) -> None:
    up = view.pose.rotation[:, 2]
    if -up[1] <= abs(up[0]):
        raise SloshCameraError(
            "pose: the container's axis is rolled by more than 45 degrees in the image, "
            "it must point up"
        )


def _edge_columns(view: CupView) -> tuple[int, int]:
    """Columns that lie between the container's edges over its whole height."""
    left, right = view.tangent_azimuths()
    top = view.cup.rim_level or view.cup.radius
    heights = np.array([-_BODY_BOTTOM * view.cup.fill_height, top])
    first = np.max(view.project_wall(left, heights)[:, 0]) + _EDGE_INSET
    last = np.min(view.project_wall(right, heights)[:, 0]) - _EDGE_INSET
    if not (np.isfinite(first) and np.isfinite(last)):
        raise SloshCameraError("pose: the container is outside the camera's field of view")
    return int(np.ceil(first)), int(np.floor(last)) + 1


def _front_rows(view: CupView, height: float, columns: IntArray) -> FloatArray:
    """Rows at which the front wall's circle at a height crosses image columns."""
    left, right = view.tangent_azimuths()
    azimuth = left + np.linspace(0.0, 1.0, 361) * ((right - left + np.pi) % (2.0 * np.pi) - np.pi)
    pixels = view.project_wall(azimuth, height)
    order = np.argsort(pixels[:, 0])
    rows: FloatArray = np.interp(columns, pixels[order, 0], pixels[order, 1])
    return rows


def _rim_row(view: CupView) -> int:
    """Uppermost row of the rim; the image's first row where the rim is unknown or outside."""
    level = view.cup.rim_level
    if level is None:
        return 0
    rows = view.project_wall(np.linspace(-np.pi, np.pi, 73), level)[:, 1]
    return max(0, int(np.floor(np.min(rows)))) if np.all(np.isfinite(rows)) else 0
