"""Groups motions that were recorded with the same sensor set-up, if the user gives no groups.

With the best explanation so far, each motion tells by itself what the parameters of an effect of
the sensor would be: the fit is linear in them, near neutral, and its normal equations are all that
is needed to weigh any grouping of the motions by its evidence. From every motion by itself, those
two groups are joined whose union gains most, again and again; of all groupings on the way the
likeliest is compared with that of one group.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaln

from slosh_base.types import Array
from slosh_discovery.discover.fitting import Evaluator, Fit
from slosh_discovery.discover.problem import PreparedMotion
from slosh_discovery.discover.tuning import TUNING
from slosh_model.effects.base import Effect, Stage
from slosh_model.effects.registry import EFFECTS

Members = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Campaigns:
    """The motions of each group, and the modelled effect that differs between groups.

    Attributes:
        effect: whose parameters differ between the groups.
        members: (G,) of each group, as indices of the motions, in the order of the first ones.
        gain: log of the odds over one group for all.
    """

    effect: str
    members: tuple[Members, ...]
    gain: float


@dataclass(frozen=True, slots=True, eq=False)
class Normal:
    """Normal equations of one motion for the parameters of one modelled effect.

    Attributes:
        information: (P, P) in units of the parameters' spreads before any data.
        slope: (P,) of χ²/2 at neutral, likewise.
    """

    information: Array
    slope: Array


def find_campaigns(
    one: Fit, motions: Sequence[PreparedMotion], temperature: float
) -> Campaigns | None:
    """Finds the likeliest grouping of motions by sensor set-up; None if no grouping is needed.

    Args:
        one: the best explanation of all motions together.
        motions: the data.
        temperature: of the data; see `evidence`.

    Returns:
        None where the motions show no more than one set-up.
    """
    found = [
        grouping(normal_equations(one, name, motions, temperature), name)
        for name, effect in EFFECTS.items()
        if _tells(effect) and effect.fits(one.explanation.base.container.section)
    ]
    best = max(found, key=lambda campaigns: campaigns.gain)
    return best if best.gain > TUNING.clear_gain and len(best.members) > 1 else None


def in_groups(motions: Sequence[PreparedMotion], campaigns: Campaigns) -> list[PreparedMotion]:
    """Returns copies of the motions with the names of their groups: `rig_1`, `rig_2` and so on."""
    names = {
        index: f"rig_{number}"
        for number, members in enumerate(campaigns.members, start=1)
        for index in members
    }
    return [
        replace(one, motion=replace(one.motion, group=names[index]))
        for index, one in enumerate(motions)
    ]


def grouping(normals: Sequence[Normal], effect: str) -> Campaigns:
    """Finds the most probable grouping of motions from their normal equations."""
    groups: list[Members] = [(index,) for index in range(len(normals))]
    whole = _log_odds([tuple(range(len(normals)))], normals)
    best = Campaigns(effect, (tuple(range(len(normals))),), 0.0)
    while len(groups) > 2:
        pairs = itertools.combinations(groups, 2)
        groups = max(
            (_joined(groups, *pair) for pair in pairs), key=lambda tried: _log_odds(tried, normals)
        )
        gain = _log_odds(groups, normals) - whole
        if gain > best.gain and min(map(len, groups)) >= TUNING.least_members:
            best = Campaigns(effect, tuple(sorted(groups)), gain)
    return best


def normal_equations(
    one: Fit, name: str, motions: Sequence[PreparedMotion], temperature: float
) -> list[Normal]:
    """Computes each motion's normal equations for a modelled effect, linearised at zero effect.

    Clock offsets that are unknown follow; what else the explanation has stays.
    """
    explanation = one.explanation.without(name)
    wider = explanation.with_effect(name, {})
    rows = [row for row, free in enumerate(wider.free) if free.effect.name == name]
    vector = wider.vector(
        lambda effect, _: (
            _neutral(effect) if effect == name else one.explanation.part(one.vector, effect)
        )
    )
    evaluator, offsets = Evaluator(wider, motions), np.array(one.clock_offsets)
    answers = evaluator.answers(vector)
    residual = evaluator.residual(answers, offsets)
    slopes = evaluator.derivative(vector, offsets, residual)[:, rows] * wider.spreads[rows]
    clocks = evaluator.clock_derivative(answers, offsets)
    ends = np.cumsum([int(motion.kept.sum()) for motion in motions])[:-1]
    return [
        _normal(*parts, temperature)
        for parts in zip(
            np.split(residual, ends), np.split(slopes, ends), np.split(clocks, ends), strict=True
        )
    ]


def _normal(residual: Array, slopes: Array, clocks: Array, temperature: float) -> Normal:
    """Returns a motion's normal equations, with the unknown clock offset projected out."""
    own = clocks[:, np.any(clocks != 0.0, axis=0)]
    columns = np.column_stack([slopes, residual])
    if own.shape[1]:
        columns = columns - own @ np.linalg.lstsq(own, columns, rcond=None)[0]
    products = columns.T @ columns / temperature
    return Normal(products[:-1, :-1], products[:-1, -1])


def _log_odds(groups: Sequence[Members], normals: Sequence[Normal]) -> float:
    """Returns the log of evidence times prior of a grouping, up to a constant.

    Before any data a motion joins a group in proportion to its size, or begins a new one like a
    group of one (the Chinese restaurant process).
    """
    total = 0.0 if len(groups) == 1 else math.log(TUNING.group_prior)
    for members in groups:
        information = np.sum([normals[index].information for index in members], axis=0)
        slope = np.sum([normals[index].slope for index in members], axis=0)
        widened = np.eye(len(information)) + information
        total += 0.5 * float(slope @ np.linalg.solve(widened, slope))
        total -= 0.5 * float(np.linalg.slogdet(widened)[1])
        total += float(gammaln(len(members)))
    return total


def _joined(groups: Sequence[Members], one: Members, other: Members) -> list[Members]:
    rest = [members for members in groups if members not in (one, other)]
    return [*rest, tuple(sorted((*one, *other)))]


def _tells(effect: Effect) -> bool:
    """Returns whether a modelled effect concerns only the sensor and is nearly linear."""
    return (
        effect.of_rig
        and effect.stages == (Stage.MEASUREMENT,)
        and all(
            parameter.neutral is not None and parameter.lower < parameter.neutral < parameter.upper
            for parameter in effect.parameters
        )
    )


def _neutral(name: str) -> dict[str, float]:
    return {
        parameter.name: parameter.neutral
        for parameter in EFFECTS[name].parameters
        if parameter.neutral is not None
    }
