"""Filters motions along their path, which is kept, or by axis, which bends the path."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline, make_interp_spline
from scipy.spatial import cKDTree

from slosh_base.types import Array
from slosh_model import Model
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.motion_profiles import quintic
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.path import Leg, Path, path_through
from slosh_plan.planning.time_law import STEP, Law, PlannedMotion, motion_along, whole_rows
from slosh_plan.planning.unit_laws import UnitLaw
from slosh_plan.shaping.filters import FILTERS, Damped, Filter
from slosh_plan.trajectory import Trajectory
from slosh_plan.tuning import TUNING

POLYNOMIAL = "polynomial"

TERMS = 6
_POINTS = 400
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(_POINTS)
_U: Array = 0.5 * (_NODES + 1.0)
_BACKWARDS = -1e-9


@dataclass(frozen=True, slots=True, eq=False)
class PathCourse:
    """A motion split into its geometric path and the time law of each leg.

    Attributes:
        path: the path.
        laws: of each leg.
        durations: of each leg [s].
        position: a cubic spline of time from 0 [s] to place [m], at rest at both ends.
    """

    path: Path
    laws: tuple[Law, ...]
    durations: tuple[float, ...]
    position: CubicSpline

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return sum(self.durations)

    def motion(self) -> PlannedMotion:
        """Returns the motion before filtering, sampled at 1 kHz."""
        return _along(self.path, list(self.laws), list(self.durations))


def course_of(trajectory: Trajectory) -> PathCourse:
    """Splits a motion into its geometric path and the time law of each leg.

    >>> from slosh_plan.shaping.filters import Damped, zero_vibration
    >>> t = np.linspace(0.0, 1.0, 1001)
    >>> move = Trajectory(t, np.outer(np.sin(2.0 * np.pi * t), [1.0, 0.0, 0.0]))  # m/s²
    >>> course = course_of(move)
    >>> round(shaped(course, zero_vibration(Damped(16.0, 0.01))).duration, 3)  # s
    1.197

    Args:
        trajectory: from rest to rest; without positions its accelerations are integrated.

    Raises:
        SloshPlanError: it does not end at rest, or does not move.
    """
    t = trajectory.t - trajectory.t[0]
    position = trajectory.position
    if position is None:
        position = _integrated(trajectory)
    spline = CubicSpline(t, position, bc_type="clamped")
    path = path_through(position)
    fine = np.linspace(0.0, t[-1], max(math.ceil(t[-1] / STEP), 50) + 1)
    speed = np.linalg.norm(spline(fine, 1), axis=1)
    middle = np.linalg.norm(spline(0.5 * (fine[1:] + fine[:-1]), 1), axis=1)
    steps = (fine[1] - fine[0]) / 6.0 * (speed[1:] + 4.0 * middle + speed[:-1])
    way = np.concatenate([[0.0], np.cumsum(steps)])
    factor = path.length / way[-1]
    ends = _ends(path, fine, factor * way, speed)
    along = CubicHermiteSpline(fine, factor * way, factor * speed)
    lengths = np.concatenate([[0.0], np.cumsum([leg.length for leg in path.legs])])
    laws = []
    for (start, stop), (low, high) in zip(pairwise(ends), pairwise(lengths), strict=True):
        size = [float(np.linalg.norm(spline(moment, 2))) for moment in (start, stop)]
        laws.append(_leg_law(along, start, stop, low, high, size))
    return PathCourse(path, tuple(laws), tuple(np.diff(ends).tolist()), spline)


def shaped(course: PathCourse, chosen: Filter) -> PlannedMotion:
    """Filters a motion along its path, each leg separately."""
    laws = [_filtered(law, chosen) for law in course.laws]
    return _along(course.path, laws, [time + chosen.length for time in course.durations])


def shaped_per_axis(course: PathCourse, chosen: Filter) -> PlannedMotion:
    """Filters x, y and z of a motion separately, which bends the path.

    >>> from slosh_plan.shaping.filters import Damped, zero_vibration
    >>> t = np.linspace(0.0, 1.0, 1001)
    >>> course = course_of(Trajectory(t, np.outer(np.sin(2.0 * np.pi * t), [1.0, 0.0, 0.0])))
    >>> motion = shaped_per_axis(course, zero_vibration(Damped(16.0, 0.01)))
    >>> deviation(course, motion) < 1e-6  # m; a straight path stays straight
    True
    """
    end = course.duration
    duration = whole_rows(end + chosen.length)
    t: Array = STEP * np.arange(round(duration / STEP) + 1, dtype=np.float64)

    def part(order: int) -> Callable[[Array], Array]:
        def values(moments: Array) -> Array:
            inside = np.clip(moments, 0.0, end)
            found = np.asarray(course.position(inside, order))
            if order:
                found[inside != moments] = 0.0
            return found

        return values

    speed = np.linalg.norm(chosen(part(1), t), axis=1)
    return PlannedMotion(t, chosen(part(0), t), chosen(part(2), t), np.asarray(speed))


def residual_free_motion(course: PathCourse, mode: Damped) -> PlannedMotion:
    """Returns a motion of equal path and duration whose time law leaves no residual wave.

    Raises:
        SloshPlanError: a leg is too short for it.
    """
    laws = [
        _on_leg(residual_free(mode, duration), leg, duration)
        for leg, duration in zip(course.path.legs, course.durations, strict=True)
    ]
    return _along(course.path, laws, list(course.durations))


def _on_leg(unit: Law, leg: Leg, duration: float) -> Law:
    """Scales a time law from 0 to 1 to the length and duration of a leg."""

    def law(t: Array) -> tuple[Array, Array, Array]:
        place, rate, change = unit(t / duration)
        length = leg.length
        return length * place, length / duration * rate, length / duration**2 * change

    return law


def filter_for(model: Model, name: str, acceleration: Array, yaw: float = 0.0) -> Filter:
    """Creates a filter for the first mode along every axis that the motion excites.

    Args:
        model: the model.
        name: of `FILTERS`.
        acceleration: (N, 3) of the motion [m/s²].
        yaw: of the container [rad].

    Raises:
        SloshPlanError: no such filter.

    >>> from slosh_model import read_model
    >>> model = read_model("cup/model.yaml")
    >>> round(filter_for(model, "zv", np.ones((9, 3))).length, 2)  # s
    0.15
    """
    if name not in FILTERS:
        raise SloshPlanError(f"filter {name!r:.40} is not one of {', '.join(FILTERS)}")
    first, *others = excited_modes(model, acceleration, yaw)
    made = FILTERS[name](first)
    for mode in others:
        made = made.then(FILTERS[name](mode))
    return made


def excited_modes(model: Model, acceleration: Array, yaw: float = 0.0) -> tuple[Damped, ...]:
    """Returns the first mode along each excited axis; a single mode if both axes are equal."""
    mode = model.mode_constants()[0]
    along, across = (mode.along(axis).natural_frequency for axis in (X_AXIS, Y_AXIS))
    if along == across:
        return (Damped(along, mode.damping_ratio),)
    x, y = acceleration[:, 0], acceleration[:, 1]
    c, s = math.cos(yaw), math.sin(yaw)
    sizes = [float(np.abs(one).max()) for one in (c * x + s * y, c * y - s * x)]
    pairs = zip((along, across), sizes, strict=True)
    kept = [frequency for frequency, size in pairs if size > TUNING.still * max(sizes)]
    return tuple(Damped(frequency, mode.damping_ratio) for frequency in kept or [along])


def deviation(course: PathCourse, motion: PlannedMotion) -> float:
    """Returns the largest distance of a motion from a path [m]."""
    farthest = np.full(len(motion.t), np.inf)
    for leg in course.path.legs:
        places = leg.at(
            np.linspace(0.0, leg.length, math.ceil(leg.length / TUNING.path_step) + 2)
        )[0]
        nearest = cKDTree(places).query(motion.position)[1]
        for start in (np.maximum(nearest - 1, 0), np.minimum(nearest, len(places) - 2)):
            distance = _from_segment(motion.position, places[start], places[start + 1])
            farthest = np.minimum(farthest, distance)
    return float(farthest.max())


def _from_segment(points: Array, starts: Array, stops: Array) -> Array:
    """Returns the distance (N,) of points from segments, (N, 3) each [m]."""
    steps = stops - starts
    share = np.einsum("ij,ij->i", points - starts, steps) / np.einsum("ij,ij->i", steps, steps)
    nearest = starts + np.clip(share, 0.0, 1.0)[:, None] * steps
    return np.asarray(np.linalg.norm(points - nearest, axis=1))


def _along(path: Path, laws: list[Law], durations: list[float]) -> PlannedMotion:
    """Creates a motion along a path; it ends at rest, lasting a whole number of samples."""
    total = sum(durations)
    return motion_along(path, laws, [*durations[:-1], durations[-1] + whole_rows(total) - total])


def _integrated(trajectory: Trajectory) -> Array:
    """Integrates piecewise linear accelerations to positions, starting at rest."""
    a, steps = trajectory.acceleration, np.diff(trajectory.t)[:, None]
    zero = np.zeros((1, 3))
    speed = np.concatenate([zero, np.cumsum(0.5 * steps * (a[1:] + a[:-1]), axis=0)])
    ways = steps * (speed[:-1] + steps * (a[:-1] / 3.0 + a[1:] / 6.0))
    sizes = np.linalg.norm(speed, axis=1)
    if sizes[-1] > TUNING.rest * sizes.max() + TUNING.rest_speed:
        raise SloshPlanError(
            f"{trajectory.name}: its accelerations end at a speed of {sizes[-1]:.3g} m/s; "
            "shaping is for motions from rest to rest"
        )
    return np.concatenate([zero, np.cumsum(ways, axis=0)])


def _ends(path: Path, t: Array, way: Array, speed: Array) -> list[float]:
    """Returns the legs' end times [s], each at the slowest sample near the leg's end corner."""
    ends, length = [0.0], 0.0
    for leg in path.legs[:-1]:
        length += leg.length
        near = np.flatnonzero(np.abs(way - length) <= TUNING.corner_near)
        if not len(near):
            near = np.array([int(np.argmin(np.abs(way - length)))])
        slowest = near[int(np.argmin(speed[near]))]
        if speed[slowest] > 0.05 * speed.max() + TUNING.rest_speed:
            raise SloshPlanError(
                f"the motion turns a corner at {t[slowest]:.3g} s with {speed[slowest]:.3g} m/s: "
                "shaping is for motions that rest at corners"
            )
        ends.append(float(t[slowest]))
    return [*ends, float(t[-1])]


def _leg_law(
    along: CubicHermiteSpline,
    start: float,
    stop: float,
    low: float,
    high: float,
    size: list[float],
) -> Law:
    """Returns the time law of one leg of a motion, at rest before its start and after its end."""
    t = np.linspace(start, stop, max(math.ceil((stop - start) / STEP), 20) + 1)
    values = np.clip(along(t) - low, 0.0, high - low)
    values[[0, -1]] = 0.0, high - low
    conditions: Any = ([(1, 0.0), (2, size[0])], [(1, 0.0), (2, -size[1])])
    spline = make_interp_spline(t - start, values, k=5, bc_type=conditions)
    rates = [spline.derivative(order) for order in (1, 2)]
    duration = stop - start

    def law(moments: Array) -> tuple[Array, Array, Array]:
        inside = np.clip(moments, 0.0, duration)
        moving = (inside == moments).astype(np.float64)
        first, second = (rate(inside) * moving for rate in rates)
        return np.asarray(spline(inside)), first, second

    return law


def _filtered(law: Law, chosen: Filter) -> Law:
    def made(t: Array) -> tuple[Array, Array, Array]:
        # One pass over the impulses for all three columns.
        columns = chosen(lambda moments: np.stack(law(moments), axis=-1), t)
        return columns[..., 0], columns[..., 1], columns[..., 2]

    return made


def residual_free(mode: Damped, duration: float) -> UnitLaw:
    """Returns a polynomial time law of degree 13 that leaves no residual wave.

    To the quintic polynomial u⁴ (1 − u)⁴ Σ cₖ (1 − 2u)ᵏ, k = 0 … 5, is added, which leaves the
    ends as they are. The cₖ make ∫ s̈ exp(−p t) dt zero at the mode's pole p, two real equations;
    of all that do, they add the least acceleration in the mean square. Fewer terms would run
    backwards at many durations.

    Args:
        mode: the mode.
        duration: of the motion [s].

    Raises:
        SloshPlanError: so short or so long a motion would run backwards on its way.

    >>> from slosh_plan.shaping.filters import Damped
    >>> law = residual_free(Damped(frequency=16.0, damping_ratio=0.01), duration=1.5)  # rad/s
    >>> law(np.array([0.0, 1.0]))[0].round(6).tolist()  # share of the way
    [0.0, 1.0]
    """
    coefficients = _coefficients(mode, duration)

    def law(u: Array) -> tuple[Array, Array, Array]:
        inside = np.clip(u, 0.0, 1.0)
        first, second = quintic(inside), _added(inside)
        place, rate, change = (
            one + coefficients @ more for one, more in zip(first, second, strict=True)
        )
        return place, rate, change

    rate = law(np.linspace(0.0, 1.0, 2001))[1]
    if rate.min() < _BACKWARDS * max(rate.max(), 1.0):
        raise SloshPlanError(
            f"a motion of {duration:.3g} s, {duration / mode.period:.1f} periods of the liquid, "
            "has no residual-free polynomial that does not run backwards: choose another "
            "duration, or a filter"
        )
    return law


def _coefficients(mode: Damped, duration: float) -> Array:
    """Returns the coefficients cₖ (TERMS,) of the polynomial that cancels the residual wave."""
    pole = complex(-mode.decay, mode.damped_frequency)
    # As seen at the motion's end: at most 1 in size, so that long motions do not overflow.
    wave = _WEIGHTS * np.exp(pole * duration * (1.0 - _U))
    more = _added(_U)[2]
    parts, own = more @ wave, quintic(_U)[2] @ wave
    equations = np.stack([parts.real, parts.imag])
    squares = (more * _WEIGHTS) @ more.T
    eased = np.linalg.solve(squares, equations.T)
    right = -np.array([own.real, own.imag])
    return np.asarray(eased @ np.linalg.lstsq(equations @ eased, right, rcond=1e-12)[0])


def _added(u: Array) -> tuple[Array, Array, Array]:
    """Returns u⁴(1 − u)⁴(1 − 2u)ᵏ (TERMS, N) and its first and second derivative."""
    v, w = u * (1.0 - u), 1.0 - 2.0 * u
    # With v' = w and w' = -2; a negative power only comes with the factor 0.
    powers = [np.zeros_like(w), np.zeros_like(w), *(w**n for n in range(TERMS + 2))]
    rows = [
        (
            v**4 * powers[k + 2],
            4.0 * v**3 * powers[k + 3] - 2.0 * k * v**4 * powers[k + 1],
            12.0 * v**2 * powers[k + 4]
            - (16.0 * k + 8.0) * v**3 * powers[k + 2]
            + 4.0 * k * (k - 1.0) * v**4 * powers[k],
        )
        for k in range(TERMS)
    ]
    value, rate, change = (np.stack(column) for column in zip(*rows, strict=True))
    return value, rate, change
