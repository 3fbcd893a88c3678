"""Scan lines up the container's wall, the wall points on them, and where a surface lies on them.

Each scan line follows the front wall upwards at one azimuth, as the camera sees it: a picture
sampled along them is the wall unrolled. Where every sample meets the front and the rear wall is
computed once for a calibration, so that one image costs no geometry.

Through a wall of glass the way from a point to its pixel is found step by step, which costs more
than all the rest of a measurement: it is done once for a net of points.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder import edge_search, silhouette
from slosh_camera.cylinder.surface import WallPoints
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.cup import CupView, Wall
from slosh_camera.settings import RegionOfInterest

FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Image = NDArray[np.uint8]


# Every fourth line is enough to compare surfaces.
SKIP = 4


class WallGeometry:
    """Tables of the wall points of all J samples on all M scan lines.

    Attributes:
        radius: of the container [m].
        footprint: height of one sample on the rear wall [m].
        inside: (J, M) 1 inside the image, 0 outside.
        first_row, last_row: (M,) rows inside the image.
        stretched: (M,) lines that are of no use for the upper edge.
        near, far: (J, M, 3) points of the front and of the rear wall, x and y in radii, z [m];
            NaN: none.
    """

    def __init__(self, grid: ScanGrid, radius: float) -> None:
        """Stores the scan lines' wall points in units of the radius.

        Args:
            radius: of the container [m].
        """
        rows, lines = grid.shape
        self.radius = radius
        self.rows = rows
        self.lines = lines
        self.near = grid.front / (radius, radius, 1.0)
        self.far = grid.rear / (radius, radius, 1.0)
        self.inside = np.ascontiguousarray(grid.inside, dtype=np.float32)
        self.first_row: IntArray = np.argmax(grid.inside, axis=0)
        self.last_row: IntArray = rows - 1 - np.argmax(grid.inside[::-1], axis=0)
        self._may_be_cut = bool(np.any(self.first_row > 0))
        self.footprint = _rear_footprint(grid)
        self.stretched = _stretched(grid)
        self._some = (
            np.ascontiguousarray(self.near[:, ::SKIP]),
            np.ascontiguousarray(self.far[:, ::SKIP]),
        )
        self._some_last = self.last_row[::SKIP].copy()
        self._front_height = np.ascontiguousarray(grid.front[..., 2])
        self._shapes = silhouette.shapes_of(self.near[grid.still_row])

    def wall_points(
        self, place: FloatArray, width: FloatArray, at_border: BoolArray
    ) -> WallPoints:
        """Converts rows of the contact line to points on the wall.

        Args:
            place: (M,) rows; NaN: none.
            width: (M,) of the edges [samples].
            at_border: (M,) whether the liquid reaches the image's border instead.
        """
        rows = np.where(at_border, self.first_row, place)
        points = edge_search.table_at(self.near, rows)
        azimuth = np.arctan2(points[:, 1], points[:, 0])
        shapes = silhouette.shapes_of(points)
        scale = np.full(rows.size, np.hypot(TUNING.systematic, TUNING.front_rows * self.footprint))
        height = points[:, 2].copy()
        return WallPoints(rows, azimuth, height, shapes, at_border, width, scale)

    def fade(self, softness: float) -> float:
        """Returns the rear-wall height [m] over which a wave crest fades into the background."""
        least, most = TUNING.fade_limits
        return self.footprint * min(max(softness / TUNING.sharp_rows, least), most)

    def silhouette(
        self, heights: FloatArray, softness: float, *, coarse: bool = False
    ) -> FloatArray:
        """Returns the rows where a surface ends against the background; -1 above the image.

        Args:
            heights: (SHAPES,) of the surface [m].
            softness: width of the picture's edges [rows].
            coarse: for every `SKIP`th line only.

        Returns:
            (M,), between those of every `SKIP`th line.
        """
        rows = silhouette.silhouette_rows(
            *self._some, self._some_last, self.radius, self.fade(softness), heights
        )
        return rows if coarse else np.asarray(edge_search.between_lines(rows, SKIP, self.lines))

    def front_rows(self, heights: FloatArray) -> FloatArray:
        """Returns the rows (M,) of a surface's front contact line."""
        return np.asarray(edge_search.rows_of_heights(self._front_height, self._shapes @ heights))

    def covered_border(self, picture: Single) -> bool:
        """Whether the image border shows something other than background."""
        cut = np.flatnonzero(self.first_row > 0)
        return bool(
            np.count_nonzero(picture[self.first_row[cut], cut] < TUNING.covered)
            >= TUNING.border_lines
        )

    def beyond_border(self, heights: FloatArray) -> BoolArray:
        """Whether a surface lies beyond the image border, for every `SKIP`th scan line."""
        if not self._may_be_cut:
            return np.zeros(0, np.bool_)
        rows = self.first_row[::SKIP].astype(np.float64)
        near = edge_search.table_at(self._some[0], rows)
        far = edge_search.table_at(self._some[1], rows)
        far[self.stretched[::SKIP]] = np.nan
        above = silhouette.above_ray(near, far, self.radius, self.footprint, heights)
        front = silhouette.shapes_of(near) @ heights > near[:, 2]
        return np.asarray((above | front) & (self.first_row[::SKIP] > 0))


def _rear_footprint(grid: ScanGrid) -> float:
    middle = grid.rear[:, grid.shape[1] // 2, 2]
    steps = np.abs(np.diff(middle))
    known = steps[np.isfinite(steps)]
    if not known.size:
        known = np.abs(np.diff(grid.front[:, grid.shape[1] // 2, 2]))
    return float(np.median(known))


def _stretched(grid: ScanGrid) -> BoolArray:
    """Returns a mask of scan lines (M,) where refraction stretches the rear wall too much."""
    row = grid.rear[grid.still_row]
    step = np.full(len(row), np.nan)
    step[1:-1] = 0.5 * np.linalg.norm(row[2:] - row[:-2], axis=1)
    usual = float(np.nanmedian(step)) if np.any(np.isfinite(step)) else np.nan
    return np.asarray(~(step < TUNING.stretch * usual))


_AZIMUTHS = 180
_STEP = 2.0 * np.pi / _AZIMUTHS
_HEIGHTS = 25


class WallPixels:
    """Table of the image positions of a container's wall points by azimuth and height."""

    def __init__(self, view: CupView) -> None:
        """Projects a grid of wall points into the image, as a look-up table."""
        self._view = view
        level = view.cup.rim_level
        top = TUNING.unknown_rim * view.cup.radius if level is None else level
        self._low = -view.cup.fill_height
        self._spacing = (top - self._low) / (_HEIGHTS - 1)
        heights = self._low + self._spacing * np.arange(_HEIGHTS)
        azimuth, height = np.meshgrid(_STEP * np.arange(_AZIMUTHS), heights, indexing="ij")
        pixels = view.project_wall(azimuth.ravel(), height.ravel())
        self._table: FloatArray = pixels.reshape(_AZIMUTHS, _HEIGHTS, 2)
        # Next to the container's sides the net is too wide.
        sides = np.asarray(view.tangent_azimuths())
        self._exact = {int(side // _STEP + k) % _AZIMUTHS for side in sides for k in range(-4, 5)}

    def __call__(self, azimuth: float, height: float) -> tuple[float, float]:
        """Returns image column and row of a wall point [px], or NaN if it is not visible.

        Args:
            azimuth: [rad].
            height: above the still level [m].
        """
        if not (np.isfinite(azimuth) and np.isfinite(height)):
            return float("nan"), float("nan")
        across = (azimuth / _STEP) % _AZIMUTHS
        up = (height - self._low) / self._spacing
        i, j = int(across) % _AZIMUTHS, int(up)
        if i in self._exact or not 0 <= j < _HEIGHTS - 1:
            u, v = self._view.project_wall(azimuth, height)[0]
            return float(u), float(v)
        a, b = across - int(across), up - j
        here, beside = self._table[i], self._table[(i + 1) % _AZIMUTHS]
        low = (1.0 - a) * here[j] + a * beside[j]
        high = (1.0 - a) * here[j + 1] + a * beside[j + 1]
        u, v = (1.0 - b) * low + b * high
        return float(u), float(v)


_MAX_LINES = 128
_MAX_ROWS = 300
_EDGE_SAMPLES = 721


@dataclass(frozen=True, slots=True, eq=False)
class ScanGrid:
    """Sample points along M vertical scan lines on the wall, J points each, from the top down.

    Attributes:
        pixels: (J, M, 2) places in the image (u, v), a pixel apart along a line, or somewhat more.
        inside: (J, M) whether the sample lies in the image and the region of interest.
        front: (J, M, 3) point of the front wall seen there, as on an upright wall [m].
        rear: (J, M, 3) point of the rear wall seen there above the liquid, as on an upright wall
            [m]; NaN: none.
        azimuth: (M,) of the lines on the front wall at the still level [rad].
        still_row: row at which the front wall's still level is seen, the same on all lines.
        window: left, top, right and bottom of the part of the image that the lines lie in.
    """

    pixels: FloatArray
    inside: BoolArray
    front: FloatArray
    rear: FloatArray
    azimuth: FloatArray
    still_row: int
    window: tuple[int, int, int, int]
    _maps: tuple[NDArray[np.int16], NDArray[np.uint16]]

    @property
    def shape(self) -> tuple[int, int]:
        """Number of samples per scan line, and number of scan lines."""
        return int(self.pixels.shape[0]), int(self.pixels.shape[1])

    def unroll(self, image: Image) -> Image:
        """Samples an image along the scan lines; returns an unrolled image of the wall.

        Args:
            image: (height, width) or (height, width, 3); may be a view of any strides.

        Returns:
            (J, M) or (J, M, 3); 0 outside the image.
        """
        left, top, right, bottom = self.window
        part = image[top:bottom, left:right]
        return np.asarray(
            cv2.remap(part, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT),
            dtype=np.uint8,
        )

    def pixel_at(self, lines: BoolArray, rows: FloatArray) -> FloatArray:
        """Returns image positions (N, 2) of fractional rows (M,) on selected scan lines (M,)."""
        start = self.pixels[0, lines]
        return np.asarray(start + rows[lines, np.newaxis] * (self.pixels[1, lines] - start))


def build_scan_grid(view: CupView, given: RegionOfInterest | None) -> ScanGrid:
    """Creates scan lines over the visible part of the container's wall.

    Args:
        view: the container as the camera sees it.
        given: the user's rectangle of the image; None: the whole image.

    Raises:
        SloshCameraError: the container is not upright in the image, or too little of it is
            inside.
    """
    _check_upright(view)
    azimuth = _line_azimuths(view)
    bottom = view.project_wall(azimuth, -TUNING.wall_depth * view.cup.fill_height, Wall.FRONT)
    still = view.project_wall(azimuth, 0.0, Wall.FRONT)
    length = np.linalg.norm(still - bottom, axis=1, keepdims=True)
    unit = (still - bottom) / length
    height = np.max(_heights(view, azimuth, still, unit))
    # Beyond some hundred samples on a line, finer ones add cost and no accuracy.
    spacing = max(1.0, float(height + np.min(length)) / _MAX_ROWS)
    still_row = int(np.ceil(height / spacing))
    last_row = still_row + int(np.floor(np.min(length) / spacing))
    along = spacing * np.arange(still_row, still_row - last_row - 1, -1.0)
    pixels = still + along[:, np.newaxis, np.newaxis] * unit
    limits = given or RegionOfInterest(0, 0, view.camera.width, view.camera.height)
    inside = _inside(pixels, limits)
    keep = _usable(inside, still_row)
    if np.count_nonzero(keep) < TUNING.least_lines:
        raise SloshCameraError(
            f"pose: only {np.count_nonzero(keep)} of {keep.size} lines up the container's wall "
            "show the still level and liquid below it inside the image or the region of "
            f"interest, needs {TUNING.least_lines}"
        )
    pixels = np.ascontiguousarray(pixels[:, keep])
    trace = view.trace(pixels.reshape(-1, 2))
    shape = (*pixels.shape[:2], 3)
    window = _window(pixels, limits)
    return ScanGrid(
        pixels,
        inside[:, keep],
        view.cup.upright_points(trace.front).reshape(shape),
        view.cup.upright_points(trace.rear).reshape(shape),
        azimuth[keep],
        still_row,
        window,
        _remap_tables(pixels, window),
    )


def _check_upright(view: CupView) -> None:
    up = view.pose.rotation[:, 2]
    if -up[1] <= abs(up[0]):
        raise SloshCameraError(
            "pose: the container's axis is rolled by more than 45 degrees in the image, "
            "it must point up"
        )


def _line_azimuths(view: CupView) -> FloatArray:
    """Returns azimuths of scan lines on the front wall that are equally spaced in the image."""
    # Against the camera's azimuth: through a thick wall more than half of the front is seen.
    middle = view.camera_azimuth
    left, right = (
        (end - middle + np.pi) % (2.0 * np.pi) - np.pi for end in view.tangent_azimuths()
    )
    azimuth = middle + np.linspace(left, right, _EDGE_SAMPLES)
    u = view.project_wall(azimuth, 0.0, Wall.FRONT)[:, 0]
    seen = np.isfinite(u)
    if np.count_nonzero(seen) < 2:
        raise SloshCameraError("pose: the container is outside the camera's field of view")
    azimuth, u = azimuth[seen], u[seen]
    order = np.argsort(u)
    first, last = u[order[0]] + TUNING.edge_inset, u[order[-1]] - TUNING.edge_inset
    lines = int(np.clip(last - first, 2, _MAX_LINES))
    chosen: FloatArray = np.interp(np.linspace(first, last, lines), u[order], azimuth[order])
    return chosen


def _heights(
    view: CupView, azimuth: FloatArray, still: FloatArray, unit: FloatArray
) -> FloatArray:
    """Returns heights (M,) [px] in the image, from the level at rest to above the rim."""
    level = view.cup.rim_level
    top = TUNING.unknown_rim * view.cup.radius if level is None else level
    ends = view.project_wall(azimuth, top, Wall.FRONT)
    around = view.project_wall(np.linspace(-np.pi, np.pi, 73), top)
    highest = np.nanmin(around[:, 1])
    # Along a line to the row of the highest point of the rim, that of the rear wall included.
    to_rim = (still[:, 1] - highest) / -unit[:, 1]
    heights: FloatArray = np.fmax(np.sum((ends - still) * unit, axis=1), to_rim)
    return heights


def _inside(pixels: FloatArray, limits: RegionOfInterest) -> BoolArray:
    u, v = pixels[..., 0], pixels[..., 1]
    right, bottom = limits.x_offset + limits.width - 1, limits.y_offset + limits.height - 1
    inside: BoolArray = (
        (u >= limits.x_offset) & (u <= right) & (v >= limits.y_offset) & (v <= bottom)
    )
    return inside


def _usable(inside: BoolArray, still_row: int) -> BoolArray:
    """Returns the mask (M,) of scan lines that show enough wall above and below the rest level."""
    if still_row + TUNING.least_below >= len(inside):
        return np.zeros(inside.shape[1], dtype=np.bool_)
    around = inside[max(still_row - TUNING.least_above, 0) : still_row + TUNING.least_below]
    usable: BoolArray = np.all(around, axis=0)
    return usable


def _window(pixels: FloatArray, limits: RegionOfInterest) -> tuple[int, int, int, int]:
    """Returns the image region that contains the scan lines: left, top, right and bottom."""
    low = np.floor(np.min(pixels, axis=(0, 1))).astype(int)
    high = np.ceil(np.max(pixels, axis=(0, 1))).astype(int) + 2
    left, top = max(low[0], limits.x_offset), max(low[1], limits.y_offset)
    right = min(high[0], limits.x_offset + limits.width)
    bottom = min(high[1], limits.y_offset + limits.height)
    return int(left), int(top), int(right), int(bottom)


def _remap_tables(
    pixels: FloatArray, window: tuple[int, int, int, int]
) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
    local = (pixels - window[:2]).astype(np.float32)
    places, fractions = cv2.convertMaps(local[..., 0], local[..., 1], cv2.CV_16SC2)
    return np.asarray(places, np.int16), np.asarray(fractions, np.uint16)
