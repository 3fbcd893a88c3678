"""Computes the sloshing modes of prisms (vertical walls) by a plane Neumann problem.

φ = F(x, y) cosh k(z + h) / cosh kh with ΔF + k²F = 0 in the outline and ∂F/∂n = 0 on it, thus
ω² = gk tanh kh (Lamb 1932, § 257). An outline with an axis of symmetry has modes that an
acceleration along this axis drives, even across it, and modes that one across it drives, odd:
half of it is computed for each, of one with two axes a quarter. Masses, heights and damping are
those of `axisymmetric`, with the integrals over z in closed form; for straight walls the bulk's
damping is 2νk²/ω.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError
from slosh_model.potential_flow.finite_elements import (
    bases,
    library,
    limit,
    lowest,
    refined,
    scaled,
)
from slosh_model.potential_flow.mesh import Side, Size, graded
from slosh_model.potential_flow.sizes import bending, sharp_corners
from slosh_model.potential_flow.tuning import TUNING
from slosh_model.shapes.contour import Piece, line
from slosh_model.shapes.mode_numbers import ModeNumbers

ALONG_AXIS, ACROSS_AXIS = "axis", "axis across"
"""Sides on the axis of symmetry, which is x, and on the one across it where there is one."""
SQUARE, NORM, OFFSET, HEIGHT, ALONG, AROUND = range(6)
"""Of a mode: k², ∫F² and ∫xF over what is computed, F where heights are given, ∮F_s², ∮F²."""
_DRIVEN = 1e-6
"""Share of a mode in a straight surface below which no acceleration drives it."""
_SAME = 2e-3
"""Relative difference of k² below which two modes count as of one frequency."""
_MOST_SEARCHED = 200


class PlaneModes(NamedTuple):
    """The sloshing modes along one axis of an outline, for any depth, in scaled lengths.

    Attributes:
        axis: 0 along x, 1 along y.
        scale: the unit of length [m].
        rows: a row of numbers for each mode.
        area: of the outline.
        reach: where heights are given.
        crests: the largest height of each over that at the wall.
    """

    axis: int
    scale: float
    rows: Array
    area: float
    reach: float
    crests: list[float]


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
        outline: closed, counter-clockwise, its centre in the origin, symmetric about an axis [m].
        count: number of modes along each axis.

    Raises:
        SloshModelError: no axis of symmetry, too intricate, or scikit-fem is missing.
    """
    # Of a straight piece three places tell all.
    places = np.vstack(
        [piece.at(np.array([0.0, 0.5])) if piece.straight else piece.fine()[:-1:2]
         for piece in outline]
    )  # fmt: skip
    about_x, about_y = _mirrored(places, 1), _mirrored(places, 0)
    if not about_x and not about_y:
        raise SloshModelError(_asymmetry(places), ("container", "outline"))
    scale = float(np.abs(places).max())
    sides = _half(outline, not about_x, scale)
    if about_x and about_y:
        sides = _quarter(sides)
    found = []
    for axis in (0, 1):
        along = (axis == 1) == (not about_x)
        found.append(_family(sides, along, axis, scale, count))
    return tuple(found)


def _mirrored(places: Array, axis: int) -> bool:
    """Returns whether an outline is symmetric in one coordinate."""
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


def _asymmetry(places: Array) -> str:
    """Returns why an outline has no symmetry about x or y, and which turn gives it one."""
    # An axis of symmetry passes through a corner or the middle of a side.
    middles = 0.5 * (places + np.roll(places, -1, axis=0))
    turns = []
    for x, y in np.vstack((places, middles)):
        c, s = np.array((x, y)) / max(math.hypot(x, y), 1e-300)
        if _mirrored(places @ np.array([[c, -s], [s, c]]), 1):
            # To the nearer one of x and y.
            turns.append(-math.remainder(math.degrees(math.atan2(y, x)), 90.0))
    if turns:
        return (
            "outline is symmetric neither about x nor about y through its centre; turned by "
            f"{min(turns, key=abs):.4g} deg it is: turn its points, and the container's frame back"
        )
    return (
        "outline has no axis of symmetry: its modes are not along two directions at right angles, "
        "which the models need; take a symmetric outline close to it"
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
        for start, end in itertools.pairwise(cuts):
            if end - start > 1e-9:
                parts.append(piece.part(start, end))
    above = [bool(part.one(0.5)[1] > 0.0) for part in parts]
    first = next(k for k in range(len(parts)) if above[k] and not above[k - 1])
    order = [(first + k) % len(parts) for k in range(len(parts))]
    wall = [Side(parts[k], "wall") for k in order if above[k]]
    right, left = wall[0].piece.one(0.0), wall[-1].piece.one(1.0)
    return [*wall, Side(line((float(left[0]), 0.0), (float(right[0]), 0.0)), ALONG_AXIS)]


def _quarter(half: Sequence[Side]) -> list[Side]:
    """Returns the quarter of an outline to the right of the half's middle."""
    wall = []
    for side in half[:-1]:
        cuts = side.piece.shares_at(0.0, 0)
        wall.append(Side(side.piece.part(0.0, cuts[0]), "wall") if cuts else side)
        if cuts:
            break
    right, top = wall[0].piece.one(0.0), wall[-1].piece.one(1.0)
    across = line((0.0, float(top[1])), (0.0, 0.0))
    along = line((0.0, 0.0), (float(right[0]), 0.0))
    return [*wall, Side(across, ACROSS_AXIS), Side(along, ALONG_AXIS)]


def _swapped(piece: Piece) -> Piece:
    return replace(piece, at=lambda t: piece.at(t)[:, ::-1])


def _family(sides: list[Side], along: bool, axis: int, scale: float, count: int) -> PlaneModes:
    numbers, more = refined(
        sides, _size(sides), lambda mesh: _solved(mesh, along, count),
        change=TUNING.change, most=TUNING.most_divisions,
    )  # fmt: skip
    return PlaneModes(axis, scale, limit(numbers), *more)


def _filled(plane: PlaneModes, depth: float) -> list[ModeNumbers]:
    axis, scale, rows, area, reach, crests = plane
    found = []
    for n, row in enumerate(rows.tolist()):
        k = math.sqrt(row[SQUARE])
        rate = k * math.tanh(k * depth)
        omega = math.sqrt(GRAVITY * rate / scale)
        layer = _layer(k, depth, row) / scale
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
    level = k * k * row[NORM] * (squared + TUNING.film)
    return 0.5 * (walls + level) / (k * math.tanh(k * depth) * row[NORM])


def _size(sides: Sequence[Side]) -> Size:
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
    for place, share in sharp_corners(sides):
        places.append(place[None])
        sizes.append(np.array([share * base]))
    if not places:
        return lambda at: np.full(len(at), base)
    size = graded(np.vstack(places), np.concatenate(sizes))
    return lambda at: np.minimum(size(at), base)


def _solved(mesh: Any, along: bool, count: int) -> tuple[Array, tuple[float, float, list[float]]]:
    """Solves the eigenvalue problem on a mesh; returns mode constants, area and crests."""
    fem = library()
    inside, wall = bases(mesh, "wall")
    stiffness = fem.BilinearForm(
        lambda u, v, w: u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1]
    ).assemble(inside)
    mass = fem.BilinearForm(lambda u, v, w: u * v).assemble(inside)
    driven = 0 if along else 1  # the coordinate along which an acceleration drives
    offset = fem.LinearForm(lambda v, w: w.x[driven] * v).assemble(inside)
    area = float(fem.Functional(lambda w: 1.0 + 0.0 * w.x[0]).assemble(inside))
    spread = float(fem.Functional(lambda w: w.x[driven] ** 2).assemble(inside))
    # Odd modes vanish on the axis across which they are odd.
    still = mesh.boundaries.get(ACROSS_AXIS if along else ALONG_AXIS, np.array([], dtype=int))
    free = inside.complement_dofs(inside.get_dofs(still))
    values, vectors = _driven(
        stiffness[free][:, free], mass[free][:, free], offset[free], spread, count
    )
    around = fem.Functional(lambda w: w["f"] ** 2)
    slope = fem.Functional(lambda w: (w.n[0] * w["f"].grad[1] - w.n[1] * w["f"].grad[0]) ** 2)
    on_wall = wall.get_dofs(mesh.boundaries["wall"]).flatten()
    rows, crests, place = [], [], -1
    for n in range(count):
        f = np.zeros(stiffness.shape[0])
        f[free] = vectors[:, n]
        if place < 0:
            # On both ends alike: that at +x.
            best = np.abs(f[on_wall]) + 1e-6 * np.sign(mesh.doflocs[driven, on_wall])
            place = int(on_wall[np.argmax(best)])
        f /= f[place]
        known = wall.interpolate(f)
        rows.append(
            (
                values[n], float(f @ (mass @ f)), float(offset @ f), 1.0,
                float(slope.assemble(wall, f=known)), float(around.assemble(wall, f=known)),
            )
        )  # fmt: skip
        crests.append(float(np.abs(f).max() / np.abs(f[on_wall]).max()))
    return np.array(rows), (area, float(mesh.doflocs[driven, place]), crests)


def _driven(
    stiffness: Any, mass: Any, offset: Array, spread: float, count: int
) -> tuple[Array, Array]:
    """Returns the lowest modes that an acceleration excites, with ∫F² = 1."""
    most = min(_MOST_SEARCHED, stiffness.shape[0] - 2)
    wanted = min(4 * count, most)
    while True:
        values, vectors = lowest(stiffness, mass, wanted, below=-1.0)
        vectors = vectors / np.sqrt((vectors * (mass @ vectors)).sum(axis=0))
        values, vectors, shares = _merged(values, vectors, offset @ vectors, spread)
        chosen = np.flatnonzero((shares > _DRIVEN) & (values > 1e-6))
        if len(chosen) >= count:
            return values[chosen[:count]], vectors[:, chosen[:count]]
        if wanted == most:
            raise SloshModelError(
                f"modes: only {len(chosen)} of the first {wanted} of this outline are driven by "
                "an acceleration along an axis; ask for fewer modes",
                ("modes",),
            )
        wanted = min(2 * wanted, most)


def _merged(
    values: Array, vectors: Array, offsets: Array, spread: float
) -> tuple[Array, Array, Array]:
    """Merges modes of equal frequency into the combination that an acceleration excites.

    Returns:
        eigenvalues, vectors as columns, and the share of each in a straight surface.
    """
    groups = np.split(
        np.arange(len(values)),
        np.flatnonzero(np.diff(values) > _SAME * np.maximum(values[1:], 1e-3)) + 1,
    )
    squares = [offsets[group] ** 2 for group in groups]
    sums = np.array([square.sum() for square in squares])
    weights = [
        offsets[group] / max(np.sqrt(total), 1e-300)
        for group, total in zip(groups, sums, strict=True)
    ]
    merged = np.array([(values[g] * w * w).sum() for g, w in zip(groups, weights, strict=True)])
    columns = np.column_stack([vectors[:, g] @ w for g, w in zip(groups, weights, strict=True)])
    return merged, columns, sums / spread
