"""Computes the modes of an outline without symmetry, each of which has a direction of its own.

An acceleration a drives a mode by a · ∫(x, y)F.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_model.shapes.contour import Piece
from slosh_shapes.finite_elements import bases, library, limit, refined
from slosh_shapes.mesh import Side
from slosh_shapes.plane_numbers import (
    DRIVEN,
    OFFSET,
    OFFSET_Y,
    DrivenModes,
    Families,
    PlaneModes,
    along_wall,
    area_of,
    of_one_frequency,
    plane_matrices,
)
from slosh_shapes.sizes import outline_size
from slosh_shapes.symmetry import (
    ISOTROPIC,
    QUARTER,
    anisotropy,
    second_moments,
    turned_piece,
    turned_points,
)
from slosh_shapes.tuning import TUNING


def modes_without_symmetry(
    outline: Sequence[Piece], scale: float, count: int
) -> tuple[PlaneModes, PlaneModes]:
    """Computes the modes of an outline without an axis of symmetry.

    In the directions of its principal moments, so that a turned one has the same modes.

    Args:
        outline: scaled.
        scale: the unit of length [m].
        count: number of modes nearer to each of two directions at right angles.
    """
    places = np.vstack([piece.fine()[:-1] for piece in outline])
    moments = second_moments(places)
    frame = 0.5 * math.atan2(2.0 * moments[0, 1], moments[0, 0] - moments[1, 1])
    if anisotropy(moments) < ISOTROPIC:  # the furthest place, where no direction differs
        frame = math.atan2(*places[np.argmax(np.hypot(*places.T))][::-1])
    sides = [Side(turned_piece(piece, -frame), "wall") for piece in outline]
    size = outline_size(sides)
    driven = DrivenModes(count, 6)
    numbers, (area, crests) = refined(
        sides, lambda at: TUNING.whole * size(at), lambda mesh: _solved_whole(mesh, driven),
        change=TUNING.change, most=TUNING.most_divisions,
    )  # fmt: skip
    rows, places = limit(numbers), turned_points(places, -frame)
    nearest = math.remainder(frame, QUARTER)
    swapped = round((frame - nearest) / QUARTER) % 2  # the first direction is nearer to y
    found = []
    for axis in (0, 1):
        first = axis ^ swapped
        own = rows[first::2].copy()
        directions = [math.atan2(row[OFFSET_Y], row[OFFSET]) for row in own.tolist()]
        reaches = [
            float(np.abs(places @ np.array([math.cos(one), math.sin(one)])).max())
            for one in directions
        ]
        own[:, OFFSET] = np.hypot(own[:, OFFSET], own[:, OFFSET_Y])
        turns = [math.remainder(one + frame - axis * QUARTER, math.pi) for one in directions]
        found.append(PlaneModes(axis, scale, own, area, reaches, crests[first::2], turns))
    return found[0], found[1]


def _solved_whole(mesh: Any, search: DrivenModes) -> tuple[Array, tuple[float, list[float]]]:
    """Solves the eigenvalue problem on a mesh of a whole outline.

    Returns:
        rows of mode constants, those nearer to x and to y by turns; area and crests.
    """
    fem = library()
    inside, wall = bases(mesh, "wall")
    stiffness, mass = plane_matrices(inside)
    offsets = np.array(
        [fem.LinearForm(lambda v, w, one=one: w.x[one] * v).assemble(inside) for one in (0, 1)]
    )
    spread = np.array(
        [fem.Functional(lambda w, one=one: w.x[one] ** 2).assemble(inside) for one in (0, 1)]
    )
    on_wall = wall.get_dofs(mesh.boundaries["wall"]).flatten()
    rows, crests = [], []
    for value, f in _directed(stiffness, mass, offsets, spread, search):
        f = f / f[on_wall[np.argmax(np.abs(f[on_wall]))]]
        x, y = (offsets @ f).tolist()
        rows.append((value, float(f @ (mass @ f)), x, 1.0, *along_wall(wall, f), y))
        crests.append(float(np.abs(f).max()))
    return np.array(rows), (area_of(inside), crests)


def _directed(
    stiffness: Any, mass: Any, offsets: Array, spread: Array, search: DrivenModes
) -> list[tuple[float, Array]]:
    """Returns k² and shape F of the lowest driven modes, alternately nearer to x and to y."""

    def families(values: Array, vectors: Array) -> Families:
        found: Families = ([], [])
        for group in of_one_frequency(values):
            for mixed in _mixes(offsets @ vectors[:, group]):
                f = vectors[:, group] @ mixed
                pushed = np.abs(offsets @ f)
                if values[group[0]] > 1e-6 and (pushed**2 / spread).max() > DRIVEN:
                    value = float((values[group] * mixed * mixed).sum())
                    found[int(pushed[1] > pushed[0])].append((value, f))
        return found

    pairs = zip(*search.lowest(stiffness, mass, families), strict=True)
    return [mode for pair in pairs for mode in pair]


def _mixes(pushed: Array) -> list[Array]:
    """Combines modes of equal frequency to at most two that are driven at right angles.

    Args:
        pushed: (2, N) ∫xF and ∫yF of each.
    """
    if pushed.shape[1] == 1:
        return [np.ones(1)]
    left, sizes, right = np.linalg.svd(pushed, full_matrices=False)
    if sizes[1] > (1.0 - ISOTROPIC) * sizes[0]:  # any two will do: those along x and y
        right = left @ right
    return list(right[:2])
