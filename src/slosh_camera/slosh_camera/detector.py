"""Free-surface detection in one image after another [TM20, Fig. 3; DL22, section 4.1].

DL22 takes the highest dark pixel and places it on the front wall where the liquid below is
uniform, on the rear wall where the bright free surface is seen below it. Seen from above, the
rear line is higher in the image than the front line at equal height, so here every visible point
is first placed on its wall and the highest of them in metres is the peak. An interior crest that
hides the rear line is read as if it were on the rear wall.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibration import Calibration
from slosh_camera.edges import EdgeRows, refine
from slosh_camera.errors import SloshCameraError
from slosh_camera.geometry import Wall
from slosh_camera.measurement import Flag, Measurement, PeakSide
from slosh_camera.region import find_region
from slosh_camera.segmentation import Lines, find_levels, find_lines
from slosh_camera.settings import DetectionSettings, Liquid
from slosh_camera.wall_line import (
    Peak,
    WallLine,
    around_the_wall,
    drop_strays,
    edge_height,
    highest,
    running_median,
)

GrayImage = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_OUTLIER_WINDOW = 9
_OUTLIER_ROWS = 3.0
# Part of a Gaussian edge's width between the levels that bound the free surface, 12 % and 65 %.
_SOFT_EDGE = 0.62
# The sharper edges have the lens' own width; two lines close together look like a wider one.
_SHARP_PERCENTILE = 10.0
# Rows are whole numbers.
_ONE_EDGE = 1.0
# The first row of liquid at the level that bounds it lies so far below the middle of its step.
_MERGED_SHIFT = 1.0
_SATURATED_COLUMNS = 2


class FreeSurfaceDetector:
    """Detector for one calibrated camera; keeps the last image and the still level's offset."""

    def __init__(
        self, calibration: Calibration, settings: DetectionSettings | None = None
    ) -> None:
        """Prepare the region of interest.

        Args:
            calibration: camera, container and pose.
            settings: settings; None: those of the calibration.

        Raises:
            SloshCameraError: too little of the container is inside the image.
        """
        self._view = calibration.view
        self._settings = settings or calibration.detection
        self._region = find_region(calibration.view, calibration.region)
        self._tangents = calibration.view.tangent_azimuths()
        self._offset = 0.0
        self._last: GrayImage | None = None

    @property
    def still_offset(self) -> float:
        """Height that was measured on the liquid at rest and is subtracted since [m]."""
        return self._offset

    def learn_still(self, gray: GrayImage) -> float:
        """Take an image of the liquid at rest as the zero of all heights.

        Args:
            gray: (height, width) image.

        Returns:
            The offset [m] of the still level against the calibration.

        Raises:
            SloshCameraError: the image does not fit the camera, or shows no liquid.
        """
        self._check(gray)
        flags, lines = self._find(gray)
        front = lines[0].height if lines else np.empty(0)
        if Flag.SATURATED in flags or not np.any(np.isfinite(front)):
            raise SloshCameraError(
                "still image: shows no whole liquid line, check light, region and calibration"
            )
        self._offset += float(np.nanmedian(front))
        return self._offset

    def update(self, stamp_ns: int, gray: GrayImage) -> Measurement:
        """Measure one image.

        Args:
            stamp_ns: moment of exposure [ns].
            gray: (height, width) image of the calibrated camera.

        Returns:
            The measurement; what the image does not show is NaN, with a flag that says why.

        Raises:
            SloshCameraError: the image is not 8-bit grey of the calibrated size.
        """
        self._check(gray)
        flags = Flag.FROZEN if self._is_repeated(gray) else Flag.NONE
        found, lines = self._find(gray)
        flags |= found
        if not lines:
            return Measurement(stamp_ns=stamp_ns, flags=flags)
        left, right = (edge_height(lines, azimuth) for azimuth in self._tangents)
        peak = self._peak(lines, (left, right))
        if np.isnan(peak.height):
            return Measurement(stamp_ns=stamp_ns, flags=flags | Flag.NOT_FOUND)
        side = PeakSide.FRONT if peak.wall is Wall.FRONT else PeakSide.REAR
        azimuth, height, pixels = around_the_wall(lines)
        return Measurement(
            stamp_ns=stamp_ns,
            msh=peak.height,
            msh_stddev=self._stddev(peak),
            azimuth=peak.azimuth,
            sh_left=left,
            sh_right=right,
            azimuth_left=self._tangents[0],
            azimuth_right=self._tangents[1],
            profile_azimuth=azimuth,
            profile_height=height,
            edge_pixels=pixels,
            peak_pixel=peak.pixel,
            peak_side=side,
            flags=flags,
        )

    def _check(self, gray: GrayImage) -> None:
        camera = self._view.camera
        if gray.dtype != np.uint8 or gray.shape != (camera.height, camera.width):
            shape = " x ".join(str(size) for size in gray.shape[::-1])
            raise SloshCameraError(
                f"image: {shape} of {gray.dtype}, the calibration is for {camera.width} x "
                f"{camera.height} of uint8"
            )

    def _is_repeated(self, gray: GrayImage) -> bool:
        repeated = self._last is not None and np.array_equal(self._last, gray)
        # A copy, since the caller may use its buffer again.
        self._last = gray.copy()
        return repeated

    def _find(self, gray: GrayImage) -> tuple[Flag, list[WallLine]]:
        """Flags and, where liquid is found, the front and the rear line."""
        region, settings = self._region, self._settings
        part = gray[region.top : region.bottom, region.left : region.right]
        dark, bright = np.percentile(part[::2, ::2], (2.0, 98.0))
        if bright < settings.max_dark:
            return Flag.TOO_DARK | Flag.NOT_FOUND, []
        if dark > settings.min_bright:
            return Flag.TOO_BRIGHT | Flag.NOT_FOUND, []
        if settings.liquid is Liquid.LIGHTER:
            settings = _inverted(settings)
            part = cv2.bitwise_not(part)
        if settings.blur > 0.0:
            part = cv2.GaussianBlur(part, (0, 0), settings.blur)
        levels = find_levels(part, region, settings)
        lines = None if levels is None else find_lines(part, region, levels, settings)
        if lines is None:
            return Flag.NOT_FOUND, []
        touching = np.count_nonzero(lines.found & (lines.upper == 0))
        flags = Flag.SATURATED if touching >= _SATURATED_COLUMNS else Flag.NONE
        return flags, self._place(part, lines)

    def _place(self, part: GrayImage, lines: Lines) -> list[WallLine]:
        """Put the front line on the front wall and, where the surface is seen, the rear line."""
        upper = refine(part, lines.upper)
        gap = lines.front - lines.upper
        # A single soft edge passes through the surface's grey levels as well, over this many rows.
        thickness = gap - _SOFT_EDGE * float(np.percentile(upper.width, _SHARP_PERCENTILE))
        band = thickness >= self._settings.min_band
        front = refine(part, np.where(band, lines.front, lines.upper))
        # In between, the steps at the two lines run into each other: only roughly placed.
        merged = ~band & (thickness > _ONE_EDGE)
        front = EdgeRows(
            np.where(merged, lines.front - _MERGED_SHIFT, front.row),
            np.where(merged, np.maximum(gap, front.width), front.width),
        )
        placed = [
            self._on_wall(Wall.FRONT, front, lines.found),
            self._on_wall(Wall.REAR, upper, lines.found & band),
        ]
        return drop_strays(placed, self._view.cup.radius)

    def _on_wall(self, wall: Wall, edge: EdgeRows, seen: BoolArray) -> WallLine:
        keep = seen & (
            np.abs(edge.row - running_median(edge.row, _OUTLIER_WINDOW)) < _OUTLIER_ROWS
        )
        rows = np.where(keep, edge.row, np.nan)
        pixels = np.column_stack((self._region.columns, rows + self._region.top))
        azimuth, height = self._view.on_wall(pixels, wall)
        height = height - self._offset
        return WallLine(wall, pixels, azimuth, height, edge.width, edge.row == 0.0)

    def _peak(self, lines: list[WallLine], edges: tuple[float, float]) -> Peak:
        """Highest visible point: of the lines, or one of the container's edges.

        At an edge front and rear wall meet; it is counted with the front wall.
        """
        peaks = [highest(line) for line in lines]
        for azimuth, height in zip(self._tangents, edges, strict=True):
            if np.isnan(height):
                continue
            u, v = self._view.project_wall(azimuth, height + self._offset)[0]
            width = float(lines[0].width[self._column(u) - self._region.left])
            peaks.append(Peak(height, azimuth, (float(u), float(v)), Wall.FRONT, width))
        return max(peaks, key=_order)

    def _column(self, u: float) -> int:
        """Nearest column of the region."""
        return int(np.clip(np.rint(u), self._region.left, self._region.right - 1))

    def _stddev(self, peak: Peak) -> float:
        """One pixel's footprint at the peak's depth times the edge's width / sqrt(12).

        The edge is taken to lie anywhere within its own width with equal probability.
        """
        # A ray through the very edge may miss the wall; the column beside it is as deep.
        pixel = (self._column(peak.pixel[0]), peak.pixel[1])
        footprint = self._view.height_per_pixel(pixel, peak.wall)
        return footprint * peak.edge_width / float(np.sqrt(12.0))


def _inverted(settings: DetectionSettings) -> DetectionSettings:
    threshold = None if settings.threshold is None else 255.0 - settings.threshold
    return replace(settings, threshold=threshold)


def _order(peak: Peak) -> float:
    return -np.inf if np.isnan(peak.height) else peak.height
