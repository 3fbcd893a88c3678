"""Computes the directions in which the camera sees inner points of a transparent cone.

A cone has no plan view as a cylinder has: where the ray meets the outside is found by Newton's
method, on which its way on depends smoothly up to the silhouette.
"""

from __future__ import annotations

import numpy as np

from slosh_base.types import Array, BoolArray
from slosh_camera.optics.cone_kernel import EXACT, STEPS, find_entries
from slosh_camera.optics.refraction import GlassWall

_ARRIVED = 1e-9


def sight_through(
    wall: GlassWall, origin: Array, points: Array, rear: BoolArray | None = None
) -> Array:
    """Returns the directions of rays from outside that reach inner points of a cone.

    Args:
        wall: the cone.
        origin: (3,) camera's centre [m].
        points: (N, 3) on the inner wall [m].
        rear: (N,) whether a point is seen through the front wall and the air behind it; None:
            where it is not on the part of the front wall that the camera sees.

    Returns:
        (N, 3) directions with a horizontal part of length 1; NaN where no ray arrives.
    """
    straight = points - origin
    over, _ = wall.over_the_rim(np.broadcast_to(origin, points.shape), straight)
    directions = np.full(points.shape, np.nan)
    directions[over] = straight[over]
    near = ~over if rear is None else ~over & ~rear
    directions[near] = _solved(wall, origin, points[near], far=False)
    unseen = np.isnan(directions[:, 0])
    beyond = ~over & (unseen if rear is None else rear)
    directions[beyond] = _solved(wall, origin, points[beyond], far=True)
    flat: Array = directions / np.hypot(directions[:, 0], directions[:, 1])[:, np.newaxis]
    return flat


def grazing_half_angle(wall: GlassWall, origin: Array) -> float:
    """Returns half the visible arc of the front wall at z = 0 [rad]; NaN if the wall is too thick.

    The ray that touches the outside has its azimuth there; the level where it arrives is found
    by steps.
    """
    distance = float(np.hypot(origin[0], origin[1]))
    if not wall.bends:
        return float(np.arccos((wall.radius + wall.taper * origin[2]) / distance))
    azimuth = np.array([silhouette_half_angle(wall, origin)])
    viewer, level = np.array([distance, 0.0, origin[2]]), np.zeros(1)
    for _ in range(STEPS):
        place = _outside(wall, azimuth, level)
        arrives = wall.from_outside(place, _unit(place - viewer)).front
        level = level - arrives[:, 2]
        if not abs(arrives[0, 2]) > EXACT:
            break
    return float(np.arctan2(arrives[0, 1], arrives[0, 0]))


def silhouette_half_angle(wall: GlassWall, origin: Array) -> float:
    """Returns the angle about the axis from the camera to the outer wall's silhouette [rad].

    A plane through the camera touches a cone along a line of one azimuth, as it does a cylinder:
    that of a cylinder as wide as the cone at the camera's height. NaN: the camera sees none.
    """
    cosine = (wall.outer_radius + wall.taper * origin[2]) / np.hypot(origin[0], origin[1])
    return float(np.arccos(cosine)) if abs(cosine) < 1.0 else float("nan")


def _solved(wall: GlassWall, origin: Array, points: Array, *, far: bool) -> Array:
    """Returns ray directions (N, 3) to points of the front wall only or of the rear wall only."""
    outside = GlassWall(wall.outer_radius, taper=wall.taper)
    start = outside.trace(origin, points - origin).front
    unknown = np.column_stack((np.arctan2(start[:, 1], start[:, 0]), start[:, 2]))
    error = np.empty_like(unknown)
    find_entries(
        np.ascontiguousarray(origin, dtype=np.float64), np.ascontiguousarray(points), wall.radius,
        wall.outer_radius, wall.taper, wall.index if wall.bends else 1.0, far, unknown, error,
    )  # fmt: skip
    entry = _outside(wall, unknown[:, 0], unknown[:, 1])
    directions = entry - origin
    arrived = np.all(np.abs(error) < _ARRIVED, axis=1)
    arrived &= np.sum(directions * wall.outward(entry), axis=1) <= 1e-12
    directions[~arrived] = np.nan
    return directions


def _outside(wall: GlassWall, azimuth: Array, level: Array) -> Array:
    radius = wall.outer_radius + wall.taper * level
    return np.column_stack((radius * np.cos(azimuth), radius * np.sin(azimuth), level))


def _unit(rays: Array) -> Array:
    unit: Array = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return unit
