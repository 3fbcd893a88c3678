"""Mesh of the liquid surface over a container's cross-section, for three-dimensional views."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_model.containers import PRISMATIC, X_AXIS, Y_AXIS, Container

RINGS = 6
"""Rings of vertices from the axis to the wall."""
AROUND = 36
"""Vertices of a ring."""


@dataclass(frozen=True, eq=False, slots=True)
class SurfaceMesh:
    """Mesh whose vertices move with the heights at the wall, in the shape of the first mode.

    Attributes:
        points: (M, 2) places of the vertices in the container's frame [m]; the last AROUND of them
            are on the wall, in the order of their azimuth.
        shape_x, shape_y: (M,) height there for a height 1 at the wall's +x, or +y [1].
        triangles: (K, 3) vertices of each triangle, counter-clockwise seen from above.
    """

    points: Array
    shape_x: Array
    shape_y: Array
    triangles: NDArray[np.int64]

    def heights(self, sh_x: float, sh_y: float) -> Array:
        """Returns the heights (M,) of the vertices above the still level [m].

        Args:
            sh_x, sh_y: sloshing height at the wall's +x and +y [m].
        """
        found: Array = sh_x * self.shape_x + sh_y * self.shape_y
        return found

    @property
    def wall(self) -> Array:
        """Positions (AROUND, 2) of the vertices on the wall [m]."""
        return self.points[-AROUND:]

    def on_wall(self, azimuth: float) -> Array:
        """Returns the position (2,) on the wall at an azimuth [rad] from +x [m]."""
        angles = np.arctan2(self.wall[:, 1], self.wall[:, 0])
        # Between two vertices the wall is straight.
        return np.array(
            [np.interp(azimuth, angles, column, period=2.0 * math.pi) for column in self.wall.T]
        )


def surface_mesh(container: Container) -> SurfaceMesh:
    """Creates the mesh of a container's liquid surface.

    Args:
        container: of any shape; where its waves' shape is not known, the surface is a plane.
    """
    wall = _wall(container)
    shares = np.arange(1, RINGS + 1) / RINGS
    rings = shares[:, np.newaxis, np.newaxis] * wall
    points = np.vstack([np.zeros((1, 2)), rings.reshape(-1, 2)])
    if container.follows_yaw:
        shapes = [_along(container, axis, points[:, axis]) for axis in (X_AXIS, Y_AXIS)]
    else:  # of round ones the wave is a function of the radius, times the azimuth's cosine
        distance = np.hypot(*points.T)
        radial = _along(container, X_AXIS, distance)
        direction = points / np.maximum(distance, 1e-12)[:, np.newaxis]
        shapes = [radial * column for column in direction.T]
    return SurfaceMesh(points, shapes[0], shapes[1], _triangles())


def _wall(container: Container) -> Array:
    """Returns AROUND positions (AROUND, 2) on the wall [m], by azimuth from just above -π rad."""
    azimuth = -math.pi + 2.0 * math.pi * (np.arange(AROUND) + 0.5) / AROUND
    direction = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    reaches = np.array(container.reaches)
    corners = container.corners
    if not len(corners) and not (container.cornered or container.section == PRISMATIC):
        round_wall: Array = direction * reaches
        return round_wall
    if not len(corners):
        corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    wall: Array = direction * _distances(np.asarray(corners) * reaches, direction)[:, np.newaxis]
    return wall


def _distances(corners: Array, direction: Array) -> Array:
    """Returns the distances (N,) from the axis to an outline along directions (N, 2) [m]."""
    begin, edge = corners, np.roll(corners, -1, axis=0) - corners
    # t d = b + s e, by Cramer's rule, for each direction d and each edge e from b.
    cross = direction[:, :1] * edge[:, 1] - direction[:, 1:] * edge[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (begin[:, 0] * edge[:, 1] - begin[:, 1] * edge[:, 0]) / cross
        s = (begin[:, 0] * direction[:, 1:] - begin[:, 1] * direction[:, :1]) / cross
    met = (t > 0.0) & (s >= -1e-9) & (s <= 1.0 + 1e-9)
    found: Array = np.where(met, t, math.inf).min(axis=1)
    return found


def _along(container: Container, axis: int, place: Array) -> Array:
    """Returns the first mode's height at positions along an axis [m], scaled to 1 at the wall."""
    where, shape = container.surface_shape(1, axis)
    shape = np.asarray(shape) / (shape[-1] or 1.0)
    found: Array = np.sign(place) * np.interp(np.abs(place), where, shape)
    return found


def _triangles() -> NDArray[np.int64]:
    """Returns the triangles (K, 3) of the mesh, as indices of their vertices."""
    here = np.arange(AROUND)
    beside = (here + 1) % AROUND
    rows = [np.column_stack([np.zeros_like(here), 1 + here, 1 + beside])]
    for ring in range(RINGS - 1):
        inner, outer = 1 + ring * AROUND, 1 + (ring + 1) * AROUND
        rows.append(np.column_stack([inner + here, outer + here, outer + beside]))
        rows.append(np.column_stack([inner + here, outer + beside, inner + beside]))
    return np.vstack(rows)
