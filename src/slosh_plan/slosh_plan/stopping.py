"""Finds the quickest stop of a moving container that keeps the liquid below a limit.

Of a family of laws: the velocity is the cubic that leads from the present velocity and
acceleration to rest, and two bumps along the present direction that brake earlier or later. Ever
longer durations are gone through, and for each a grid of bumps; the first that keeps all limits
is the answer, after it was simulated at 1 kHz. There may be quicker stops outside the family.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from slosh_base.types import Array
from slosh_model import Model
from slosh_plan.errors import SloshPlanError
from slosh_plan.heights import Extremes, all_extremes, first_period
from slosh_plan.limits import HeightLimits
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.time_law import STEP, whole_rows
from slosh_plan.prediction import check_start
from slosh_plan.start import LiquidState
from slosh_plan.trajectory import Trajectory
from slosh_plan.tuning import TUNING

EARLIER = (0.0, -2.0, 2.0, -4.0, 4.0, -6.0, 6.0, -8.0, 8.0)
LATER = (0.0, -4.0, 4.0, -8.0, 8.0, -12.0, 12.0, -16.0, 16.0)
"""Sizes of the two bumps, in units of the speed."""
BACKWARDS = 1e-9
"""Of the speed."""


class NoSafeStopError(SloshPlanError):
    """Error that none of the stops that were tried keeps the limits."""


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """A stopping motion of the container that keeps every limit.

    Attributes:
        trajectory: 1 kHz, from now at t = 0; positions from where the container is now [m].
        duration: until it rests [s].
        distance: how far it goes [m].
        sideways: how far it leaves its present direction, as its acceleration fades [m].
        peak: greatest height over the wall, in the stop or after it [m].
        residual: the same after the stop [m].
        quickest: duration of about the quickest stop of the family that keeps acceleration and
            jerk alone [s]: what the liquid costs.
    """

    trajectory: Trajectory
    duration: float
    distance: float
    sideways: float
    peak: float
    residual: float
    quickest: float


@dataclass(frozen=True, slots=True, eq=False)
class _Moving:
    """Present velocity and acceleration of the container."""

    velocity: Array
    acceleration: Array

    @property
    def speed(self) -> float:
        return float(np.linalg.norm(self.velocity))

    @property
    def direction(self) -> Array:
        return self.velocity / self.speed

    def law(self, duration: float, bumps: tuple[float, float], t: Array) -> tuple[Array, Array]:
        """Returns a stop's velocity [m/s] and acceleration [m/s²] (N, 3) at times from now [s]."""
        u = t / duration
        rest, half = 1.0 - u, 1.0 - 2.0 * u
        early, late = bumps
        both = (u * rest) ** 2
        bump = both * (early + late * half)
        slope = 2.0 * u * rest * half * (early + late * half) - 2.0 * late * both
        velocity = (
            np.multiply.outer(1.0 + u * u * (2.0 * u - 3.0), self.velocity)
            + np.multiply.outer(duration * u * rest * rest, self.acceleration)
            + np.multiply.outer(bump, self.velocity)
        )
        acceleration = (
            np.multiply.outer((slope - 6.0 * u * rest) / duration, self.velocity)
            + np.multiply.outer(rest * (1.0 - 3.0 * u), self.acceleration)
        )  # fmt: skip
        return velocity, acceleration


def safe_stop(
    model: Model,
    velocity: ArrayLike,
    limits: PlanLimits,
    *,
    acceleration: ArrayLike = (0.0, 0.0, 0.0),
    state: LiquidState | None = None,
) -> Stop:
    """Finds the quickest stop of an upright container that keeps the limits.

    >>> from slosh_model import Model
    >>> cup = Model.from_cup(diameter=0.08, fill_height=0.06)
    >>> stop = safe_stop(cup, velocity=[0.3, 0.0, 0.0], limits=PlanLimits(0.010, 0.005))
    >>> stop.peak <= 0.010 and stop.residual <= 0.005
    True

    Args:
        model: the model; its NL twin decides.
        velocity: (3,) of the container's origin now, world's axes [m/s].
        limits: to keep, beside the container's rim; that of the residual after the stop.
        acceleration: (3,) of the same now [m/s²].
        state: the liquid now; None: at rest.

    Raises:
        NoSafeStopError: none of up to TUNING.longest_stop seconds keeps them.
        SloshPlanError: no movement, values that are not finite, an acceleration or a height that
            exceeds its limit already, the state of another model.
    """
    check_start(model, state, HeightLimits(limits.height, limits.residual))
    limits = limits.under_rim(model)
    moving = _checked(velocity, acceleration, limits)
    nonlinear, modal = model.nonlinear(), None if state is None else state.nonlinear
    quickest, lowest = math.nan, math.inf
    for duration in _durations(moving, limits):
        allowed = _allowed(moving, duration, limits)
        if not allowed:
            continue
        quickest = duration if math.isnan(quickest) else quickest
        rough = _heights(
            nonlinear, moving, duration, allowed, modal, TUNING.stop_coarse, TUNING.searched
        )
        lowest = min(lowest, *(one.peak for one in rough))
        excess = [_excess(one, limits) for one in rough]
        chosen = allowed[int(np.argmin(excess))]
        if min(excess) > 0.0 or not _keeps(moving, duration, chosen, limits):
            continue
        (found,) = _heights(
            nonlinear, moving, duration, [chosen], modal, STEP, TUNING.stop_periods
        )
        if _excess(found, limits) <= 0.0:
            return _stop(moving, duration, chosen, found, quickest)
    raise NoSafeStopError(
        f"no stop of up to {TUNING.longest_stop:g} s keeps {1e3 * limits.height:.3g} mm, "
        f"afterwards {1e3 * limits.residual:.3g} mm; the lowest found is {1e3 * lowest:.3g} "
        "mm"
    )


def _checked(velocity: ArrayLike, acceleration: ArrayLike, limits: PlanLimits) -> _Moving:
    vectors = {}
    for name, given in (("velocity", velocity), ("acceleration", acceleration)):
        value = np.array(given, dtype=np.float64)
        if value.shape != (3,) or not np.isfinite(value).all():
            raise SloshPlanError(f"{name} must be three finite numbers, not {given!r:.60}")
        vectors[name] = value
    moving = _Moving(vectors["velocity"], vectors["acceleration"])
    if moving.speed < 1e-6:
        raise SloshPlanError("the container does not move: there is nothing to stop")
    size = float(np.linalg.norm(moving.acceleration))
    if size > limits.acceleration:
        raise SloshPlanError(
            f"the container accelerates with {size:.3g} m/s² already, above the limit of "
            f"{limits.acceleration:g} m/s²"
        )
    return moving


def _durations(moving: _Moving, limits: PlanLimits) -> Iterator[float]:
    """Yields durations [s] from the shortest possible one to TUNING.longest_stop."""
    duration = whole_rows(max(moving.speed / limits.acceleration, 10.0 * STEP))
    while duration <= TUNING.longest_stop:
        yield duration
        duration = whole_rows(max(TUNING.stop_ratio * duration, duration + STEP))


def _allowed(moving: _Moving, duration: float, limits: PlanLimits) -> list[tuple[float, float]]:
    """Returns those shape parameters of a stop that keep the acceleration and jerk limits."""
    t = np.linspace(0.0, duration, TUNING.stop_rows)
    plain, early, late = (
        moving.law(duration, pair, t) for pair in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    )
    pairs = np.array(list(product(EARLIER, LATER)))
    # The law is linear in the bumps.
    velocity, acceleration = (
        none
        + np.multiply.outer(pairs[:, 0], one - none)
        + np.multiply.outer(pairs[:, 1], other - none)
        for none, one, other in zip(plain, early, late, strict=True)
    )
    jerk = np.diff(acceleration, axis=1) / (t[1] - t[0])
    kept = (
        ((velocity @ moving.direction).min(axis=1) >= -BACKWARDS * moving.speed)
        & (np.linalg.norm(acceleration, axis=2).max(axis=1) <= limits.acceleration)
        & (np.linalg.norm(jerk, axis=2).max(axis=1) <= limits.jerk)
    )
    return [(float(one), float(other)) for one, other in pairs[kept]]


def _keeps(
    moving: _Moving, duration: float, bumps: tuple[float, float], limits: PlanLimits
) -> bool:
    """Returns whether a stop keeps the limits of acceleration and jerk at every sample."""
    acceleration = moving.law(duration, bumps, _rows(duration, STEP))[1]
    jerk = np.linalg.norm(np.diff(acceleration, axis=0), axis=1).max() / STEP
    size = float(np.linalg.norm(acceleration, axis=1).max())
    return bool(size <= limits.acceleration and jerk <= limits.jerk)


def _rows(duration: float, step: float) -> Array:
    return np.linspace(0.0, duration, max(round(duration / step), 2) + 1)


def _heights(
    model: Model,
    moving: _Moving,
    duration: float,
    bumps: Sequence[tuple[float, float]],
    modal: Array | None,
    step: float,
    periods: float,
) -> list[Extremes]:
    t = _rows(duration, step)
    inputs = [
        Trajectory(t, moving.law(duration, pair, t)[1], name="stop").inputs(
            periods * first_period(model), step
        )
        for pair in bumps
    ]
    return all_extremes(model, inputs, [duration] * len(inputs), modal)


def _excess(found: Extremes, limits: PlanLimits) -> float:
    """Returns the larger relative excess of peak and residual height over their limits."""
    return max(found.peak / limits.height, found.residual / limits.residual) - 1.0


def _stop(
    moving: _Moving, duration: float, bumps: tuple[float, float], found: Extremes, quickest: float
) -> Stop:
    t = _rows(duration, STEP)
    velocity, acceleration = moving.law(duration, bumps, t)
    middle = moving.law(duration, bumps, 0.5 * (t[1:] + t[:-1]))[0]
    steps = STEP / 6.0 * (velocity[1:] + 4.0 * middle + velocity[:-1])
    position = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    along = position @ moving.direction
    aside = position - np.multiply.outer(along, moving.direction)
    return Stop(
        Trajectory(t, acceleration, position=position, name="stop"),
        duration,
        float(along[-1]),
        float(np.linalg.norm(aside, axis=1).max()),
        found.peak,
        found.residual,
        quickest,
    )
