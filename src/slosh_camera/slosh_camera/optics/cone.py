"""Directions in which points on the inside of a transparent cone are seen.

A cone has no plan view as a cylinder has: where the ray meets the outside is found by Newton's
method, on which its way on depends smoothly up to the silhouette.
"""

from __future__ import annotations

import numpy as np

from slosh_base.types import Array, BoolArray
from slosh_camera.optics.refraction import GlassWall

_STEPS, _HALVINGS = 30, 6
_DIFFERENCE = 1e-7
_ARRIVED, _EXACT = 1e-9, 1e-12


def sight_through(
    wall: GlassWall, origin: Array, points: Array, rear: BoolArray | None = None
) -> Array:
    """Returns the directions from outside to points on the inside of a cone.

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
    """Returns half the visible arc of the front wall at z = 0 [rad]; NaN: the wall is too thick.

    The ray that touches the outside has its azimuth there; the level where it arrives is found
    by steps.
    """
    distance = float(np.hypot(origin[0], origin[1]))
    if not wall.bends:
        return float(np.arccos((wall.radius + wall.taper * origin[2]) / distance))
    azimuth = np.array([silhouette_half_angle(wall, origin)])
    viewer, level = np.array([distance, 0.0, origin[2]]), np.zeros(1)
    for _ in range(_STEPS):
        place = _outside(wall, azimuth, level)
        arrives = wall.from_outside(place, _unit(place - viewer)).front
        level = level - arrives[:, 2]
        if not abs(arrives[0, 2]) > _EXACT:
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
    """Returns directions (N, 3) to points that are all on the front or all on the rear wall."""
    outside = GlassWall(wall.outer_radius, taper=wall.taper)
    start = outside.trace(origin, points - origin).front
    unknown = np.column_stack((np.arctan2(start[:, 1], start[:, 0]), start[:, 2]))
    error = _error(wall, origin, points, unknown, far)
    left = np.flatnonzero(np.abs(error).max(axis=1, initial=0.0) > _EXACT)
    for _ in range(_STEPS):
        if not left.size:
            break
        task = wall, origin, points[left]
        moved, found = _stepped(*task, unknown[left], error[left], far)
        better = np.abs(found).sum(axis=1) < np.abs(error[left]).sum(axis=1)
        unknown[left[better]], error[left[better]] = moved[better], found[better]
        # What no step brings nearer stays where it is, and has not arrived.
        left = left[better & (np.abs(found).max(axis=1) > _EXACT)]
    entry = _outside(wall, unknown[:, 0], unknown[:, 1])
    directions = entry - origin
    arrived = np.all(np.abs(error) < _ARRIVED, axis=1)
    arrived &= np.sum(directions * wall.outward(entry), axis=1) <= 1e-12
    directions[~arrived] = np.nan
    return directions


def _stepped(
    wall: GlassWall, origin: Array, points: Array, unknown: Array, error: Array, far: bool
) -> tuple[Array, Array]:
    """Returns the entry points (N, 2) after a step of Newton's method, and their errors (N, 2).

    A step that leaves the wall, or does not help, is halved.
    """
    slopes = np.empty((len(points), 2, 2))
    for k, step in enumerate(_DIFFERENCE * np.eye(2)):
        beside = _error(wall, origin, points, unknown - step, far)
        slopes[..., k] = (error - beside) / _DIFFERENCE
    change, share = _divided(slopes, error), np.ones((len(points), 1))
    for _ in range(_HALVINGS):
        tried = unknown - share * change
        found = _error(wall, origin, points, tried, far)
        worse = ~(np.abs(found).sum(axis=1) < np.abs(error).sum(axis=1))
        if not worse.any():
            break
        share[worse] *= 0.5
    return tried, found


def _error(wall: GlassWall, origin: Array, points: Array, unknown: Array, far: bool) -> Array:
    """Returns by how much rays miss their points (N, 2), along the circumference and upwards [m].

    The rays enter the wall at the azimuths and heights `unknown` (N, 2).
    """
    outside = _outside(wall, unknown[:, 0], unknown[:, 1])
    trace = wall.from_outside(outside, _unit(outside - origin))
    found = trace.rear if far else trace.front
    around = _wrapped(
        np.arctan2(found[:, 1], found[:, 0]) - np.arctan2(points[:, 1], points[:, 0])
    )
    return np.column_stack((wall.radius * around, found[:, 2] - points[:, 2]))


def _outside(wall: GlassWall, azimuth: Array, level: Array) -> Array:
    radius = wall.outer_radius + wall.taper * level
    return np.column_stack((radius * np.cos(azimuth), radius * np.sin(azimuth), level))


def _divided(slopes: Array, error: Array) -> Array:
    """Solves systems of two equations (N, 2, 2); NaN where one has no solution."""
    (a, b), (c, d) = np.moveaxis(slopes, 0, -1)
    first, second = error.T
    whole = (a * d - b * c)[:, np.newaxis]
    both = np.column_stack((d * first - b * second, a * second - c * first))
    with np.errstate(divide="ignore", invalid="ignore"):
        solution: Array = both / whole
    return solution


def _unit(rays: Array) -> Array:
    unit: Array = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return unit


def _wrapped(angle: Array) -> Array:
    wrapped: Array = np.arctan2(np.sin(angle), np.cos(angle))
    return wrapped
