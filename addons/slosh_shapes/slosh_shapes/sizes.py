"""Mesh sizes at bends and sharp corners of a boundary."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slosh_base.types import Array
from slosh_shapes.mesh import Side, Size, graded
from slosh_shapes.tuning import TUNING


def bending(at: Array) -> Array:
    """Returns radii of curvature (N,) along consecutive points (N, 2)."""
    first = np.gradient(at, axis=0)
    second = np.gradient(first, axis=0)
    bend = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    return np.asarray(np.hypot(*first.T) ** 3 / np.maximum(bend, 1e-12))


def sharp_corners(sides: Sequence[Side], *, mirrored: bool = False) -> list[tuple[Array, float]]:
    """Returns corners at which the potential's gradient is singular, with mesh sizes there.

    Args:
        sides: of the region.
        mirrored: whether the sides named axis are axes of symmetry, beyond which it goes on.

    Returns:
        the place of each, and the size there relative to that beside it.
    """
    found = []
    for one, other in zip(sides, [*sides[1:], sides[0]], strict=True):
        on_axis = one.name.startswith("axis") + other.name.startswith("axis")
        if on_axis == 2 or (on_axis and not mirrored):
            continue
        place = one.piece.one(1.0)
        back, ahead = one.piece.one(0.999) - place, other.piece.one(0.001) - place
        turn = math.atan2(float(ahead[0] * back[1] - ahead[1] * back[0]), float(ahead @ back))
        turn = (2.0 if on_axis else 1.0) * (turn % math.tau)
        beyond = turn % math.tau - TUNING.sharp_corner
        # Where one side goes on nearly as the other ends there is hardly a corner.
        bent = min(abs(turn % math.tau - math.pi) / TUNING.clear_corner, 1.0)
        if beyond > 0.0:
            share = (TUNING.at_corner / 10.0 ** (beyond / TUNING.corner_decade)) ** bent
            if share < 1.0 - TUNING.at_corner:
                found.append((place, share))
    return found


def outline_size(sides: Sequence[Side]) -> Size:
    """Returns a uniform mesh size function that is finer at bends and sharp corners."""
    t = np.linspace(0.0, 1.0, 65)
    edge = [side.piece.at(t) for side in sides]
    everything = np.vstack(edge)
    extent = everything.max(axis=0) - everything.min(axis=0)
    base = float(min(extent.max() / TUNING.outline_parts, extent.min() / TUNING.narrow_parts))
    # What asks for no less than the base tells nothing.
    places, sizes = [], []
    for side, at in zip(sides, edge, strict=True):
        if not side.piece.straight:
            bend = TUNING.bend * bending(at)
            places.append(at[bend < base])
            sizes.append(bend[bend < base])
    for place, share in sharp_corners(sides, mirrored=True):
        places.append(place[None])
        sizes.append(np.array([share * base]))
    if not places:
        return lambda at: np.full(len(at), base)
    size = graded(np.vstack(places), np.concatenate(sizes))
    return lambda at: np.minimum(size(at), base)
