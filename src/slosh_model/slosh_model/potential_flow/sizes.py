"""Mesh sizes at bends and sharp corners of a boundary."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slosh_base.types import Array
from slosh_model.potential_flow.mesh import Side
from slosh_model.potential_flow.tuning import TUNING


def bending(at: Array) -> Array:
    """Returns radii of curvature (N,) along consecutive points (N, 2)."""
    first = np.gradient(at, axis=0)
    second = np.gradient(first, axis=0)
    bend = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    return np.asarray(np.hypot(*first.T) ** 3 / np.maximum(bend, 1e-12))


def sharp_corners(sides: Sequence[Side]) -> list[tuple[Array, float]]:
    """Returns corners at which the gradient is singular, with mesh sizes there.

    Returns:
        the place of each, and the size there relative to that beside it.
    """
    found = []
    for one, other in zip(sides, [*sides[1:], sides[0]], strict=True):
        if one.name.startswith("axis") or other.name.startswith("axis"):
            continue
        place = one.piece.one(1.0)
        back, ahead = one.piece.one(0.999) - place, other.piece.one(0.001) - place
        turn = math.atan2(float(ahead[0] * back[1] - ahead[1] * back[0]), float(ahead @ back))
        beyond = turn % math.tau - TUNING.sharp_corner
        # Where one side goes on nearly as the other ends there is hardly a corner.
        bent = min(abs(turn % math.tau - math.pi) / TUNING.clear_corner, 1.0)
        if beyond > 0.0:
            share = (TUNING.at_corner / 10.0 ** (beyond / TUNING.corner_decade)) ** bent
            if share < 1.0 - TUNING.at_corner:
                found.append((place, share))
    return found
