"""A smooth path through waypoints, parameterised by its length.

Between corners the path is a spline of the fifth degree through the waypoints, four times
continuously differentiable: acceleration and jerk along it are bounded. Points that come densely,
as in a recorded motion, are thinned as far as all of them stay within `KEPT` of the path. At a
corner, where the line from waypoint to waypoint turns by more than `TUNING.corner`, the container
stops: no curve through the corner is smooth, and one beside it would leave the waypoint.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from slosh_base.types import Array
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.joint_demands import JointDemands
from slosh_plan.planning.progress import StoppedError, never
from slosh_plan.tuning import TUNING

_FARTHEST = 1e6  # m, rad
MOST_POINTS = 200_000
KEPT = TUNING.kept
DEGREE = TUNING.degree


@dataclass(frozen=True)
class Leg:
    """A smooth part of a path, parameterised by its length s.

    Attributes:
        spline: (3,) position [m] over s [m].
        length: where s ends [m]; it begins at 0.
        demands: of the joints that carry the container; None: none is known.
    """

    spline: BSpline
    length: float
    demands: JointDemands | None = None

    @cached_property
    def derivatives(self) -> tuple[BSpline, ...]:
        """Splines of the position over s and of its first three derivatives."""
        return (self.spline, *(self.spline.derivative(n) for n in (1, 2, 3)))

    def at(self, s: Array, orders: int = 3) -> tuple[Array, ...]:
        """Returns position [m] and its first three derivatives at path lengths s, (N, 3) each."""
        inside = np.clip(s, 0.0, self.length)
        return tuple(np.asarray(spline(inside)) for spline in self.derivatives[: orders + 1])

    def lean(self) -> tuple[float, float]:
        """Gravity's component along the container's floor, at rest at the leg's start [m/s²]."""
        return 0.0, 0.0

    def joint_slowness(self, s: Array) -> Array:
        """Returns the time by length that the joints' limits ask, (N,); zeros without joints."""
        return np.zeros(len(s))

    def columns(self, s: Array) -> Array:
        """Returns d/ds, d²/ds² and d³/ds³ of the position along the leg, for interpolation."""
        return np.column_stack(self.at(s)[1:])


@dataclass(frozen=True)
class Path:
    """A path: consecutive legs with a stop between them.

    Attributes:
        legs: at least one.
        reversals: (legs - 1) whether the next leg leads back along the tangent.
        departure: farthest that the path lies from straight lines between the waypoints [m], of
            joints [rad or m].
        tilts: whether the container tilts along it.
        given: place along each leg over the time that was given with its points, from rest to
            rest [s to m]; empty: no such times were given.
    """

    legs: tuple[Leg, ...]
    reversals: tuple[bool, ...]
    departure: float
    tilts: bool = False
    given: tuple[BSpline, ...] = ()

    @property
    def length(self) -> float:
        """Total length of all legs of the path [m]."""
        return sum(leg.length for leg in self.legs)


def path_through(
    points: Array, stopped: Callable[[], bool] = never, times: Array | None = None
) -> Path:
    """Creates the smooth path through waypoints of the container.

    >>> path = path_through(np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.2, 0.0]]))
    >>> len(path.legs), round(path.length, 3)  # the path stops at the corner
    (2, 0.5)

    Args:
        points: (N, 3) positions [m].
        stopped: whether somebody wants to end it.
        times: (N,) at which a motion passes them, rising [s]; None: they are not known.

    Raises:
        SloshPlanError: fewer than two different points, too many, one that is not finite, too
            many corners, or points that no smooth curve follows.
        StoppedError: it was stopped before its end.
    """
    path = smooth_path(points, "xyz", stopped, times)
    if path.length < TUNING.shortest_path:
        raise SloshPlanError(f"the path is {1e3 * path.length:g} mm long, less than 1 mm")
    return path


def smooth_path(
    points: Array,
    names: Sequence[str],
    stopped: Callable[[], bool] = never,
    times: Array | None = None,
) -> Path:
    """Creates smooth curves through points of any dimension, parameterised by length.

    Args:
        points: (N, D) [m], of turning joints [rad].
        names: (D,) of the columns.
        stopped: whether somebody wants to end it.
        times: (N,) at which a motion passes the points, rising [s]; None: they are not known.

    Raises:
        SloshPlanError: as `path_through`.
        StoppedError: it was stopped before its end.

    >>> path = smooth_path(np.array([[0.0, 0.0], [0.0, 1.2]]), ["joint_1", "joint_2"])
    >>> round(path.length, 3)  # rad
    1.2
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != len(names):
        raise SloshPlanError(
            f"waypoints have the shape {points.shape}, expected (N, {len(names)})"
        )
    if len(points) > MOST_POINTS:
        raise SloshPlanError(f"{len(points)} waypoints are more than {MOST_POINTS}: take fewer")
    bad = np.argwhere(~(np.abs(points) <= _FARTHEST))
    if len(bad):
        row, column = bad[0]
        raise SloshPlanError(
            f"waypoint {row} has {names[column]} = {points[row, column]}: it must be finite and "
            f"at most {_FARTHEST:g}"
        )
    rows = _distinct(points)
    distinct = points[rows]
    if len(distinct) < 2:
        raise SloshPlanError(f"the path has no length: its {len(points)} waypoints coincide")
    corners, reversals = _corners(distinct)
    if len(corners) > TUNING.most_corners:
        raise SloshPlanError(
            f"the path turns by more than {math.degrees(TUNING.corner):.0f}° at {len(corners)} "
            f"waypoints, where the container stops; at most {TUNING.most_corners} are planned: "
            "smooth the waypoints, or take fewer"
        )
    bounds = [0, *corners, len(distinct) - 1]
    parts = [distinct[a : b + 1] for a, b in pairwise(bounds)]
    tangents = _tangents(parts, reversals)
    found = [_leg(part, *ends, stopped) for part, ends in zip(parts, tangents, strict=True)]
    legs = tuple(leg for leg, _ in found)
    departure = max(_departure(leg, part) for leg, part in zip(legs, parts, strict=True))
    given: tuple[BSpline, ...] = ()
    if times is not None:
        moments = np.asarray(times, dtype=np.float64)[rows]
        each = [moments[a : b + 1] for a, b in pairwise(bounds)]
        given = _given(each, [places for _, places in found])
    return Path(legs, reversals, departure, given=given)


def _given(times: list[Array], places: list[Array]) -> tuple[BSpline, ...]:
    """Returns splines of the place over time, at rest at the ends of every leg.

    Returns:
        one for each leg; none where the given motion does not run forwards from rest to rest.
    """
    still: Any = [(1, 0.0), (2, 0.0)]
    ends: Any = (still, still)
    found = []
    for t, s in zip(times, places, strict=True):
        if not (np.isfinite(t).all() and (np.diff(t) > 0.0).all()):
            return ()
        at, count = t - t[0], TUNING.fewest_knots
        while True:
            rows = np.searchsorted(at, np.linspace(0.0, at[-1], count)[1:-1])
            rows = np.unique(np.concatenate([[0], rows, [len(at) - 1]]))
            law = make_interp_spline(at[rows], s[rows], k=DEGREE, bc_type=ends)
            if len(rows) == len(at) or np.abs(law(at) - s).max() <= 0.5 * KEPT:
                break
            count *= 2
        rate = law.derivative()(np.linspace(0.0, at[-1], TUNING.fine))
        if rate.min() < -TUNING.ended * s[-1] / at[-1]:
            return ()
        found.append(law)
    return tuple(found)


def _distinct(points: Array) -> list[int]:
    """Returns the rows of points that do not repeat the previous one, and that of the last."""
    kept = [0]
    for row in range(1, len(points)):
        if not _near(points[row], points[kept[-1]]):
            kept.append(row)
    if len(kept) > 1:
        kept[-1] = len(points) - 1 if _near(points[-1], points[kept[-1]]) else kept[-1]
    return kept


def _near(one: Array, other: Array) -> bool:
    return bool(np.linalg.norm(one - other) <= TUNING.same)


def _corners(points: Array) -> tuple[list[int], tuple[bool, ...]]:
    """Returns the indices of corner points, and which of them reverse the direction."""
    steps = np.diff(points, axis=0)
    directions = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    cosines = np.einsum("ij,ij->i", directions[:-1], directions[1:])
    turns = np.arccos(np.clip(cosines, -1.0, 1.0))
    rows = np.flatnonzero(turns > TUNING.corner)
    return [int(row) + 1 for row in rows], tuple(
        bool(turns[row] > TUNING.reversal) for row in rows
    )


Ends = tuple[Array | None, Array | None]


def _tangents(parts: list[Array], reversals: tuple[bool, ...]) -> list[Ends]:
    """Returns the tangents at the ends of the legs, or None where no tangent is prescribed."""
    first: list[Array | None] = [None] * len(parts)
    last: list[Array | None] = [None] * len(parts)
    for n, back in enumerate(reversals):
        if back:
            along = parts[n][-1] - parts[n][-2] - (parts[n + 1][1] - parts[n + 1][0])
            tangent = along / np.linalg.norm(along)
            last[n], first[n + 1] = tangent, -tangent
    return list(zip(first, last, strict=True))


def _leg(
    points: Array, first: Array | None, last: Array | None, stopped: Callable[[], bool]
) -> tuple[Leg, Array]:
    """Returns a spline through a leg's points, by its own length, and their places along it."""
    if stopped():
        raise StoppedError(
            "stopped before a safe motion was found, while the path through the waypoints was "
            "computed: take fewer waypoints"
        )
    chords = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    rough = _thinned(chords, points, first, last)
    # Once more, by the length of the curve itself.
    fine = np.linspace(0.0, chords[-1], max(TUNING.fine, 4 * len(points)))
    speed = np.linalg.norm(rough.derivative()(fine), axis=1)
    lengths = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))])
    at = np.interp(chords, fine, lengths)
    if len(points) < TUNING.fine:
        # A few waypoints alone would not hold the length between them.
        places = np.linspace(0.0, lengths[-1], TUNING.fine)
        dense = np.asarray(rough(np.interp(places, lengths, fine)))
        spline = _thinned(places, dense, first, last, tolerance=0.2 * KEPT)
    else:
        spline = _thinned(at, points, first, last)
    return Leg(spline, float(lengths[-1])), at


def _thinned(
    at: Array, points: Array, first: Array | None, last: Array | None, tolerance: float = KEPT
) -> BSpline:
    """Returns a spline through few points that approximates all points within a tolerance."""
    count = TUNING.fewest_knots
    while count < len(points):
        rows = np.searchsorted(at, np.linspace(0.0, at[-1], count)[1:-1])
        rows = np.unique(np.concatenate([[0], rows, [len(points) - 1]]))
        spline = _through(at[rows], points[rows], first, last)
        if np.linalg.norm(spline(at) - points, axis=1).max() <= 0.5 * tolerance:
            return spline
        count *= 2
    return _through(at, points, first, last)


def _through(at: Array, points: Array, first: Array | None, last: Array | None) -> BSpline:
    """Interpolates points by a quintic spline, or by a lower degree for few points."""
    if len(points) == 2:
        inside = at[0] + (at[1] - at[0]) * np.linspace(0.0, 1.0, DEGREE + 1)
        share = ((inside - at[0]) / (at[1] - at[0]))[:, None]
        at, points = inside, points[0] + share * (points[1] - points[0])
        first = last = None
    if len(points) <= DEGREE:
        # One polynomial, which a spline of a higher degree through more of its points repeats.
        coarse = make_interp_spline(at, points, k=len(points) - 1)
        inside = np.linspace(at[0], at[-1], DEGREE + 1)
        points, at = np.asarray(coarse(inside)), inside
    none = np.zeros(points.shape[1])
    conditions = (
        None if first is None else [(1, first), (3, none)],
        None if last is None else [(1, last), (3, none)],
    )
    found: BSpline = make_interp_spline(at, points, k=DEGREE, bc_type=_conditions(conditions))
    return found


def _conditions(ends: tuple[list[tuple[int, Array]] | None, ...]) -> Any:
    """Returns SciPy's spline end conditions; natural ones where no tangent is prescribed."""
    if all(end is None for end in ends):
        return None
    none = np.zeros_like(next(end for end in ends if end is not None)[0][1])
    free = [(3, none), (4, none)]
    return tuple(free if end is None else end for end in ends)


def _departure(leg: Leg, points: Array) -> float:
    """Returns the largest distance of a leg from the polyline of its points [m]."""
    curve = leg.at(np.linspace(0.0, leg.length, 1000))[0]
    if len(points) > 500:
        return float(KEPT)
    starts, steps = points[:-1], np.diff(points, axis=0)
    share = np.einsum("nij,ij->ni", curve[:, None] - starts, steps) / (steps**2).sum(axis=1)
    nearest = starts + np.clip(share, 0.0, 1.0)[..., None] * steps
    distance: float = np.linalg.norm(curve[:, None] - nearest, axis=2).min(axis=1).max()
    return float(distance)
