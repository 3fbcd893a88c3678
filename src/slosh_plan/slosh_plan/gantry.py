"""Limits for machines whose axes make straight moves of lengths that are not known in advance.

A gantry or a laboratory robot accelerates, moves at a constant speed and brakes; how long each
part lasts depends on the protocol. The limits hold for the worst lengths of all parts: a family of
moves is simulated whose parts last up to a period of the liquid, after which its phases repeat.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from slosh_base.types import Array
from slosh_model.model import Model
from slosh_model.simulate import Inputs
from slosh_plan.errors import SloshPlanError
from slosh_plan.heights import first_period, highest, msh_of
from slosh_plan.limits import HeightLimits
from slosh_plan.tuning import TUNING

WEAKEST, STRONGEST = 1e-3, 20.0
"""Accelerations between which a limit is looked for [m/s²]."""
SLOWEST, FASTEST = 1e-3, 5.0
"""Speeds between which a limit is looked for [m/s]."""


@dataclass(frozen=True, slots=True)
class GantryLimits:
    """Limits of each axis's motion that keep the liquid below its height limit in any move.

    Attributes:
        acceleration: without a limit of the jerk [m/s²].
        smooth_acceleration, jerk: where acceleration builds up over a period of the liquid [m/s²,
            m/s³].
        speed: at the machine's own acceleration [m/s]; NaN: that is not given.
        wait: after a stroke at `acceleration`, until the liquid is below the residual limit [s].
    """

    acceleration: float
    smooth_acceleration: float
    jerk: float
    speed: float
    wait: float


def gantry_limits(
    model: Model, limits: HeightLimits, machine_acceleration: float | None = None
) -> GantryLimits:
    """Finds safe acceleration and speed limits of two machine axes that may move at once.

    Args:
        model: of the container and its liquid; its nonlinear twin answers.
        limits: height in a stroke, and residual height at which the next one may begin.
        machine_acceleration: of each axis, if it cannot be set [m/s²]; None: it can.

    Raises:
        SloshPlanError: there is no limit of the height, or none can be kept.
    """
    limits = limits.under_rim(model)
    if not math.isfinite(limits.height):
        raise SloshPlanError("limits of a machine need a limit of the height, or a rim")
    model = model.nonlinear()
    period = first_period(model)

    def strongest(ramp: float) -> float:
        """Returns the largest safe acceleration [m/s²] that builds up over a ramp time [s]."""

        def height(acceleration: float) -> float:
            return _peak(model, acceleration, ramp, period)[0]

        return _largest(height, limits.height, WEAKEST, STRONGEST)

    hard, soft, speed = strongest(0.0), strongest(period), math.nan
    if machine_acceleration is not None:
        own = machine_acceleration

        def height(speed: float) -> float:
            # A push much shorter than a period acts by its speed alone.
            push = max(speed / own, period * TUNING.gantry_short)
            return _peak(model, min(own, speed / push), 0.0, min(push, period))[0]

        speed = _largest(height, limits.height, SLOWEST, FASTEST)
    mode = model.mode_constants()[0]
    left = _peak(model, hard, 0.0, period)[1]
    rate = mode.damping_ratio * mode.natural_frequency
    quiet = min(limits.residual, limits.height)
    wait = math.log(left / quiet) / rate if left > quiet else 0.0
    return GantryLimits(hard, soft, soft / period, speed, wait)


def _largest(height: Callable[[float], float], limit: float, low: float, high: float) -> float:
    """Returns the largest value whose wave height, `height(value)`, is within a limit [m].

    Raises:
        SloshPlanError: not even the lowest value keeps it.
    """
    if height(low) > limit:
        raise SloshPlanError(f"no stroke of {low:g} or more keeps {1e3 * limit:.3g} mm")
    if height(high) <= limit:
        return high
    # Between the moves of the family there are worse ones.
    limit *= 1.0 - TUNING.gantry_reserve
    while high / low > 1.0 + TUNING.gantry_exact:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if height(middle) <= limit else (low, middle)
    return low


def _peak(model: Model, acceleration: float, ramp: float, longest: float) -> tuple[float, float]:
    """Returns the greatest wave heights [m] of many moves: at any time, and after a move's end.

    Args:
        model: the model.
        acceleration: of each axis [m/s²].
        ramp: time in which it builds up [s].
        longest: time for which it is held, at most [s].
    """
    moves = list(_moves(model, acceleration, ramp, longest))
    heights = [one.heights for one in highest(model, [inputs for inputs, _ in moves])]
    peak = left = 0.0
    for (inputs, end), both in zip(moves, heights, strict=True):
        msh = msh_of(model.container, both)
        msh = np.where(np.isfinite(msh), msh, np.inf)
        peak = max(peak, float(msh.max()))
        left = max(left, float(msh[inputs.t >= end].max()))
    return peak, left


def _speeds(edges: Array, values: Array) -> tuple[Array, Array]:
    """Integrates a piecewise linear acceleration; returns times [s] and speeds [m/s]."""
    t = np.unique(np.concatenate([np.linspace(a, b, 33) for a, b in pairwise(edges) if b > a]))
    inside = np.searchsorted(edges, 0.5 * (t[1:] + t[:-1])) - 1
    left, width = edges[inside], np.diff(edges)[inside]
    middle = 0.5 * (t[1:] + t[:-1]) - left
    rise = (values[1:] - values[:-1])[inside] / width
    pushed = (values[inside] + rise * middle) * np.diff(t)
    return t, np.concatenate([[0.0], np.cumsum(pushed)])


def _moves(
    model: Model, acceleration: float, ramp: float, longest: float
) -> Iterator[tuple[Inputs, float]]:
    """Yields there-and-back test moves of both axes (box: of one axis too), with end times [s]."""
    period = first_period(model)
    # A short push needs more samples.
    step = min(period, max(longest, period * TUNING.gantry_short) * TUNING.gantry_fine)
    step /= TUNING.gantry_rows
    directions = [(1.0, 1.0)]
    if model.container.follows_yaw:
        directions += [(1.0, 0.0), (0.0, 1.0)]
    shares = np.linspace(0.0, 1.0, TUNING.gantry_moves)
    for hold in (longest * np.maximum(shares, 0.5 * shares[1])).tolist():
        for coast in (period * shares).tolist():
            edges = np.cumsum([0.0, ramp, hold, ramp, coast, ramp, hold, ramp])
            values = acceleration * np.array([0.0, 1.0, 1.0, 0.0, 0.0, -1.0, -1.0, 0.0])
            t: Array = np.arange(0.0, edges[-1] + period, step)
            # Means over the samples: a short push keeps its speed.
            speeds = np.interp(np.append(t, t[-1] + step) - 0.5 * step, *_speeds(edges, values))
            along = np.diff(speeds) / step
            for direction in directions:
                yield Inputs(t, np.outer(along, [*direction, 0.0])), float(edges[-1])
