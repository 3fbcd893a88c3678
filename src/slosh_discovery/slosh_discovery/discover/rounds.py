"""Repeats the search with the noise that the residuals of the previous round show.

What a wrong base leaves may look like noise, and what the inputs' noise does depends on how the
liquid swings: the likeliest explanation is asked, not the base.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slosh_discovery.discover.clock import first_offset, slipped_offsets
from slosh_discovery.discover.driven import with_input_noise
from slosh_discovery.discover.input_noise import InputNoise, estimate_input_noise
from slosh_discovery.discover.problem import PreparedMotion, heights_of_liquids, liquid_alone
from slosh_discovery.discover.search import Pool, Progress, Search
from slosh_discovery.discover.sensor_noise import (
    Leftovers,
    SensorNoise,
    alike,
    dressed,
    estimate_sensor,
)
from slosh_discovery.discover.tuning import TUNING
from slosh_model.model import Model


@dataclass(frozen=True, slots=True, eq=False)
class Searched:
    """Result of a search: candidate models, motions and sensor noise.

    Attributes:
        pool: the explanations.
        motions: the data, with the noise that they turned out to have.
        sensor: that of the heights; None: plain and white.
    """

    pool: Pool
    motions: Sequence[PreparedMotion]
    sensor: SensorNoise | None


def search_in_rounds(
    base: Model, plain: Sequence[PreparedMotion], told: Progress, threads: int
) -> Searched:
    """Searches assuming white noise, and again if the residuals show other noise.

    Args:
        base: the model that came in.
        plain: the data.
        told: of the progress.
        threads: fits at a time.
    """
    offsets: Sequence[float] = [first_offset(one, base) for one in plain]
    models: Sequence[Model] = [base] * len(plain)
    sensor: SensorNoise | None = None
    for last in (False, False, True):
        motions = [
            with_noise(one, model, offset, sensor)
            for one, model, offset in zip(plain, models, offsets, strict=True)
        ]
        pool = Search(base, motions, offsets, told, threads).run()
        slipped = slipped_offsets(pool.ranked()[0], motions)
        if slipped is not None:
            pool = Search(base, motions, slipped, told, threads).run()
        best = pool.ranked()[0]
        offsets, before = best.clock_offsets, models
        models = [best.model_of(one.motion.group) for one in plain]
        left = [
            _leftovers(with_noise(one, model, offset, None), model, offset)
            for one, model, offset in zip(plain, models, offsets, strict=True)
        ]
        found = estimate_sensor([one for one in left if one is not None])
        driven = any(one.driven is not None for one in motions)
        settled = not driven or all(map(driven_alike, plain, models, before))
        if last or (settled and alike(found, sensor)):
            return Searched(pool, motions, sensor)
        told("measuring the noise", 0.0)
        sensor = found
    raise AssertionError  # the last round returns


def with_noise(
    plain: PreparedMotion, model: Model, clock_offset: float, sensor: SensorNoise | None
) -> PreparedMotion:
    """Returns a motion with the noise of its inputs and of the sensor, as a model implies it.

    Args:
        plain: the motion.
        model: that is likely.
        clock_offset: measured minus inputs' clock [s].
        sensor: noise of the heights; None: plain and white.
    """
    one = with_input_noise(plain, input_noise(plain), model, clock_offset)
    left = None if sensor is None else _leftovers(one, model, clock_offset)
    return one if left is None or sensor is None else dressed(left, sensor)


def input_noise(one: PreparedMotion) -> InputNoise | None:
    """Estimates the noise of a motion's inputs, or returns None if there is none."""
    return estimate_input_noise(one.motion.inputs)


def _leftovers(one: PreparedMotion, model: Model, clock_offset: float) -> Leftovers | None:
    """Returns a model's residual for a motion, or None if its solution is not finite."""
    answer = one.simulate(model)
    return None if answer is None else Leftovers.of(one, answer.at(one.t, clock_offset))


def driven_alike(motion: PreparedMotion, one: Model, other: Model) -> bool:
    """Returns whether input noise has practically the same effect in two models."""
    return one == other or (_swing_alike(one, other) and _moves_alike(motion, one, other))


def _moves_alike(motion: PreparedMotion, one: Model, other: Model) -> bool:
    """Returns whether noise changes the measured height of two models in the same direction."""
    if motion.azimuths is not None:
        return True
    liquids = [liquid_alone(one), liquid_alone(other)]
    heights, others = heights_of_liquids(liquids, [motion.fine, motion.fine])
    return bool(np.sum((heights - others) ** 2) < TUNING.same_size**2 * np.sum(heights**2))


def _swing_alike(one: Model, other: Model) -> bool:
    """Returns whether noise excites the modes of two models equally."""
    for mine, its, gain, its_gain in zip(
        one.mode_constants(), other.mode_constants(), one.height_gains(), other.height_gains(),
        strict=False,
    ):  # fmt: skip
        frequencies = mine.natural_frequency / its.natural_frequency
        sizes = (gain / its_gain, mine.damping_ratio / its.damping_ratio)
        if abs(math.log(frequencies)) > TUNING.same_frequency:
            return False
        if max(abs(math.log(size)) for size in sizes) > TUNING.same_size:
            return False
    return len(one.mode_constants()) == len(other.mode_constants())
