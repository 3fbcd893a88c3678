"""Detects a wave that only the measurement or only the estimate shows.

A dead accelerometer moves nothing: no motion begins for the model, and what the camera sees of the
liquid is compared with nothing. Here it is the liquid that moves, on either side, and time that
ends a judgement. Only waves that are all but missing are told: how far two waves differ is asked
motion by motion, since a model's phase is lost long before the liquid is at rest.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_estimator.tuning import TUNING

Waves = NDArray[np.complex128]
NAN = float("nan")


class Pair(NamedTuple):
    """Measured and estimated liquid height at the same time.

    Attributes:
        stamp_ns: [ns].
        measured, stddev, estimated: heights [m]; the standard deviation may be NaN.
        wave, expected: measured and estimated wave as vectors [m]; NaN: unknown.
        axis: of `azimuth.measured_waves`.
    """

    stamp_ns: int
    measured: float
    stddev: float
    estimated: float
    wave: complex = complex(NAN, NAN)
    expected: complex = complex(NAN, NAN)
    axis: float = NAN


class PresenceWatch:
    """Checks whether both measurement and estimate show a wave.

    Args:
        limit: disagreement that is watched [m]; NaN or infinite: none.

    Attributes:
        warning: which side lacks the wave, in one line; empty: none does, as far as is known.
    """

    def __init__(self, limit: float = NAN) -> None:
        self.warning = ""
        self.watch(limit)
        self._pairs: list[Pair] = []
        self._before = (math.inf, math.inf)

    def watch(self, limit: float) -> None:
        """Sets the height limit [m]; a share of it is the least wave height that counts."""
        self._least = TUNING.presence_share * limit if math.isfinite(limit) else TUNING.least_wave

    def reset(self) -> None:
        """Forgets all pairs of heights and the warning."""
        self.warning = ""
        self.forget()

    def forget(self) -> None:
        """Forgets the pairs of heights since the last judgement."""
        self._pairs.clear()
        self._before = (math.inf, math.inf)

    def add(self, pair: Pair) -> None:
        """Adds a measured and an estimated height of the same time."""
        if (
            self._pairs
            and not 0 <= pair.stamp_ns - self._pairs[0].stamp_ns <= TUNING.presence_longest_ns
        ):
            self.forget()
        self._pairs.append(pair)
        long = pair.stamp_ns - self._pairs[0].stamp_ns >= TUNING.judged_ns
        if long and len(self._pairs) >= TUNING.least_compared:
            self._judge()
            self._pairs.clear()

    def _judge(self) -> None:
        _, measured, stddev, estimated, wave, expected, axis = map(
            np.array, zip(*self._pairs, strict=True)
        )
        known = stddev[np.isfinite(stddev)]
        noise = float(np.sqrt(np.mean(known**2))) if len(known) else 0.0
        along = in_view(expected, axis)
        both = np.isfinite(wave) & np.isfinite(along)
        if np.count_nonzero(both) >= TUNING.least_compared:
            seen, told = _size(wave[both]), _size(along[both])
        else:
            seen, told = _size(measured), _size(estimated)
        before, self._before = self._before, (seen, told)
        if max(seen, told) <= max(TUNING.wave_noise * noise, self._least):
            return
        if min(seen, told) >= TUNING.missing * max(seen, told):
            self.warning = ""
        elif seen > told and seen >= TUNING.sustained * before[0]:
            self.warning = _not_expected(measured, estimated, none=told < TUNING.nothing * seen)
        elif told > seen and told >= TUNING.sustained * before[1]:
            self.warning = (
                f"the model expects a wave of {_crest(estimated):.1f} mm, but the camera sees "
                "none: check that it sees the moving container and sends new images"
            )


def in_view(expected: Waves, axis: Array) -> Waves:
    """Projects modelled waves on the horizontal image direction, which the camera can see.

    Args:
        expected: (N,) vectors of the waves [m].
        axis: (N,) of `azimuth.measured_waves`.
    """
    side = np.isfinite(axis)
    right = np.exp(1j * np.where(side, axis, 0.0))
    return np.where(side, np.real(expected * np.conj(right)) * right, expected)


def _not_expected(measured: Array, estimated: Array, *, none: bool) -> str:
    sees = f"the camera sees a wave of {_crest(measured):.1f} mm while the"
    if none:
        return f"{sees} estimator's input shows no motion: check the accelerometer"
    return (
        f"{sees} model expects {_crest(estimated):.1f} mm: check the accelerometer's unit and "
        "range, and the model's container"
    )


def _crest(heights: Array) -> float:
    """Returns the 95 % quantile of heights [mm], so that single spikes do not count."""
    return 1e3 * float(np.quantile(heights, 0.95))


def _size(values: NDArray[Any]) -> float:
    """Returns the median distance [m] of heights or wave vectors from their median."""
    middle = np.median(values.real) + 1j * np.median(values.imag)
    return float(np.median(np.abs(values - middle)))
