"""Where the free surface's edges lie in the image, column by column.

The free surface is the first mode's (DL22, eq. (19)), taken over the whole cross-section: from the
side, a crest inside the cup hides the wall behind it. Straight rays, no refraction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_camera.geometry import CupView
from slosh_model.bessel import radial_shape

Array = NDArray[np.float64]

AZIMUTHS = 181
RINGS = 12


@dataclass(frozen=True, slots=True)
class SurfaceEdges:
    """Image rows of the free surface at each column; NaN where it does not reach [px].

    Attributes:
        front: (C,) line on the wall's half that faces the camera.
        top, bottom: (C,) highest and lowest row of the whole surface.
    """

    front: Array
    top: Array
    bottom: Array


class SurfaceLines:
    """Projects the free surface of a cup.

    Args:
        view: camera, pose and container.
        columns: (C,) image columns at which the edges are asked for.
    """

    def __init__(self, view: CupView, columns: Array) -> None:
        self._view = view
        self._columns = columns
        # Close rings near the wall, where the surface is steepest.
        relative = np.sqrt(np.linspace(0.0, 1.0, RINGS + 1)[1:])
        azimuth = np.concatenate([_half_circles(view, ratio) for ratio in relative])
        radius = np.repeat(relative * view.cup.radius, 2)[:, np.newaxis]
        self._x, self._y = radius * np.cos(azimuth), radius * np.sin(azimuth)
        shape = np.repeat(radial_shape(1, relative), 2)[:, np.newaxis]
        self._rise_x, self._rise_y = shape * np.cos(azimuth), shape * np.sin(azimuth)

    def edges(self, sh_x: float, sh_y: float) -> SurfaceEdges:
        """The edges for these wall heights at the container's +x and +y [m]."""
        lines = self._rows(self._x, self._y, sh_x * self._rise_x + sh_y * self._rise_y)
        # The last pair of lines is the wall: its front half, its rear half.
        return SurfaceEdges(lines[-2], np.fmin.reduce(lines), np.fmax.reduce(lines))

    def floor(self) -> Array:
        """Lower edge of the liquid, (C,); the floor looks narrower than the cup's sides."""
        level = np.full((1, AZIMUTHS), -self._view.cup.fill_height)
        (line,) = self._rows(self._x[-2:-1], self._y[-2:-1], level)
        known = np.isfinite(line)
        rows: Array = np.interp(self._columns, self._columns[known], line[known])
        return rows

    def _rows(self, x: Array, y: Array, z: Array) -> Array:
        """Rows (L, C) of L curves of points (L, P)."""
        pixels = self._view.project(np.column_stack((x.ravel(), y.ravel(), z.ravel())))
        u, v = pixels[:, 0].reshape(x.shape), pixels[:, 1].reshape(x.shape)
        order = np.argsort(u, axis=1)
        u, v = np.take_along_axis(u, order, axis=1), np.take_along_axis(v, order, axis=1)
        columns = self._columns
        return np.stack(
            [
                np.interp(columns, across, down, left=np.nan, right=np.nan)
                for across, down in zip(u, v, strict=True)
            ]
        )


def _half_circles(view: CupView, relative_radius: float) -> Array:
    """Azimuths (2, P) of the half of a ring that faces the camera, and of the other half.

    They part where the camera's rays touch the ring, so that each half has one row per column.
    """
    centre = view.pose.camera_centre
    half = np.arccos(relative_radius * view.cup.radius / np.hypot(centre[0], centre[1]))
    step = np.linspace(-1.0, 1.0, AZIMUTHS)
    front = view.camera_azimuth + half * step
    rear = view.camera_azimuth + np.pi + (np.pi - half) * step
    return np.stack((front, rear))
