"""Axes of symmetry and second moments of outlines."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from slosh_base.types import Array
from slosh_model.shapes.contour import Piece
from slosh_shapes.tuning import TUNING

QUARTER = 0.5 * math.pi
ISOTROPIC = 1e-2
"""Relative difference below which two moments count as equal: every direction is alike."""
_MOST_TRIED = 400
"""Lines through the centre that are looked at as axes of symmetry."""


def axis_of_symmetry(places: Array) -> float | None:
    """Returns the angle from x or y to an outline's axis of symmetry, at most 45° [rad].

    0 if it is so without; None if it has no axis of symmetry.
    """
    if mirrored(places, 1) or mirrored(places, 0):
        return 0.0
    moments = second_moments(places)
    principal = 0.5 * math.atan2(2.0 * moments[0, 1], moments[0, 0] - moments[1, 1])
    tried = [principal]
    if abs(anisotropy(moments)) < ISOTROPIC:
        # An axis of symmetry passes through a corner or the middle of a side.
        middles = 0.5 * (places + np.roll(places, -1, axis=0))
        tried = [math.atan2(y, x) for x, y in np.vstack((places, middles)).tolist()][:_MOST_TRIED]
    # Once each, the smallest turn first.
    turns = {round(math.remainder(one, QUARTER), 9): one for one in tried}
    for _, azimuth in sorted(turns.items(), key=lambda one: abs(one[0])):
        turned = turned_points(places, -azimuth)
        if mirrored(turned, 1) or mirrored(turned, 0):
            return math.remainder(azimuth, QUARTER)
    return None


def second_moments(places: Array) -> Array:
    """Returns the second moments of area (2, 2) of a polygon about the origin."""
    a, b = places, np.roll(places, -1, axis=0)
    cross = (a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1])[:, None, None]
    ends = a + b
    products = (
        a[:, :, None] * a[:, None, :] + b[:, :, None] * b[:, None, :]
        + ends[:, :, None] * ends[:, None, :]
    )  # fmt: skip
    return np.asarray((cross * products).sum(axis=0) / 24.0)


def anisotropy(moments: Array) -> float:
    """Returns the relative difference of the principal second moments."""
    across = math.hypot(moments[0, 0] - moments[1, 1], 2.0 * moments[0, 1])
    return float(across / np.trace(moments))


def turned_points(places: Array, angle: float) -> Array:
    """Rotates points (N, 2) by an angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(places @ np.array([[c, s], [-s, c]]))


def turned_piece(piece: Piece, angle: float) -> Piece:
    """Returns a curve rotated about the origin by an angle [rad]."""
    return replace(piece, at=lambda t: turned_points(piece.at(t), angle))


def mirrored(places: Array, axis: int) -> bool:
    """Returns whether an outline is its own mirror image when one coordinate changes its sign."""
    other = places.copy()
    other[:, axis] *= -1.0
    away = np.full(len(other), np.inf)
    a, d = places, np.roll(places, -1, axis=0) - places
    for first in range(0, len(other), 256):
        p = other[first : first + 256, None] - a[None]
        share = np.clip((p * d).sum(axis=2) / np.maximum((d * d).sum(axis=1), 1e-300), 0.0, 1.0)
        gap = np.hypot(*np.moveaxis(p - share[..., None] * d, 2, 0))
        away[first : first + 256] = gap.min(axis=1)
    return bool(away.max() < TUNING.asymmetry * np.abs(places).max())
