"""Finds the time law of a stroke with the lowest waves for a given duration.

The heights of the linear model are linear in the law's weights, so the law with the lowest peak
and residual wave follows from a linear program. It is solved some times: the difference between
the nonlinear and the linear model at the last law is added to the heights of the next one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.optimize import linprog

from slosh_base.types import Array, BoolArray
from slosh_machines.profile import COUNT, Profile, moments, spline
from slosh_machines.tuning import TUNING
from slosh_model.batch import wall_heights
from slosh_model.model import Model
from slosh_model.motion_profiles import LAWS
from slosh_model.simulate import Inputs
from slosh_plan.heights import first_period, highest, msh_of
from slosh_plan.planning.limits import PlanLimits

MINUTE = 60.0


class Law(Protocol):
    """Interface of a time law: normalised position of a stroke against normalised time."""

    def acceleration(self, u: Array) -> Array:
        """Returns the second derivative at normalised times; 0 outside the range 0 to 1."""


@dataclass(frozen=True, slots=True)
class NamedLaw:
    """One of the standard time laws of `slosh_model.motion_profiles`, for comparison.

    Attributes:
        name: one of LAWS.
    """

    name: str

    def acceleration(self, u: Array) -> Array:
        """Returns the second derivative at normalised times; 0 outside 0 to 1."""
        inside = (u >= 0.0) & (u <= 1.0)
        return np.where(inside, LAWS[self.name](np.clip(u, 0.0, 1.0))[2], 0.0)


@dataclass(frozen=True, slots=True)
class Stroke:
    """A machine's cycle: a stroke along x, then a dwell.

    Attributes:
        length: of the stroke [m].
        ratio: share of the cycle in which the container moves.
    """

    length: float
    ratio: float

    def cycle(self, speed: float) -> float:
        """Duration of a stroke and the dwell after it [s], at a speed [cycles/min]."""
        return MINUTE / speed

    def duration(self, speed: float) -> float:
        """Duration of the stroke [s] at a speed [1/min]."""
        return self.ratio * self.cycle(speed)

    def inputs(self, profile: Law, speed: float, cycles: float) -> Inputs:
        """Returns the container's acceleration over a number of cycles, as the models' input."""
        duration, cycle = self.duration(speed), self.cycle(speed)
        step = duration / TUNING.rows
        t: Array = step * np.arange(math.ceil(cycles * cycle / step) + 1, dtype=np.float64)
        pace = self.length / duration**2
        pushed = np.zeros((len(t), 3))
        pushed[:, 0] = pace * profile.acceleration(np.mod(t, cycle) / duration)
        return Inputs(t, pushed)


@dataclass(frozen=True, slots=True)
class StrokeHeights:
    """Heights of the liquid that a stroke causes over many cycles.

    Attributes:
        peak: greatest height [m]; infinite where the model left its range.
        residual: greatest height in the dwells [m].
        acceleration, jerk: the greatest of the container [m/s², m/s³].
    """

    peak: float
    residual: float
    acceleration: float
    jerk: float

    def excess(self, limits: PlanLimits) -> float:
        """Returns the largest relative excess over a height limit; at most 0 if all are kept."""
        names = ("acceleration", "jerk", "residual")
        used = [getattr(self, name) / getattr(limits, name) for name in names]
        return float(max(self.peak / limits.height, *used)) - 1.0


def heights(model: Model, stroke: Stroke, profile: Law, speed: float) -> StrokeHeights:
    """Simulates repeated strokes until the waves of earlier strokes have decayed.

    Args:
        model: the model.
        stroke: the machine's cycle.
        profile: the law.
        speed: of the machine [1/min].
    """
    mode = model.mode_constants()[0]
    decay = 1.0 / max(mode.damping_ratio * mode.natural_frequency, 1e-6)
    cycles = TUNING.constants * decay / stroke.cycle(speed)
    cycles = math.ceil(min(max(cycles, TUNING.fewest), TUNING.most))
    inputs = stroke.inputs(profile, speed, cycles)
    (found,) = highest(model, [inputs])
    msh = msh_of(model.container, found.heights)
    msh = np.where(np.isfinite(msh), msh, math.inf)
    dwells = np.mod(inputs.t, stroke.cycle(speed)) > stroke.duration(speed)
    dwells[-1] = True
    acceleration = inputs.acceleration[:, 0]
    jerk = np.abs(np.diff(acceleration)).max() / inputs.t[1]
    return StrokeHeights(
        float(msh.max()), float(msh[dwells].max()), float(np.abs(acceleration).max()), float(jerk)
    )


def designed(
    model: Model, stroke: Stroke, speed: float, limits: PlanLimits, before: Profile | None
) -> Profile | None:
    """Returns the time law with the lowest waves; None if acceleration or jerk limit forbid it.

    Args:
        model: the model.
        stroke: the machine's cycle.
        speed: of the machine [1/min].
        limits: of acceleration, jerk and residual.
        before: law of the next lower speed, which the law is not to differ from without need, so
            that laws between both can be interpolated; None: there is none.
    """
    duration = stroke.duration(speed)
    settle = first_period(model) / stroke.cycle(speed)
    one = np.eye(COUNT)
    inputs = [stroke.inputs(Profile(row), speed, min(stroke.ratio + settle, 1.0)) for row in one]
    linear = np.column_stack([both[:, 0] for both in wall_heights(model.linear(), inputs)])
    moving = inputs[0].t <= duration
    correction, best, lowest = np.zeros(len(linear)), before, math.inf
    for _ in range(TUNING.rounds):
        found = _program(linear, correction, moving, stroke.length, duration, limits, before)
        if found is None:
            break
        single = stroke.inputs(found, speed, min(stroke.ratio + settle, 1.0))
        (both,) = wall_heights(model, [single])
        height = both[:, 0]
        if not np.isfinite(height).all():
            best = found if best is before else best
            break
        waves = np.abs(height[moving]).max() + np.abs(height[~moving]).max(initial=0.0)
        if waves < lowest:
            best, lowest = found, float(waves)
        correction = height - linear @ found.weights
    return best if lowest < math.inf or best is not before else None


def _program(
    linear: Array,
    correction: Array,
    moving: BoolArray,
    length: float,
    duration: float,
    limits: PlanLimits,
    before: Profile | None,
) -> Profile | None:
    """Finds the spline weights of the time law with the lowest waves by a linear program."""
    u = np.linspace(0.0, 1.0, TUNING.rows // 2 + 1)
    acceleration, share = spline(np.eye(COUNT)), 1.0 - TUNING.slack
    shares = [
        acceleration(u) * length / duration**2 / (share * limits.acceleration),
        acceleration.derivative()(u) * length / duration**3 / (share * limits.jerk),
    ]
    size = 2 * COUNT + 2

    def rows(block: Array, column: int | None, least: Array) -> tuple[Array, Array]:
        """Returns constraints |block · weights + least| ≤ variable `column` (None: ≤ 1)."""
        full = np.zeros((2 * len(block), size))
        full[:, :COUNT] = np.concatenate([block, -block])
        bound = np.concatenate([-least, least])
        if column is None:
            return full, bound + 1.0
        full[:, column] = -1.0
        return full, bound

    peak, residual = COUNT, COUNT + 1
    scale = 1.0 / limits.height if math.isfinite(limits.height) else 100.0
    heights_now, offset = scale * linear, scale * correction
    every = slice(None, None, 2)
    parts = [
        rows(heights_now[moving][every], peak, offset[moving][every]),
        rows(heights_now[~moving][every], residual, offset[~moving][every]),
        *(rows(block, None, np.zeros(len(u))) for block in shares),
    ]
    if before is not None:
        change = np.zeros((2 * COUNT, size))
        change[:, :COUNT] = np.concatenate([np.eye(COUNT), -np.eye(COUNT)])
        change[:, COUNT + 2 :] = -np.concatenate([np.eye(COUNT), np.eye(COUNT)])
        parts.append((change, np.concatenate([before.weights, -before.weights])))
    cost = np.zeros(size)
    cost[[peak, residual]] = 1.0
    cost[COUNT + 2 :] = TUNING.change / COUNT
    equal = np.zeros((2, size))
    equal[:, :COUNT] = moments()
    bounds = [(None, None)] * COUNT + [(0.0, None)] * (COUNT + 2)
    answer = linprog(
        cost, np.concatenate([part[0] for part in parts]),
        np.concatenate([part[1] for part in parts]), equal, np.array([0.0, 1.0]), bounds,
        method="highs",
    )  # fmt: skip
    return Profile(np.asarray(answer.x)[:COUNT]) if answer.success else None
