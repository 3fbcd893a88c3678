"""Designs a motion for which two models predict different heights.

Two models that explain the present motions equally well may answer another motion differently. A
family of motions that a robot can carry out is searched for those in which the predicted heights
differ most, with the liquid kept in the container. Of the best of each family the one counts in
which most is left of the difference when either model's parameters, its natural frequency and its
damping may be refitted a little, in relation to how much a small step of these changes the
heights: near resonance, and where the wave is chaotic, everything differs, and says little.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from slosh_base.types import Array
from slosh_discovery.discover.finding import SeparatingMotion
from slosh_discovery.discover.problem import liquid_alone
from slosh_discovery.discover.separating_families import (
    FAMILIES,
    CandidateMotion,
    inputs_of,
    text_of,
)
from slosh_discovery.discover.tuning import TUNING
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model.effects.registry import EFFECTS
from slosh_model.errors import SloshModelError
from slosh_model.measure import predicted_heights
from slosh_model.model import Model
from slosh_model.simulate import Inputs

RATIOS = (0.3, 0.5, 0.7, 0.85, 0.95, 1.05, 1.2)
"""Frequencies that are tried first, in units of the first mode's."""
REFINEMENT = (0.08, 0.04, 0.02)
"""Steps of the ratio around the best."""
SIZES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.1, 0.05)
"""Shares of the limit; the largest that keeps the liquid in."""


@dataclass(frozen=True, slots=True)
class _Pair:
    """Two models, and the height and acceleration limits of a motion that distinguishes them.

    Attributes:
        first, second: the models.
        ceiling: highest allowed height [m].
        frequency: the first mode's [Hz].
        limit: highest ‖a‖ [m/s²].
        azimuths: where the heights are read; None: MSH.
    """

    first: Model
    second: Model
    ceiling: float
    frequency: float
    limit: float
    azimuths: tuple[float, ...] | None


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """A motion that the search tried, and the heights' difference in both models.

    Attributes:
        motion, inputs: the motion.
        difference: rms difference of the heights [m].
        relative: in units of the heights' own rms.
        remaining: rms difference that no refit of either model removes [m]; NaN: not computed.
        sensitivity: largest rms change of the heights by one step of a parameter [m]; likewise.
    """

    motion: CandidateMotion
    inputs: Inputs
    difference: float
    relative: float
    remaining: float = math.nan
    sensitivity: float = math.nan


def separating_motion(
    first: Model,
    second: Model,
    present: Sequence[Inputs],
    limit: float,
    *,
    names: tuple[str, str] | None = None,
    azimuths: Sequence[float] | None = None,
) -> SeparatingMotion:
    """Designs a robot motion in which two models predict different heights.

    It starts and ends at rest after a still part and before a dwell, ‖a‖ stays below the limit,
    the travel below `most_travel`, the liquid below the rim. It turns only if one of the models
    has an effect that needs it. Two models that are the same for small waves (a gain on the
    acceleration, a gain on the height) are told apart by large ones: then their nonlinear twins
    are compared, as the real liquid is nonlinear; the description says so.

    Args:
        first, second: the models.
        present: the motions that do not separate them.
        limit: highest ‖a‖ [m/s²].
        names: of the explanations; None: the effects in which they differ.
        azimuths: (K,) where the heights are measured [rad]; None: MSH.

    Raises:
        SloshDiscoveryError: an impossible limit, or no motion that both models can answer.
    """
    if not (math.isfinite(limit) and limit > 0.0):
        raise SloshDiscoveryError(f"acceleration limit {limit!r} m/s² must be positive")
    places = None if azimuths is None else tuple(azimuths)
    pair = _Pair(
        first,
        second,
        _ceiling(first),
        first.mode_frequency(1) / (2.0 * math.pi),
        limit,
        places,
    )
    best = _search(pair)
    remark = ""
    if best is None or best.relative < TUNING.alike:
        twins = replace(
            pair, first=first.spatial().nonlinear(), second=second.spatial().nonlinear()
        )
        other = _search(twins)
        if other is not None and (best is None or other.relative > best.relative):
            best = other
            remark = (
                "; the two agree for small waves: the difference is that of their "
                "nonlinear variants, since real liquid is nonlinear"
            )
    if best is None:
        raise SloshDiscoveryError(
            f"no motion below {limit:g} m/s² keeps the liquid in: both models predict that it "
            "spills, or their solution diverges"
        )
    return SeparatingMotion(
        names=names or _names(first, second),
        inputs=best.inputs,
        description=f"{text_of(best.motion)}; {1e3 * best.remaining:.2g} mm of the difference are "
        f"left if the parameters may be refitted{remark}",
        difference=best.difference,
        present_difference=_present_difference(pair, present),
    )


def _search(pair: _Pair) -> _Trial | None:
    """Searches all shapes of motion; refines the one in which the refitted models differ most."""
    turning = _needs_rotation(pair)
    found: list[_Trial] = []
    for family in FAMILIES:
        if family.turns and not turning:
            continue
        tried = [
            _largest(pair, CandidateMotion(family, ratio * pair.frequency)) for ratio in RATIOS
        ]
        ranked = sorted((each for each in tried if each is not None), key=_by_difference)
        found += [_with_remaining(pair, each) for each in ranked[-TUNING.per_family :]]
    if not found:
        return None
    return _refined(pair, max(found, key=_by_merit))


def _refined(pair: _Pair, best: _Trial) -> _Trial:
    """Improves a motion by trying nearby frequencies and a longer dwell."""
    for step in REFINEMENT:
        centre = best.motion
        for sign in (-1.0, 1.0):
            moved = replace(centre, frequency=centre.frequency + sign * step * pair.frequency)
            best = _better(pair, best, moved)
    return _better(pair, best, replace(best.motion, dwell=TUNING.long_dwell))


def _better(pair: _Pair, best: _Trial, motion: CandidateMotion) -> _Trial:
    tried = _largest(pair, motion)
    return best if tried is None else max(best, _with_remaining(pair, tried), key=_by_merit)


def _by_difference(trial: _Trial) -> float:
    return trial.difference


def _by_merit(trial: _Trial) -> float:
    return trial.remaining / math.hypot(TUNING.floor, trial.sensitivity)


def _largest(pair: _Pair, motion: CandidateMotion) -> _Trial | None:
    """Returns the trial with the largest amplitude without spilling; None if all trials spill."""
    for size in SIZES:
        sized = replace(motion, acceleration=size * pair.limit)
        trial = _try(pair, sized)
        if trial is not None:
            return trial
    return None


def _try(pair: _Pair, motion: CandidateMotion) -> _Trial | None:
    inputs = inputs_of(motion)
    times = np.arange(inputs.t[0], inputs.t[-1], 1.0 / TUNING.sample_rate)
    try:
        for model in (pair.first, pair.second):
            # Whether it spills is not a matter of the sensor.
            peaks = predicted_heights(liquid_alone(model), inputs, times)
            if not float(np.max(np.abs(peaks))) <= pair.ceiling:
                return None
        one, two = (
            predicted_heights(model, inputs, times, pair.azimuths)
            for model in (pair.first, pair.second)
        )
    except SloshModelError:
        return None
    difference = _rms(one - two)
    size = max(_rms(one), _rms(two), 1e-12)
    return _Trial(motion, inputs, difference, difference / size)


def _with_remaining(pair: _Pair, trial: _Trial) -> _Trial:
    """Computes the difference that remains after one model is refitted to the other."""
    times = np.arange(trial.inputs.t[0], trial.inputs.t[-1], 1.0 / TUNING.sample_rate)
    heights = [
        predicted_heights(model, trial.inputs, times, pair.azimuths)
        for model in (pair.first, pair.second)
    ]
    difference = (heights[0] - heights[1]).ravel()
    remaining, sensitivity = [_rms(difference)], 0.0
    for model, own in zip((pair.first, pair.second), heights, strict=True):
        changes = []
        for variant in variants_of(model):
            try:
                other = predicted_heights(variant, trial.inputs, times, pair.azimuths)
            except SloshModelError:
                continue
            changes.append((other - own).ravel())
            sensitivity = max(sensitivity, _rms(changes[-1]))
        refit = optimize.lsq_linear(
            np.stack(changes, axis=1), difference, (-TUNING.give, TUNING.give)
        )
        remaining.append(math.sqrt(2.0 * refit.cost / len(difference)))
    return replace(trial, remaining=min(remaining), sensitivity=sensitivity)


def _present_difference(pair: _Pair, present: Sequence[Inputs]) -> float:
    """Returns the rms difference of two models over recorded motions [m]; 0 without motions."""
    squares = []
    for inputs in present:
        times = np.arange(inputs.t[0], inputs.t[-1], 1.0 / TUNING.sample_rate)
        if len(times) == 0:
            continue
        one, two = (
            predicted_heights(model, inputs, times, pair.azimuths)
            for model in (pair.first, pair.second)
        )
        squares.append((one - two).ravel() ** 2)
    return float(np.sqrt(np.mean(np.concatenate(squares)))) if squares else 0.0


def _ceiling(model: Model) -> float:
    freeboard = model.container.height_below_rim()
    open_height = TUNING.most_height * min(model.container.reaches)
    return (
        open_height if freeboard is None else min(open_height, TUNING.freeboard_share * freeboard)
    )


def _needs_rotation(pair: _Pair) -> bool:
    return any(EFFECTS[name].needs_rotation for name in _difference(pair.first, pair.second))


def _difference(first: Model, second: Model) -> Iterator[str]:
    """Yields the names of the physical effects in which two models differ."""
    ours, theirs = (
        {use.name: dict(use.parameters) for use in model.effects} for model in (first, second)
    )
    for name in dict.fromkeys((*ours, *theirs)):
        if ours.get(name) != theirs.get(name):
            yield name


def _names(first: Model, second: Model) -> tuple[str, str]:
    differing = set(_difference(first, second))
    one, two = (
        " + ".join(use.name for use in model.effects if use.name in differing) or "as it is"
        for model in (first, second)
    )
    return one, two


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def variants_of(model: Model) -> Iterator[Model]:
    """Yields models in which natural frequency, damping or one effect's parameter is changed."""
    wider = model.container.widened(1.0 + TUNING.width_change)
    if model.natural_frequency is None:
        yield replace(model, container=wider)
    else:
        slower = wider.natural_frequency(1) / model.container.natural_frequency(1)
        yield replace(model, natural_frequency=slower * model.natural_frequency)
    damping = model.mode_constants()[0].damping_ratio
    yield replace(model, damping_ratio=min(damping * (1.0 + TUNING.damping_change), 0.99))
    for use in model.effects:
        for parameter in EFFECTS[use.name].parameters:
            if parameter.choices is not None:
                continue
            value = use.parameters[parameter.name]
            span = parameter.upper - parameter.lower
            reference = value - (parameter.neutral or 0.0)
            step = max(TUNING.parameter_change * abs(reference), 0.001 * span)
            for moved in (value + step, value - step):
                try:
                    yield model.with_effect(use.name, **{**use.parameters, parameter.name: moved})
                except SloshModelError:
                    continue
                break
