"""Contours of containers: consecutive smooth curves in a plane.

A profile is the wall of a body of revolution, r to the right and z up, from the floor to the rim;
an outline is the wall of a prism as seen from above.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy

from slosh_base.types import Array, BoolArray
from slosh_model.errors import SloshModelError

Point = tuple[float, float]
Points = tuple[Point, ...]

MOST_POINTS = 2000
"""Of a profile or an outline."""
SIZES = (2e-3, 3.0)
"""Width and height of a container [m]: outside, the unit is probably not the metre."""
_FURTHEST = 1e4
"""Distance of points from the origin [m]: beyond, rounding spoils the centre."""
_MOST_STRAIGHT = 80
"""Points that straight lines connect; more are a curve's."""
_CORNER, _SMOOTH_CORNER = math.radians(20.0), math.radians(60.0)
"""A turn by more is a corner, of a line of points and of a smooth curve."""
_HALVINGS = 50
_FINE = 257  # places of a piece at which it is looked at


@dataclass(frozen=True, slots=True)
class Piece:
    """A smooth curve: one piece of a container's contour.

    Attributes:
        at: (N,) shares of the way along it, 0 … 1, to (N, 2) places [m].
        straight: whether it is a line.
    """

    at: Callable[[Array], Array]
    straight: bool = False

    def part(self, start: float, end: float) -> Piece:
        """Returns the curve's part between two relative positions; reversed if end < start."""
        return replace(self, at=lambda t: self.at(start + (end - start) * np.asarray(t)))

    def one(self, t: float) -> Array:
        """Returns the position (2,) at one relative position along the curve."""
        place: Array = self.at(np.array([t]))[0]
        return place

    def fine(self) -> Array:
        """Returns closely spaced positions (N, 2) along the curve."""
        return self.at(np.linspace(0.0, 1.0, _FINE))

    def shares_at(self, value: float, axis: int) -> list[float]:
        """Returns the relative positions at which a coordinate crosses a value, in order."""
        t = np.linspace(0.0, 1.0, _FINE)
        above = self.at(t)[:, axis] >= value
        found = []
        for i in np.flatnonzero(above[:-1] != above[1:]).tolist():
            low, high = float(t[i]), float(t[i + 1])
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                if (self.one(middle)[axis] >= value) == above[i]:
                    low = middle
                else:
                    high = middle
            found.append(high)
        return found


def line(start: Point, end: Point) -> Piece:
    """Creates a straight line between two points."""
    a, b = np.array(start), np.array(end)
    return Piece(lambda t: a + np.asarray(t)[:, None] * (b - a), straight=True)


def arc(centre: Point, radii: Point, start: float, end: float) -> Piece:
    """Creates an elliptic arc between two angles [rad], counter-clockwise from the right."""

    def at(t: Array) -> Array:
        angle = start + (end - start) * np.asarray(t)
        x = centre[0] + radii[0] * np.cos(angle)
        return np.column_stack([x, centre[1] + radii[1] * np.sin(angle)])

    return Piece(at)


def through(points: Sequence[Point], *, smooth: bool) -> tuple[Piece, ...]:
    """Creates curves through points, split at the corners.

    Args:
        points: two or more, no two in succession the same.
        smooth: whether a curve connects them (a cubic spline), not straight lines. So many that
            they are a curve's own points are taken as such between the corners.
    """
    if not smooth and len(points) <= _MOST_STRAIGHT:
        return tuple(line(a, b) for a, b in pairwise(points))
    places = np.array(points, dtype=np.float64)
    steps = np.diff(places, axis=0)
    turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    limit = _SMOOTH_CORNER if smooth else _CORNER
    corners = [0, *(np.flatnonzero(np.abs(turns) > limit) + 1).tolist(), len(places) - 1]
    return tuple(_curve(places[first : last + 1]) for first, last in pairwise(corners))


def _curve(places: Array) -> Piece:
    if len(places) == 2:
        return line(tuple(places[0].tolist()), tuple(places[1].tolist()))
    lengths = np.hypot(*np.diff(places, axis=0).T)
    s = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    spline = scipy.interpolate.CubicSpline(s, places)
    return Piece(lambda t: np.asarray(spline(np.asarray(t))))


def checked_points(points: object, key: str, least: int) -> Points:
    """Checks and returns the points of a contour [m].

    Raises:
        SloshModelError: no list of finite pairs, too few or too many different ones, a size that
            is no container's in metres, or a contour that crosses itself.
    """
    if not isinstance(points, (tuple, list)):
        raise SloshModelError(f"{key} must be a list of pairs [m], or the name of a .csv file")
    if not least <= len(points) <= MOST_POINTS:
        raise SloshModelError(f"{key} has {len(points)} points, must have {least} … {MOST_POINTS}")
    found: list[Point] = []
    for index, pair in enumerate(points):
        point = _pair(pair, f"{key}[{index}]")
        if not found or math.dist(found[-1], point) > 1e-9:  # not the same again
            found.append(point)
    if len(found) < least:
        raise SloshModelError(f"{key} has {len(found)} different points, must have {least}")
    _check_size(np.array(found), key)
    return tuple(found)


def _pair(pair: object, name: str) -> Point:
    if not isinstance(pair, (tuple, list)) or len(pair) != 2:
        raise SloshModelError(f"{name} = {pair!r:.60} must be a pair of numbers [m]")
    for value in pair:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise SloshModelError(f"{name} = {pair!r:.60} must be a pair of numbers [m]")
        if not math.isfinite(value):
            raise SloshModelError(f"{name} = {pair!r:.60} must be finite")
    return float(pair[0]), float(pair[1])


def _check_size(places: Array, key: str) -> None:
    extents = places.max(axis=0) - places.min(axis=0)
    size = float(extents.max())
    if not SIZES[0] <= size <= SIZES[1]:
        raise SloshModelError(
            f"{key} measures {size:g} m, must be {SIZES[0]:g} … {SIZES[1]:g} m: "
            f"{'divide millimetres by 1000' if size > SIZES[1] else 'give it in metres'}"
        )
    if float(np.abs(places).max()) > _FURTHEST:
        raise SloshModelError(
            f"{key} lies more than {_FURTHEST:g} m from its origin; give it from the container"
        )
    if not float(extents[0]):
        raise SloshModelError(f"{key} has no width: all points lie on one upright line")


def check_simple(pieces: Sequence[Piece], key: str, *, closed: bool) -> None:
    """Raises SloshModelError if a contour crosses itself; the text gives the position."""
    ends = (np.linspace(0.0, 1.0, 2 if piece.straight else 65) for piece in pieces)
    places = np.vstack([piece.at(t[:-1]) for piece, t in zip(pieces, ends, strict=True)])
    if not closed:
        places = np.vstack([places, pieces[-1].at(np.array([1.0]))])
        a, b = places[:-1], places[1:]
    else:
        a, b = places, np.roll(places, -1, axis=0)
    count = len(a)
    d = b - a
    # Segments i and j cross where the ends of each lie on both sides of the other.
    across = _cross(d[:, None], a[None] - a[:, None])
    beyond = _cross(d[:, None], b[None] - a[:, None])
    crossing = (across * beyond < 0.0) & ((across * beyond < 0.0).T)
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    crossing &= apart > 1
    if closed:
        crossing &= apart < count - 1
    # Not of the lines that begin or end at the point.
    after = np.subtract.outer(np.arange(count), np.arange(count))
    touching = _on_lines(a, d) & (apart > 0) & (after % count != 1 if closed else after != 1)
    for where, what in ((crossing, "crosses"), (touching, "touches")):
        found = np.argwhere(where)
        if len(found):
            x, y = a[found[0, 0]].tolist()
            raise SloshModelError(f"{key} {what} itself near ({x:.4g}, {y:.4g}) m")


def _on_lines(a: Array, d: Array) -> BoolArray:
    """Returns whether each of the points a (N, 2) lies on each segment from a to a + d, (N, N)."""
    away = a[:, None] - a[None]
    lengths = (d * d).sum(axis=1)
    share = np.clip((away * d[None]).sum(axis=2) / lengths, 0.0, 1.0)
    left = away - share[..., None] * d[None]
    near = 1e-6 * np.ptp(a, axis=0).max()
    return np.asarray((left * left).sum(axis=2) < near**2)


def _cross(one: Array, other: Array) -> Array:
    product: Array = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    return product


def wetted(profile: Sequence[Piece], level: float, key: str = "profile") -> tuple[Piece, ...]:
    """Returns the wetted part of a profile up to a level, from the axis or a core outwards.

    Args:
        profile: from the floor's centre, or a core's top, to the rim.
        level: height of the still surface, in the profile's z [m].
        key: how errors name the profile.

    Raises:
        SloshModelError: the contour is not closed at the floor, or ends below the level.
    """
    start = profile[0].one(0.0)
    wide = float(profile[0].at(np.linspace(0.0, 1.0, 9))[:, 0].max())
    inside = bool(start[1] < level)
    if inside and start[0] > 1e-6 * wide:
        raise SloshModelError(
            f"{key} starts at r = {start[0]:g} m below the liquid: the floor is open; begin at "
            "r = 0, or with a core above the liquid"
        )
    found: list[Piece] = []
    for piece in profile:
        cuts = piece.shares_at(level, 1)
        at = 0.0
        for cut in cuts:
            if inside:
                return (*found, piece.part(at, cut))
            inside, at = True, cut
        if inside:
            found.append(piece.part(at, 1.0) if at else piece)
            if piece.one(1.0)[1] >= level:
                return tuple(found)
    raise SloshModelError(f"fill_height reaches {level:g} m, above the end of the {key}")


def ends_at(pieces: Sequence[Piece]) -> tuple[Array, Array]:
    """Returns the start point and the end point, (2,) each, of a chain of curves."""
    return pieces[0].one(0.0), pieces[-1].one(1.0)
