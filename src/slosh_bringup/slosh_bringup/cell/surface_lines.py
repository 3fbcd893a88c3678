"""Where the free surface's edges lie in the image, column by column.

The free surface is the first mode's (DL22, eq. (19)), taken over the whole cross-section: from the
side, a crest inside the cup hides the wall behind it. Straight rays, no refraction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_camera.optics.cup import CupView
from slosh_model.bessel import radial_shape

Array = NDArray[np.float64]

CHORDS = 121
"""Horizontal rays from the camera that meet the cup."""
PLACES = 41
"""Points along each ray, so many that the crest between two of them is higher by < 0.05 px."""


@dataclass(frozen=True, slots=True)
class SurfaceEdges:
    """Image rows of the free surface at each column; NaN where it does not reach [px].

    Attributes:
        front: (C,) line on the wall's half that faces the camera.
        top: (C,) highest row of the whole surface: the front line, a crest inside, or the rear
            line.
    """

    front: Array
    top: Array


class SurfaceLines:
    """Projects the free surface of a cup.

    Args:
        view: camera, pose and container.
        columns: (C,) image columns at which the edges are asked for.
    """

    def __init__(self, view: CupView, columns: Array) -> None:
        self._view = view
        self._columns = columns
        self._x, self._y = _chord_points(view)
        radius = np.hypot(self._x, self._y)
        relative = np.minimum(radius / view.cup.radius, 1.0)
        # Smooth through the axis, where the shape is zero as well.
        slope = radial_shape(1, relative) / np.maximum(radius, 1e-9)
        self._rise_x, self._rise_y = slope * self._x, slope * self._y

    def edges(self, sh_x: float, sh_y: float) -> SurfaceEdges:
        """The edges for these wall heights at the container's +x and +y [m]."""
        lines = self._rows(self._x, self._y, sh_x * self._rise_x + sh_y * self._rise_y)
        return SurfaceEdges(lines[0], np.fmin.reduce(lines))

    def floor(self) -> Array:
        """Lower edge of the liquid, (C,); the floor looks narrower than the cup's sides."""
        level = np.full((1, CHORDS), -self._view.cup.fill_height)
        (line,) = self._rows(self._x[:1], self._y[:1], level)
        known = np.isfinite(line)
        rows: Array = np.interp(self._columns, self._columns[known], line[known])
        return rows

    def _rows(self, x: Array, y: Array, z: Array) -> Array:
        """Rows (L, C) of L curves of points (L, P)."""
        pixels = self._view.project(np.column_stack((x.ravel(), y.ravel(), z.ravel())))
        u, v = pixels[:, 0].reshape(x.shape), pixels[:, 1].reshape(x.shape)
        columns = self._columns
        return np.stack(
            [
                np.interp(columns, across, down, left=np.nan, right=np.nan)
                for across, down in zip(u, v, strict=True)
            ]
        )


def _chord_points(view: CupView) -> tuple[Array, Array]:
    """Points (PLACES, CHORDS) on horizontal rays through the cup, from its front to its rear wall.

    Each row runs from the cup's left edge in the image to its right edge, so that it has one image
    row at every column; the first is the front wall, the last the rear wall.
    """
    centre = view.pose.camera_centre
    distance = float(np.hypot(centre[0], centre[1]))
    # Even steps about the cup: close rays at its edges, where the wall turns away.
    aside = view.cup.radius * np.sin(np.linspace(np.pi / 2.0, -np.pi / 2.0, CHORDS))
    off_axis = np.arcsin(aside / distance)
    half = np.sqrt(np.maximum(view.cup.radius**2 - aside**2, 0.0))
    heading = view.camera_azimuth + np.pi + off_axis
    place = np.linspace(-1.0, 1.0, PLACES)[:, np.newaxis] * half
    # The ray's point nearest to the axis, then along the ray.
    x = place * np.cos(heading) - aside * np.sin(heading)
    y = place * np.sin(heading) + aside * np.cos(heading)
    return x, y
