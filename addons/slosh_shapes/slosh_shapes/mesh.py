"""Triangulates a plane region with a smooth boundary, and refines it at the boundary.

The points of the edge are as far apart as a size function says, and points inside are added at
circumcentres of triangles that are too large for it (Delaunay refinement: Shewchuk, Comput. Geom.
22, 2002), then moved to the middle of their neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from slosh_base.types import Array, BoolArray, Integers
from slosh_model.errors import SloshModelError
from slosh_model.shapes.contour import Piece

Size = Callable[[Array], Array]
"""(N, 2) places to (N,) lengths that a triangle's side may have there [m]."""
_TOO_LARGE, _APART = 0.72, 0.62  # circumradius, and distance of points, per size
_FINE = 400
_MOST_POINTS = 20_000
"""Of a first mesh; a gap of a thousandth of a container's width asks for millions."""
_SPLITS = 8
"""Rounds in which parts of the edge that no triangle has are halved."""
_GRADING = 0.3
"""By how much the size may grow per length."""


@dataclass(frozen=True, slots=True)
class Side:
    """A curve on the boundary of a region, with a name.

    Attributes:
        piece: its course, with the region to the left.
        name: what it is, such as "wall".
    """

    piece: Piece
    name: str


@dataclass(frozen=True, slots=True)
class Triangles:
    """A triangular mesh, and the position of its edges on the boundary.

    Attributes:
        points: (N, 2) [m].
        corners: (M, 3) indices of points.
        edge: (E, 2) indices of the points at the ends of the edge's parts.
        side: (E,) index of the side of each part.
        shares: (E, 2) where its ends lie on the side.
    """

    points: Array
    corners: Integers
    edge: Integers
    side: Integers
    shares: Array


def graded(sources: Array, sizes: Array) -> Size:
    """Returns a mesh size function that grows slowly from given sizes at given points."""

    def size(places: Array) -> Array:
        found = np.full(len(places), np.inf)
        for first in range(0, len(sources), 256):
            part = slice(first, first + 256)
            away = np.hypot(
                places[:, None, 0] - sources[None, part, 0],
                places[:, None, 1] - sources[None, part, 1],
            )
            found = np.minimum(found, (sizes[None, part] + _GRADING * away).min(axis=1))
        return found

    return size


def triangulated(sides: Sequence[Side], size: Size) -> Triangles:
    """Triangulates the region inside boundary curves in counter-clockwise order.

    Raises:
        SloshModelError: the region is too intricate.
    """
    for shrink in (1.0, 0.7, 0.5, 0.35, 0.25):
        found = _attempt(sides, lambda places, s=shrink: s * size(places))  # type: ignore[misc]
        if found is not None:
            return found
    raise _too_narrow()


def _too_narrow() -> SloshModelError:
    return SloshModelError(
        "the contour has parts too narrow to compute; leave out details below 1 % of its width"
    )


def _attempt(sides: Sequence[Side], size: Size) -> Triangles | None:
    found, fine = _edge(sides, size), size
    for _ in range(_SPLITS):
        mesh, missing = _joined(found, fine)
        if not missing.any():
            return mesh
        # Where another part of the edge is nearer than its ends, a part needs more points.
        found, fine = _split(sides, found, missing, fine)
    return None


def _joined(found: tuple[Array, Integers, Array], size: Size) -> tuple[Triangles, BoolArray]:
    """Returns a triangulation, and a mask of boundary parts that are no triangle's side."""
    edge_points, side, shares = found
    count = len(edge_points)
    points = _filled(edge_points, size)
    corners = _inside(points, edge_points)
    for _ in range(3):
        points = _smoothed(points, corners, count)
        corners = _inside(points, edge_points)
    edge = np.column_stack([np.arange(count), (np.arange(count) + 1) % count])
    present = {tuple(pair) for pair in np.sort(_all_edges(corners), axis=1).tolist()}
    missing = [tuple(pair) not in present for pair in np.sort(edge, axis=1).tolist()]
    return Triangles(points, corners, edge, side, shares), np.array(missing)


def _split(
    sides: Sequence[Side], found: tuple[Array, Integers, Array], halved: BoolArray, size: Size
) -> tuple[tuple[Array, Integers, Array], Size]:
    """Halves the selected parts of the boundary, and limits the triangles' size there."""
    points, side, shares = found
    middle = shares.mean(axis=1)
    between = on_sides(sides, side[halved], middle[halved])
    first = np.flatnonzero(halved)
    lengths = np.hypot(*(between - points[first]).T)
    order = np.argsort(np.concatenate((np.arange(len(points)), first + 0.5)), kind="stable")
    kept = np.column_stack((shares[:, 0], np.where(halved, middle, shares[:, 1])))
    new = np.column_stack((middle[halved], shares[halved, 1]))
    near = graded(between, lengths)
    split = (
        np.vstack((points, between))[order], np.concatenate((side, side[halved]))[order],
        np.vstack((kept, new))[order],
    )  # fmt: skip
    return split, lambda places: np.minimum(size(places), near(places))


def _edge(sides: Sequence[Side], size: Size) -> tuple[Array, Integers, Array]:
    """Returns points along the boundary, with the curve and position of each part."""
    places, index, shares = [], [], []
    t = np.linspace(0.0, 1.0, _FINE)
    for number, side in enumerate(sides):
        at = side.piece.at(t)
        steps = np.hypot(*np.diff(at, axis=0).T)
        density = 1.0 / size(0.5 * (at[1:] + at[:-1]))
        along = np.concatenate([[0.0], np.cumsum(steps * density)])
        parts = max(int(np.ceil(along[-1])), 2)
        cuts = np.interp(np.linspace(0.0, along[-1], parts + 1), along, t)
        cuts[0], cuts[-1] = 0.0, 1.0
        places.append(side.piece.at(cuts[:-1]))
        index += [number] * parts
        shares.append(np.column_stack([cuts[:-1], cuts[1:]]))
    return np.vstack(places), np.array(index), np.vstack(shares)


def _filled(points: Array, size: Size) -> Array:
    edge = points
    for _ in range(40):
        if len(points) > _MOST_POINTS:
            raise _too_narrow()
        corners = _inside(points, edge)
        centres, radii = _circumcircles(points[corners])
        wanted = size(centres)
        chosen = np.flatnonzero(radii > _TOO_LARGE * wanted)
        if not len(chosen):
            break
        chosen = chosen[np.argsort(-radii[chosen] / wanted[chosen])]
        centres, wanted = centres[chosen], _APART * wanted[chosen]
        free = scipy.spatial.cKDTree(points).query(centres)[0] > wanted
        free &= _within(centres, edge)
        new = _spread(centres[free], wanted[free])
        if not len(new):
            break
        points = np.vstack([points, new])
    return points


def _spread(places: Array, apart: Array) -> Array:
    """Returns the points without those that are too close to an earlier point."""
    kept: list[int] = []
    for i in range(len(places)):
        away = np.hypot(*(places[kept] - places[i]).T)
        if not kept or bool((away > apart[i]).all()):
            kept.append(i)
    return places[kept]


def _circumcircles(triangles: Array) -> tuple[Array, Array]:
    """Returns centres (M, 2) and radii (M,) of the circumcircles of triangles (M, 3, 2)."""
    a, b, c = (triangles[:, k] for k in range(3))
    u, v = b - a, c - a
    double = 2.0 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    double = np.where(np.abs(double) < 1e-300, 1e-300, double)
    uu, vv = (u * u).sum(axis=1), (v * v).sum(axis=1)
    x = (v[:, 1] * uu - u[:, 1] * vv) / double
    y = (u[:, 0] * vv - v[:, 0] * uu) / double
    return a + np.column_stack([x, y]), np.hypot(x, y)


def _inside(points: Array, edge: Array) -> Integers:
    """Returns the corner indices (M, 3) of the Delaunay triangles inside the boundary."""
    found: Integers = np.asarray(scipy.spatial.Delaunay(points).simplices, dtype=np.int64)
    at = points[found]
    u, v = at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    flat = np.abs(area) < 1e-9 * ((u * u).sum(axis=1) + (v * v).sum(axis=1))
    found[area < 0.0] = found[area < 0.0][:, ::-1]
    kept: Integers = found[~flat & _within(at.mean(axis=1), edge)]
    return kept


def _within(places: Array, edge: Array) -> BoolArray:
    """Returns whether points lie inside a polygon."""
    a, b = edge, np.roll(edge, -1, axis=0)
    x, y = places[:, 0, None], places[:, 1, None]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = b[:, 1] - a[:, 1]
    slope = (b[:, 0] - a[:, 0]) / np.where(rise == 0.0, 1.0, rise)
    crossed = spans & (x < a[:, 0] + (y - a[:, 1]) * slope)
    return np.asarray(crossed.sum(axis=1) % 2 == 1)


def _smoothed(points: Array, corners: Integers, fixed: int) -> Array:
    """Moves every mesh point except the first ones to the mean of its neighbours."""
    ends = _all_edges(corners)
    total, count = np.zeros_like(points), np.zeros(len(points))
    for one, other in ((0, 1), (1, 0)):
        np.add.at(total, ends[:, one], points[ends[:, other]])
        np.add.at(count, ends[:, one], 1.0)
    moved = points.copy()
    free = np.arange(len(points)) >= fixed
    free &= count > 0
    moved[free] = total[free] / count[free, None]
    return moved


def _all_edges(corners: Integers) -> Integers:
    """Returns the triangles' edges (3 M, 2); each inner edge appears twice."""
    return np.vstack([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])


def divided(mesh: Triangles, sides: Sequence[Side]) -> Triangles:
    """Divides each triangle into four; new boundary points lie on the boundary curves."""
    pairs = np.sort(_all_edges(mesh.corners), axis=1)
    unique, inverse = np.unique(pairs, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    middles = mesh.points[unique].mean(axis=1)
    numbers = {tuple(pair): k for k, pair in enumerate(unique.tolist())}
    own = np.array([numbers[tuple(sorted(pair))] for pair in mesh.edge.tolist()])
    halves = mesh.shares.mean(axis=1)
    middles[own] = on_sides(sides, mesh.side, halves)
    count, triangles = len(mesh.points), len(mesh.corners)
    m01, m12, m20 = (count + inverse[k * triangles : (k + 1) * triangles] for k in range(3))
    a, b, c = mesh.corners.T
    corners = np.vstack(
        [np.column_stack(three) for three in
         ((a, m01, m20), (m01, b, m12), (m20, m12, c), (m01, m12, m20))]
    )  # fmt: skip
    between = count + own
    edge = np.vstack(
        [np.column_stack([mesh.edge[:, 0], between]), np.column_stack([between, mesh.edge[:, 1]])]
    )
    shares = np.vstack(
        [
            np.column_stack([mesh.shares[:, 0], halves]),
            np.column_stack([halves, mesh.shares[:, 1]]),
        ]
    )
    points = np.vstack([mesh.points, middles])
    return Triangles(points, corners, edge, np.tile(mesh.side, 2), shares)


def on_sides(sides: Sequence[Side], side: Integers, shares: Array) -> Array:
    """Returns the points on boundary curves for relative positions along them."""
    places = np.empty((len(shares), 2))
    for number, one in enumerate(sides):
        these = side == number
        if these.any():
            places[these] = one.piece.at(shares[these])
    return places
