"""Simulates how a camera measures the heights of a test case: times, losses and errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.motion import MeasuredMotion
from slosh_model.simulate import Inputs
from validation.blind.dirt import Dirt
from validation.blind.hidden import Hidden
from validation.blind.truth import heights
from validation.blind.truth_model import Truth

Array = NDArray[np.float64]
Random = np.random.Generator
FRAME_RATE = 60.0
TAIL = 0.1
"""The camera stops so long before the inputs do: a late clock sees nothing beyond them [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """How the heights of a test case are measured: azimuths, losses, clock, zero, noise.

    Attributes:
        azimuths: (K,) [rad] of the wall heights; None: MSH.
        lost: share of frames without a sample.
        phase: of the first frame [s].
        clock: added to the heights' clock [s]; None: the inputs' clock.
        level: added to the heights [m]; None: the still level is known.
        stddev_told: whether the sensor states its standard deviation.
        noise: standard deviation of the noise [m].
        dirt: how else the record errs; None: its noise is white, and that is all.
    """

    azimuths: Array | None
    lost: float
    phase: float
    clock: float | None
    level: float | None
    stddev_told: bool
    noise: float = 0.0
    dirt: Dirt | None = None

    @classmethod
    def draw(cls, random: Random, traits: Sequence[Hidden]) -> Record:
        """Draws a way of measuring in which the hidden effects are visible."""
        kinds: list[int] = [0, 0, 0, 0, 12, 36]
        count = int(random.choice(kinds))
        if any(trait.msh_only for trait in traits):
            count = 0
        clock = random.uniform(-0.4, 0.4) if random.random() < 0.12 else None
        level = random.uniform(-0.005, 0.005) if random.random() < 0.12 else None
        return cls(
            np.radians(np.arange(0, 360, 360 // count)) if count else None,
            0.0 if random.random() < 0.5 else random.uniform(0.0, 0.05),
            random.uniform(0.0, 1.0 / FRAME_RATE),
            None if any(trait.own_clock for trait in traits) else clock,
            None if any(trait.own_level for trait in traits) else level,
            bool(random.random() < 0.5),
        )

    @property
    def sensor(self) -> str:
        """Describes what is measured: `msh`, or the number of azimuths."""
        return "msh" if self.azimuths is None else f"{len(self.azimuths)} azimuths"

    def times(self, inputs: Inputs) -> Array:
        """Returns the image times (M,) on the inputs' clock [s]."""
        first, last = inputs.t[0] + self.phase, inputs.t[-1] - TAIL
        return np.asarray(first + np.arange(int((last - first) * FRAME_RATE)) / FRAME_RATE)

    def change(
        self, truth: Truth, lacking: Truth, motions: Sequence[Inputs], sessions: Array
    ) -> float:
        """Returns the rms difference of two simulated liquids' heights over all samples [m]."""
        squares = []
        for inputs, session in zip(motions, sessions, strict=True):
            at = self.times(inputs)
            both = [heights(each, inputs, at, self.azimuths, session) for each in (truth, lacking)]
            squares.append((both[0] - both[1]) ** 2)
        return float(np.sqrt(np.mean(np.concatenate(squares))))

    def driven(
        self, truth: Truth, motions: Sequence[Inputs], felt: Sequence[Inputs], sessions: Array
    ) -> float:
        """Returns the rms height error [m] that errors of the inputs cause in a model."""
        if self.dirt is None or self.dirt.input_noise == 0.0:
            return 0.0
        squares = []
        for inputs, other, session in zip(motions, felt, sessions, strict=True):
            at = self.times(inputs)
            both = [heights(truth, each, at, self.azimuths, session) for each in (inputs, other)]
            squares.append((both[0] - both[1]) ** 2)
        return float(np.sqrt(np.mean(np.concatenate(squares))))


def record(
    random: Random, truth: Truth, inputs: Inputs, how: Record, name: str, session: float
) -> MeasuredMotion:
    """Simulates the measurement of a motion and returns it."""
    at = how.times(inputs)
    seen = heights(truth, inputs, at, how.azimuths, session)
    errors = random.normal(0.0, how.noise, seen.shape)
    lost = random.random(len(at)) < how.lost
    if how.dirt is not None:
        # Of its own random numbers: what follows is as in the clean case.
        own = random.spawn(1)[0]
        at = at + how.dirt.late(own, len(at))
        errors = how.dirt.errors(own, seen.shape, how.noise)
        lost = how.dirt.missing(own, len(at))
        inputs = how.dirt.sampled(own, inputs)
    seen = seen + errors + (how.level or 0.0)
    seen[lost] = np.nan
    return MeasuredMotion(
        name,
        inputs,
        at + (how.clock or 0.0),
        msh=seen[:, 0] if how.azimuths is None else None,
        eta_azimuth=how.azimuths,
        eta=None if how.azimuths is None else seen,
        stddev=np.full(len(at), how.noise) if how.stddev_told else None,
        same_clock=how.clock is None,
        level_known=how.level is None,
    )
