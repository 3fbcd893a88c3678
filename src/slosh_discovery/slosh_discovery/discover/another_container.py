"""Whether the measured liquid swings at quite another frequency than the model's.

A model of another container is wrong in everything at once, and a few effects can make something
of any wave. So before they are named, the model's own motion at other frequencies is laid over the
heights: where one far off is clearly more alike, the container is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slosh_discovery.discover.fitting import Fit
from slosh_discovery.discover.problem import PreparedMotion, simulate_all

EFFECT = "frequency_mismatch"
FACTORS = np.geomspace(0.5, 2.0, 49)
"""Of the model's frequencies that are tried."""
FAR = 1.2
"""Fill, tension and walls shift a frequency by less than this factor."""
NEAR = 1.1
"""About the model's frequency the heights are compared with within this factor."""
ALIKE = 0.5
"""Share of the heights' power that a wave at the right frequency explains."""
CLEARLY = 0.5
"""What it leaves is at most this share of what the best one near the model's frequency does."""


@dataclass(frozen=True, slots=True)
class OtherFrequency:
    """Where the liquid swings.

    Attributes:
        expected: the model's first natural frequency [Hz].
        seen: that of the heights [Hz].
    """

    expected: float
    seen: float

    def text(self) -> str:
        """The question, in a sentence."""
        apart = 100.0 * (self.seen / self.expected - 1.0)
        return (
            f"Is this the container? The liquid swings at {self.seen:.2f} Hz, the model's at "
            f"{self.expected:.2f} Hz ({apart:+.0f} %): compare shape, size and fill height with "
            "the model, and the unit of time with the data; then run this again."
        )


def other_frequency(base: Fit, motions: Sequence[PreparedMotion]) -> OtherFrequency | None:
    """Another frequency that the heights clearly show; None: there is none.

    Args:
        base: the model as it is, with the motions' clock offsets.
        motions: the data.
    """
    model = base.model
    if model.has(EFFECT):
        return None
    left = np.array([_unlike(base, motions, float(factor)) for factor in FACTORS])
    best = int(np.argmin(left))
    near = np.abs(np.log(FACTORS)) <= math.log(NEAR)
    far = abs(math.log(FACTORS[best])) > math.log(FAR)
    if not far or left[best] > min(1.0 - ALIKE, CLEARLY * float(left[near].min())):
        return None
    first = model.mode_constants()[0].natural_frequency / (2.0 * math.pi)
    return OtherFrequency(first, first * float(FACTORS[best]))


def _unlike(base: Fit, motions: Sequence[PreparedMotion], factor: float) -> float:
    """Share of the heights' power that waves at another frequency leave, each motion's as high."""
    models = [
        base.model_of(one.motion.group).with_effect(EFFECT, factor=factor) for one in motions
    ]
    answers = simulate_all(list(zip(models, motions, strict=True)))
    left, power = 0.0, 0.0
    for one, answer, offset in zip(motions, answers, base.clock_offsets, strict=True):
        heights = one.heights[one.kept]
        heights = heights if one.motion.level_known else heights - heights.mean()
        power += float(heights @ heights)
        left += float(heights @ heights)
        if answer is None:
            continue
        wave = answer.at(one.t, offset)[one.kept]
        wave = wave if one.motion.level_known else wave - wave.mean()
        size = float(wave @ wave)
        left -= max(float(wave @ heights), 0.0) ** 2 / size if size > 0.0 else 0.0
    return left / power if power > 0.0 else 1.0
