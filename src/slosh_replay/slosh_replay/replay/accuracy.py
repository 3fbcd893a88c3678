"""Computes the accuracy of replayed estimates compared with measurements.

ε compares two maxima, and a single wrong sample can be the measured one. So samples that stand
out of both neighbours by more than 15 % of the range of the heights are left out of ε, as no
crest of sloshing that is sampled at 60 Hz does that; ε with them is given beside it. MAE and RMS
leave them out too; a handful of samples among hundreds does not move them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_estimator.sight import judged
from slosh_motion.signals.alignment import ClockOffset, find_spikes, spike_limit
from slosh_motion.signals.metrics import RunningAccuracy
from slosh_replay.replay.result import ModelAccuracy, MotionAccuracy
from slosh_replay.replay.series import Series

SAMPLED = 200_000
"""Heights that the limit of a spike is taken from."""


class Judgement(NamedTuple):
    """Accuracy of each model over all images of a run.

    Attributes:
        models: over the whole run.
        motions: over each motion.
        spikes: samples of the measurement that were left out.
        warning: why there is nothing to judge by; empty: there is.
    """

    models: tuple[ModelAccuracy, ...] = ()
    motions: tuple[MotionAccuracy, ...] = ()
    spikes: int = 0
    warning: str = ""


class _Sums:
    """Running accuracy over pairs of measured and estimated heights, with and without spikes."""

    def __init__(self) -> None:
        self.clean, self.raw = RunningAccuracy(), RunningAccuracy()

    def add(self, raw: Array, clean: Array, model: Array) -> None:
        """Adds heights (N,) [m] to the error sums; NaN marks a missing measurement or estimate."""
        self.raw.update_many(raw, model)
        self.clean.update_many(clean, model)

    def accuracy(self, name: str, clock: ClockOffset | None) -> ModelAccuracy:
        """Returns the accuracy of a model; its numbers are NaN without any pair of heights."""
        return ModelAccuracy(
            name=name,
            sigma=self.clean.sigma,
            epsilon=self.clean.epsilon,
            epsilon_raw=self.raw.epsilon,
            rms=self.clean.rms,
            count=self.clean.count,
            clock=clock,
        )


def judge(
    series: Series,
    names: Sequence[str],
    motions: Sequence[tuple[int, int]] = (),
    clocks: Sequence[ClockOffset] | None = None,
) -> Judgement:
    """Computes the accuracy of the models over the images of a run.

    As in the monitor, a saturated height is a lower bound and counts only above the estimate, and
    estimates from an unknown state do not count.

    Args:
        series: the images; their column `motion` numbers `motions`.
        names: of the models, in the order of the series' heights.
        motions: start and end of each motion [ns].
        clocks: offset of the measured clock by model; None: the clocks are one.
    """
    limit = _spike_limit(series)
    whole = [_Sums() for _ in names]
    by_motion = [[_Sums() for _ in names] for _ in motions]
    peaks = [math.nan] * len(motions)
    spikes = 0
    start = 0
    for block in series.blocks():
        raw, clean = _cleaned(series, start, block, limit)
        spikes += int(np.count_nonzero(np.isfinite(raw) & np.isnan(clean)))
        numbers = [n for n in np.unique(block["motion"]).tolist() if n >= 0]
        for number in numbers:
            within = clean[block["motion"] == number]
            peaks[number] = float(np.fmax(peaks[number], np.fmax.reduce(within)))
        for model in range(len(names)):
            height = block["heights"][:, model]
            counts = judged(raw, block["flags"], height, block["usable"])
            counted = np.where(counts, height, np.nan)
            whole[model].add(raw, clean, counted)
            for number in numbers:
                part = block["motion"] == number
                by_motion[number][model].add(raw[part], clean[part], counted[part])
        start += len(block)
    if not any(sums.clean.count for sums in whole):
        return Judgement(spikes=spikes, warning=_nothing(series))
    offsets: Sequence[ClockOffset | None] = clocks or [None] * len(names)
    return Judgement(
        tuple(s.accuracy(n, c) for s, n, c in zip(whole, names, offsets, strict=True)),
        tuple(
            MotionAccuracy(
                span[0] * 1e-9, span[1] * 1e-9, peak,
                tuple(s.accuracy(n, None) for s, n in zip(sums, names, strict=True)),
            )
            for span, peak, sums in zip(motions, peaks, by_motion, strict=True)
        ),
        spikes,
    )  # fmt: skip


def _nothing(series: Series) -> str:
    """Returns why no image can be compared with an estimate."""
    seen = estimated = False
    for block in series.blocks():
        known = np.isfinite(block["measured"])
        seen |= bool(known.any())
        estimated |= bool((known & np.isfinite(block["heights"]).any(axis=1)).any())
    if not seen:
        return "no image has a usable height; there is nothing to compare the models with"
    if not estimated:
        return "no image has an estimate at its stamp; do camera and estimator use the same clock?"
    return (
        "no MAE and ε: where heights were measured, the liquid's state was unknown or its line "
        "outside the picture"
    )


def _spike_limit(series: Series) -> float:
    step = max(1, -(-len(series) // SAMPLED))
    parts = [block["measured"][::step] for block in series.blocks()]
    return spike_limit(np.concatenate(parts)) if parts else math.inf


def _cleaned(
    series: Series, start: int, block: NDArray[np.void], limit: float
) -> tuple[Array, Array]:
    """Returns a block's measured heights, with and without spikes."""
    # At its ends the neighbours beyond decide.
    first, last = max(start - 1, 0), min(start + len(block) + 1, len(series))
    around = series.read(first, last)["measured"]
    inside = slice(start - first, start - first + len(block))
    raw = block["measured"]
    return raw, np.where(find_spikes(around, limit)[inside], np.nan, raw)
