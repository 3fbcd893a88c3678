"""Draws what the cell's camera sees: a glass cup with dark liquid.

Every edge is computed by the pinhole projection, column by column, and drawn with the share of the
pixel that it covers: where an edge lies is exact to a few hundredths of a pixel. The free surface
is taken over the whole cross-section, so that a crest inside hides the wall behind it. Refraction
is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.geometry import CupView
from slosh_model.bessel import radial_shape

Array = NDArray[np.float64]
GrayImage = NDArray[np.uint8]

AZIMUTHS = 181
RINGS = 8
NOISE_TILES = 8


@dataclass(frozen=True, slots=True)
class Appearance:
    """Grey levels, 0 black … 255 white.

    Attributes:
        background, liquid, surface: of the background, of the liquid seen through the wall, of its
            free surface seen from above.
        outline: of the cup's edges.
        noise: standard deviation of the camera's noise.
        blur: standard deviation of the lens' blur [px].
        seed: of the noise.
    """

    background: float = 205.0
    liquid: float = 48.0
    surface: float = 118.0
    outline: float = 150.0
    noise: float = 2.5
    blur: float = 0.7
    seed: int = 1


class CupRenderer:
    """Draws the cup of a calibrated view.

    Args:
        view: camera, pose and container; the lens must not distort.
        appearance: grey levels and noise.
    """

    def __init__(self, view: CupView, appearance: Appearance | None = None) -> None:
        self._view = view
        self._look = appearance or Appearance()
        camera = view.camera
        self._columns = np.arange(camera.width, dtype=np.float64)
        self._rows = np.arange(camera.height, dtype=np.float32)[:, np.newaxis]
        left, right = view.tangent_azimuths()
        span = (right - left) % (2.0 * np.pi)
        self._front = left + span * np.linspace(0.0, 1.0, AZIMUTHS)
        self._rear = left - (2.0 * np.pi - span) * np.linspace(0.0, 1.0, AZIMUTHS)
        self._radii = np.linspace(1.0 / RINGS, 1.0, RINGS)
        self._shape = radial_shape(1, self._radii)
        self._sides = self._side_coverage(left, right)
        self._floor = self._floor_line()
        self._background = self._draw_background()
        self._noise = self._noise_tiles()
        self._frame = 0

    def render(self, sh_x: float, sh_y: float) -> GrayImage:
        """An image of the liquid with these wall heights at the container's +x and +y [m].

        Returns:
            (height, width) uint8.
        """
        look = self._look
        front = self._line(self._front, self._wall_height(self._front, sh_x, sh_y), 1.0)
        top, bottom = self._surface_envelope(sh_x, sh_y)
        surface = self._between(top, np.maximum(bottom, front)) * self._sides
        body = self._between(front, self._floor) * self._sides
        image = self._background.copy()
        image += surface * (look.surface - image)
        image += body * (look.liquid - image)
        if look.blur > 0.0:
            image = cv2.GaussianBlur(image, (0, 0), look.blur)
        return self._with_noise(image)

    def _wall_height(self, azimuth: Array, sh_x: float, sh_y: float) -> Array:
        return sh_x * np.cos(azimuth) + sh_y * np.sin(azimuth)

    def _line(self, azimuth: Array, height: Array, relative_radius: float) -> Array:
        """Image row of a curve at each column; NaN where the curve does not reach."""
        radius = relative_radius * self._view.cup.radius
        points = np.column_stack((radius * np.cos(azimuth), radius * np.sin(azimuth), height))
        u, v = self._view.project(points).T
        order = np.argsort(u)
        rows: Array = np.interp(self._columns, u[order], v[order], left=np.nan, right=np.nan)
        return rows

    def _floor_line(self) -> Array:
        """Lower edge of the liquid; perspective makes the floor narrower than the cup's sides."""
        line = self._line(self._front, np.full(AZIMUTHS, -self._view.cup.fill_height), 1.0)
        known = np.isfinite(line)
        rows: Array = np.interp(self._columns, self._columns[known], line[known])
        return rows

    def _surface_envelope(self, sh_x: float, sh_y: float) -> tuple[Array, Array]:
        """Upper and lower edge of the free surface at each column [px]."""
        lines = [
            self._line(side, shape * self._wall_height(side, sh_x, sh_y), radius)
            for radius, shape in zip(self._radii, self._shape, strict=True)
            for side in (self._front, self._rear)
        ]
        stack = np.stack(lines)
        return np.fmin.reduce(stack), np.fmax.reduce(stack)

    def _between(self, top: Array, bottom: Array) -> NDArray[np.float32]:
        """Share of each pixel between two edges; 0 in columns that the edges do not reach."""
        upper = np.nan_to_num(top, nan=1e6).astype(np.float32)
        lower = np.nan_to_num(bottom, nan=-1e6).astype(np.float32)
        inside: NDArray[np.float32] = np.clip(self._rows + 0.5 - upper, 0.0, 1.0)
        inside *= np.clip(lower + 0.5 - self._rows, 0.0, 1.0)
        return inside

    def _side_coverage(self, left: float, right: float) -> NDArray[np.float32]:
        """Share of each pixel between the cup's left and right edge."""
        levels = np.linspace(-self._view.cup.fill_height, self._top_level(), 2)
        rows = self._rows[:, 0].astype(np.float64)
        edges = []
        for azimuth in (left, right):
            u, v = self._view.project_wall(np.full(2, azimuth), levels).T
            slope = (u[1] - u[0]) / (v[1] - v[0])
            edges.append(u[0] + slope * (rows - v[0]))
        columns = self._columns[np.newaxis, :]
        first, last = min(edges, key=np.mean), max(edges, key=np.mean)
        inside = np.clip(columns + 0.5 - first[:, np.newaxis], 0.0, 1.0)
        inside *= np.clip(last[:, np.newaxis] + 0.5 - columns, 0.0, 1.0)
        return np.asarray(inside, dtype=np.float32)

    def _top_level(self) -> float:
        level = self._view.cup.rim_level
        return self._view.cup.radius if level is None else level

    def _draw_background(self) -> NDArray[np.float32]:
        """An unevenly lit wall with the cup's outline in front."""
        look = self._look
        light = 1.0 - 0.08 * (self._columns / self._columns[-1] - 0.4) ** 2
        image = np.repeat((look.background * light)[np.newaxis, :], len(self._rows), axis=0)
        image = image.astype(np.float32)
        left, right = self._front[0], self._front[-1]
        circle = np.linspace(-np.pi, np.pi, 2 * AZIMUTHS)
        outlines = [self._view.project_wall(circle, self._top_level())]
        for azimuth in (left, right):
            ends = np.array([-self._view.cup.fill_height, self._top_level()])
            outlines.append(self._view.project_wall(np.full(2, azimuth), ends))
        for outline in outlines:
            points = np.round(outline * 16.0).astype(np.int32)
            cv2.polylines(image, [points], False, look.outline, 1, cv2.LINE_AA, 4)
        return image

    def _noise_tiles(self) -> list[NDArray[np.float32]]:
        generator = np.random.default_rng(self._look.seed)
        shape = self._background.shape
        return [
            (self._look.noise * generator.standard_normal(shape)).astype(np.float32)
            for _ in range(NOISE_TILES if self._look.noise > 0.0 else 0)
        ]

    def _with_noise(self, image: NDArray[np.float32]) -> GrayImage:
        """A few noise images in turn, shifted: fresh noise for each frame would cost more."""
        if self._noise:
            tile = self._noise[self._frame % len(self._noise)]
            image = image + np.roll(tile, 37 * (self._frame // len(self._noise)), axis=0)
            self._frame += 1
        result: GrayImage = cv2.convertScaleAbs(np.maximum(image, 0.0))
        return result
