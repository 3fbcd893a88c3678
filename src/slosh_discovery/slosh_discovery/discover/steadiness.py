"""Tests whether a parameter that changes with time explains more than any constant effect.

An effect of the list has one size. Damping that changes while a liquid warms, or a sensor whose
gain creeps, is something else, and some effects of constant size can make something of it. So
each explanation has a rival in which one of its parameters is another in each motion, or grows or
falls within them. The fit's derivatives tell how the heights answer to that: split by motions, or
multiplied with the time since a motion's middle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.evidence import (
    log_evidence,
    residual_temperature,
)
from slosh_discovery.discover.fitting import Fit
from slosh_discovery.discover.problem import PreparedMotion
from slosh_discovery.discover.search import Pool, leftover
from slosh_discovery.discover.tuning import TUNING


@dataclass(frozen=True, slots=True)
class Change:
    """A model parameter that seems to change with time.

    Attributes:
        effect, parameter: whose it is.
        between: whether it differs from motion to motion; else it grows or falls within them.
        first, last: from where to where it would go, as far as a straight line tells; from motion
            to motion the least and the largest.
    """

    effect: str
    parameter: str
    between: bool
    first: float
    last: float

    def text(self) -> str:
        """Describes in a sentence how the parameter changes with time."""
        when = "from motion to motion" if self.between else "with time within the motions"
        return (
            f"Something changes {when}: the {self.parameter} of {self.effect} from about "
            f"{self.first:.3g} to {self.last:.3g} explains more than any effect of constant size. "
            "No listed effect changes in this way, so none is added."
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Changing:
    """A linearised fit in which one parameter changes with time.

    Attributes:
        one: the fit with constant parameters.
        index: which parameter changes.
        between: whether it differs from motion to motion.
        steps: of the parameter along each shape.
        information: of the steps.
        residual: what is left.
    """

    one: Fit
    index: int
    between: bool
    steps: Array
    information: Array
    residual: Array

    @property
    def gain(self) -> float:
        """Returns by how much a parameter that changes with time reduces χ²."""
        return self.one.chi_square - float(self.residual @ self.residual)

    def log_evidence(self, temperature: float) -> float:
        """Returns the log evidence of the fit; the change counts as one additional effect."""
        spread = self.one.explanation.spreads[self.index]
        information = np.eye(len(self.steps)) + self.information * spread**2 / temperature
        occam = 0.5 * float(np.linalg.slogdet(information)[1])
        more = 0.5 * self.gain / temperature - occam + math.log(TUNING.effect_prior)
        return log_evidence(self.one, temperature) + more

    def change(self) -> Change:
        """Returns which parameter changes, and from which value to which."""
        free = self.one.explanation.free[self.index]
        value, bounds = self.one.vector[self.index], (free.parameter.lower, free.parameter.upper)
        # The residual falls where the parameter goes the other way.
        if self.between:
            values = np.sort(value - (self.steps - self.steps.mean()))[[0, -1]]
        else:
            values = value - self.steps[0] * np.array([-1.0, 1.0])
        first, last = np.clip(values, *bounds).tolist()
        return Change(free.effect.name, free.parameter.name, self.between, first, last)


def change_with_time(
    pool: Pool, motions: Sequence[PreparedMotion], temperature: float
) -> Change | None:
    """Returns a change with time more probable than any constant effect; None if none is.

    Args:
        pool: the explanations.
        motions: the data.
        temperature: of the data; see `evidence`.
    """
    shapes = [(False, _by_time(motions)[:, np.newaxis])]
    shapes += [(True, _by_motion(motions))] if len(motions) > 1 else []
    tried = [
        _changing(one, index, shape, between=between)
        for one in pool.fits.values()
        for index in range(len(one.vector))
        for between, shape in shapes
    ]
    if not tried:
        return None
    least = min(tried, key=lambda each: float(each.residual @ each.residual))
    parameters = len(least.one.vector) + len(least.steps)
    temperature = min(temperature, residual_temperature(least.residual, parameters, motions))
    best = max(tried, key=lambda each: each.log_evidence(temperature))
    constant = max(log_evidence(one, temperature) for one in pool.fits.values())
    if best.log_evidence(temperature) <= constant or not _matters(best, pool, motions):
        return None
    return best.change()


def _changing(one: Fit, index: int, shape: Array, *, between: bool) -> _Changing:
    """Returns the linearised fit with one time-varying parameter; refits all other parameters."""
    others, _ = np.linalg.qr(one.jacobian)
    columns = shape * one.jacobian[:, index : index + 1]
    columns = columns - others @ (others.T @ columns)
    steps = np.asarray(np.linalg.lstsq(columns, one.residual, rcond=1e-6)[0], dtype=np.float64)
    left = one.residual - columns @ steps
    return _Changing(one, index, between, steps, columns.T @ columns, left)


def _matters(best: _Changing, pool: Pool, motions: Sequence[PreparedMotion]) -> bool:
    """Returns whether a parameter's change with time explains a large part of the residual."""
    one, count = best.one, len(best.residual)
    name = one.explanation.free[best.index].effect.name
    without = pool.find(one.explanation.without(name)) or pool.base
    whole = max(without.chi_square - one.chi_square, 0.0) + best.gain
    beside_noise = max(leftover(one, motions).mean_square, 0.0)
    return best.gain > max(
        TUNING.change_taken * count * beside_noise, TUNING.least_change**2 * whole
    )


def _by_motion(motions: Sequence[PreparedMotion]) -> Array:
    """Returns an indicator matrix (N, motions): which motion each sample belongs to."""
    sizes = [int(motion.kept.sum()) for motion in motions]
    return np.repeat(np.eye(len(motions)), sizes, axis=0)


def _by_time(motions: Sequence[PreparedMotion]) -> Array:
    """Returns the time (N,) of each sample, scaled from -1 to 1 over its motion."""
    parts = []
    for motion in motions:
        middle, half = 0.5 * (motion.t[0] + motion.t[-1]), 0.5 * (motion.t[-1] - motion.t[0])
        since = (motion.t - middle) / half
        parts.append(np.broadcast_to(since[:, np.newaxis], motion.kept.shape)[motion.kept])
    return np.concatenate(parts)
