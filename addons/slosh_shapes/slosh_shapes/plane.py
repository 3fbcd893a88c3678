"""Computes the sloshing modes of prisms (vertical walls) by a plane Neumann problem.

φ = F(x, y) cosh k(z + h) / cosh kh with ΔF + k²F = 0 in the outline and ∂F/∂n = 0 on it, thus
ω² = gk tanh kh (Lamb 1932, § 257). An outline with an axis of symmetry has modes that an
acceleration along this axis drives, even across it, and modes that one across it drives, odd:
half of it is computed for each, of one with two axes a quarter. Any other outline is computed as
a whole (`directed`). Masses, heights and damping are those of `axisymmetric`, with the integrals
over z in closed form; for straight walls the bulk's damping is 2νk²/ω.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError
from slosh_model.shapes.contour import Piece, line
from slosh_model.shapes.mode_numbers import FILM, ModeNumbers
from slosh_shapes.directed import modes_without_symmetry
from slosh_shapes.finite_elements import (
    bases,
    library,
    limit,
    refined,
    scaled,
)
from slosh_shapes.mesh import Side
from slosh_shapes.plane_numbers import (
    ALONG,
    AROUND,
    DRIVEN,
    HEIGHT,
    NORM,
    OFFSET,
    SQUARE,
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
    axis_of_symmetry,
    mirrored,
    turned_piece,
    turned_points,
)
from slosh_shapes.tuning import TUNING

ALONG_AXIS, ACROSS_AXIS = "axis", "axis across"
"""Sides on the axis of symmetry, which is x, and on the one across it where there is one."""


def prism_modes(plane: Sequence[PlaneModes], depth: float) -> tuple[ModeNumbers, ...]:
    """Returns the first sloshing modes along x, then as many along y.

    Args:
        plane: those of the outline.
        depth: of the liquid [m].
    """
    return tuple(mode for family in plane for mode in _filled(family, depth / family.scale))


def plane_modes(outline: Sequence[Piece], count: int) -> tuple[PlaneModes, ...]:
    """Computes the sloshing modes of an outline along x and along y.

    Args:
        outline: closed, counter-clockwise, its centre in the origin [m].
        count: number of modes along each axis.

    Raises:
        SloshModelError: too intricate or too narrow, or scikit-fem is missing.
    """
    # Of a straight piece three places tell all.
    places = np.vstack(
        [piece.at(np.array([0.0, 0.5])) if piece.straight else piece.fine()[:-1:2]
         for piece in outline]
    )  # fmt: skip
    _check_width(places)
    scale = float(np.abs(places).max())
    turn = axis_of_symmetry(places)
    if turn is None:
        return modes_without_symmetry(
            [scaled(piece, np.zeros(2), scale) for piece in outline], scale, count
        )
    if turn != 0.0:
        outline = [turned_piece(piece, -turn) for piece in outline]
        places = turned_points(places, -turn)
    about_x, about_y = mirrored(places, 1), mirrored(places, 0)
    sides = _half(outline, not about_x, scale)
    if about_x and about_y:
        sides = _quarter(sides)
    found = []
    for axis in (0, 1):
        along = (axis == 1) == (not about_x)
        found.append(_family(sides, along, axis, scale, count, turn))
    return tuple(found)


def _check_width(places: Array) -> None:
    """Raises an error for an outline whose modes across it come after hundreds along it."""
    azimuths = np.linspace(0.0, math.pi, 180, endpoint=False)
    extents = np.ptp(places @ np.vstack((np.cos(azimuths), np.sin(azimuths))), axis=0)
    ratio = float(extents.max() / extents.min())
    if ratio > TUNING.most_slender:
        raise SloshModelError(
            f"container.outline is {ratio:.3g} times as long as wide, at most "
            f"{TUNING.most_slender:g} is computed; give a box as rectangle"
        )


def _half(outline: Sequence[Piece], turned: bool, scale: float) -> list[Side]:
    """Returns half of a symmetric outline, rotated so that its axis is x, and scaled.

    Where the axis is y, x and y change places, which reverses the direction.
    """
    pieces = [scaled(piece, np.zeros(2), scale) for piece in outline]
    if turned:
        pieces = [_swapped(piece.part(1.0, 0.0)) for piece in reversed(pieces)]
    parts: list[Piece] = []
    for piece in pieces:
        cuts = [0.0, *piece.shares_at(0.0, 1), 1.0]
        found = [piece.part(start, end) for start, end in itertools.pairwise(cuts)]
        parts += [part for part in found if _has_length(part)]
    above = [bool(part.one(0.5)[1] > 0.0) for part in parts]
    first = next(k for k in range(len(parts)) if above[k] and not above[k - 1])
    order = [(first + k) % len(parts) for k in range(len(parts))]
    wall = [Side(parts[k], "wall") for k in order if above[k]]
    right, left = wall[0].piece.one(0.0), wall[-1].piece.one(1.0)
    return [*wall, Side(line((float(left[0]), 0.0), (float(right[0]), 0.0)), ALONG_AXIS)]


def _quarter(half: Sequence[Side]) -> list[Side]:
    """Returns a quarter of a doubly symmetric outline: the right part of a half of it."""
    wall = []
    for side in half[:-1]:
        cuts = side.piece.shares_at(0.0, 0)
        if not cuts and side.piece.one(0.5)[0] < 0.0:
            break  # the side before it ends on the axis
        part = side.piece.part(0.0, cuts[0]) if cuts else side.piece
        if _has_length(part):
            wall.append(Side(part, "wall"))
        if cuts:
            break
    right, top = wall[0].piece.one(0.0), wall[-1].piece.one(1.0)
    across = line((0.0, float(top[1])), (0.0, 0.0))
    along = line((0.0, 0.0), (float(right[0]), 0.0))
    return [*wall, Side(across, ACROSS_AXIS), Side(along, ALONG_AXIS)]


def _has_length(part: Piece) -> bool:
    """Whether a part of a scaled outline is more than what rounding leaves of a corner.

    A corner on an axis of symmetry lies beside it by a rounded digit. The next side then begins
    on the axis instead.
    """
    return float(np.ptp(part.fine(), axis=0).max()) > TUNING.on_axis


def _swapped(piece: Piece) -> Piece:
    return replace(piece, at=lambda t: piece.at(t)[:, ::-1])


def _family(
    sides: list[Side], along: bool, axis: int, scale: float, count: int, turn: float
) -> PlaneModes:
    driven = DrivenModes(count, 4)
    numbers, more = refined(
        sides, outline_size(sides), lambda mesh: _solved(mesh, along, driven),
        change=TUNING.change, most=TUNING.most_divisions,
    )  # fmt: skip
    area, reach, crests = more
    return PlaneModes(
        axis, scale, limit(numbers), area, [reach] * count, crests, [turn] * count
    )  # fmt: skip


def _filled(plane: PlaneModes, depth: float) -> list[ModeNumbers]:
    axis, scale, rows, area, reaches, crests, turns = plane
    found = []
    for n, row in enumerate(rows.tolist()):
        k = math.sqrt(row[SQUARE])
        rate = k * math.tanh(k * depth)
        omega = math.sqrt(GRAVITY * rate / scale)
        layer, reach = _layer(k, depth, row) / scale, reaches[n]
        found.append(
            ModeNumbers(
                axis=axis,
                natural_frequency=omega,
                reach=abs(reach) * scale,
                mass_ratio=rate * row[OFFSET] ** 2 / (row[NORM] * area * depth),
                height_per_displacement=math.copysign(1.0, reach)
                * rate * row[OFFSET] * row[HEIGHT] / row[NORM],
                mass_height=-2.0 / k * math.tanh(0.5 * k * depth) * scale,
                crest_ratio=crests[n],
                crest_place=abs(reach) * scale,
                layer_damping=layer / math.sqrt(2.0 * omega),
                bulk_damping=2.0 * row[SQUARE] / (scale * scale * omega),
                turn=turns[n],
            )
        )  # fmt: skip
    return found


def _layer(k: float, depth: float, row: Sequence[float]) -> float:
    """Returns the relative dissipation in boundary layers: half the integral of |∇φ|²."""
    # cosh⁻² by exp(-x): a deep container must not overflow.
    decay = math.exp(-2.0 * k * depth)
    squared = 4.0 * decay / (1.0 + decay) ** 2
    wave = math.tanh(k * depth) / (2.0 * k)  # sinh 2kh / 4k, by cosh²
    along, across = wave + 0.5 * depth * squared, wave - 0.5 * depth * squared
    walls = along * row[ALONG] + k * k * across * row[AROUND]
    # Floor and surface film move as ∇F does, and ∫|∇F|² = k²∫F².
    level = k * k * row[NORM] * (squared + FILM)
    return 0.5 * (walls + level) / (k * math.tanh(k * depth) * row[NORM])


def _solved(
    mesh: Any, along: bool, search: DrivenModes
) -> tuple[Array, tuple[float, float, list[float]]]:
    """Solves the eigenvalue problem on a mesh; returns mode constants, area and crest heights."""
    fem = library()
    inside, wall = bases(mesh, "wall")
    stiffness, mass = plane_matrices(inside)
    driven = 0 if along else 1  # the coordinate along which an acceleration drives
    offset = fem.LinearForm(lambda v, w: w.x[driven] * v).assemble(inside)
    spread = float(fem.Functional(lambda w: w.x[driven] ** 2).assemble(inside))
    # Odd modes vanish on the axis across which they are odd.
    still = mesh.boundaries.get(ACROSS_AXIS if along else ALONG_AXIS, np.array([], dtype=int))
    free = inside.complement_dofs(inside.get_dofs(still))
    modes = _driven(stiffness[free][:, free], mass[free][:, free], offset[free], spread, search)
    on_wall = wall.get_dofs(mesh.boundaries["wall"]).flatten()
    rows, crests, place = [], [], -1
    for value, own in modes:
        f = np.zeros(stiffness.shape[0])
        f[free] = own
        if place < 0:
            # On both ends alike: that at +x.
            best = np.abs(f[on_wall]) + 1e-6 * np.sign(mesh.doflocs[driven, on_wall])
            place = int(on_wall[np.argmax(best)])
        f /= f[place]
        rows.append((value, float(f @ (mass @ f)), float(offset @ f), 1.0, *along_wall(wall, f)))
        crests.append(float(np.abs(f).max() / np.abs(f[on_wall]).max()))
    extent = float(np.abs(mesh.doflocs[driven, on_wall]).max())
    reach = math.copysign(extent, float(mesh.doflocs[driven, place]))
    return np.array(rows), (area_of(inside), reach, crests)


def _driven(
    stiffness: Any, mass: Any, offset: Array, spread: float, search: DrivenModes
) -> list[tuple[float, Array]]:
    """Returns the lowest modes that an acceleration excites, scaled to ∫F² = 1."""

    def families(values: Array, vectors: Array) -> Families:
        values, vectors, shares = _merged(values, vectors, offset @ vectors, spread)
        chosen = np.flatnonzero((shares > DRIVEN) & (values > 1e-6))
        return [[(float(values[n]), vectors[:, n]) for n in chosen]]

    (found,) = search.lowest(stiffness, mass, families)
    return found


def _merged(
    values: Array, vectors: Array, offsets: Array, spread: float
) -> tuple[Array, Array, Array]:
    """Merges modes of equal frequency into the combination that an acceleration excites.

    Returns:
        eigenvalues, vectors as columns, and the share of each in a straight surface.
    """
    groups = of_one_frequency(values)
    squares = [offsets[group] ** 2 for group in groups]
    sums = np.array([square.sum() for square in squares])
    weights = [
        offsets[group] / max(np.sqrt(total), 1e-300)
        for group, total in zip(groups, sums, strict=True)
    ]
    merged = np.array([(values[g] * w * w).sum() for g, w in zip(groups, weights, strict=True)])
    columns = np.column_stack([vectors[:, g] @ w for g, w in zip(groups, weights, strict=True)])
    return merged, columns, sums / spread
