"""Compares the directions of the measured and the estimated wave in the container.

A sensor or a camera that is turned about the container's axis gives the right heights on the wrong
side. A wave is compared as a vector, height times the direction of the highest place: that vector
passes through zero where a planar wave changes its side, and so does not jump as the azimuth does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_estimator.sight import SATURATED, UNUSABLE, SurfaceFlag
from slosh_estimator.tuning import TUNING
from slosh_estimator.wave_presence import in_view

Waves = NDArray[np.complex128]

_NO_DIRECTION = UNUSABLE | SATURATED | int(SurfaceFlag.AMBIGUOUS)


class WaveOffset(NamedTuple):
    """Angle from the estimated to the measured wave, with its uncertainty.

    Attributes:
        turn: measured minus estimated azimuth [rad], in (-pi, pi].
        stddev: its standard deviation [rad].
        delay: time offset that explains the waves nearly as well [s]; NaN: none does.
    """

    turn: float
    stddev: float
    delay: float = math.nan

    @property
    def disagrees(self) -> bool:
        """Whether the angle between the waves is large and statistically significant."""
        return (
            abs(self.turn) >= TUNING.least_turn
            and abs(self.turn) > TUNING.turn_noise * self.stddev
        )

    @property
    def sentence(self) -> str:
        """Describes in one line the likely fault of the set-up and its remedy."""
        late = (
            ""
            if math.isnan(self.delay)
            else (
                f"; a time offset of {1e3 * self.delay:+.0f} ms between the two has the "
                "same effect"
            )
        )
        return (
            f"the measured wave's azimuth is {math.degrees(abs(self.turn)):.0f} degrees from the "
            "estimated one: check the yaw in sensor_rotation, or the camera's azimuth in "
            f"camera.yaml{late}"
        )


class Surfaces(NamedTuple):
    """Fields of FreeSurface.msg on the wave's direction: arrays (N,) or single numbers."""

    msh: Array
    azimuth: Array
    fitted_msh: Array
    fitted_azimuth: Array
    sh_left: Array
    sh_right: Array
    azimuth_right: Array
    slope_angle: Array
    flags: NDArray[np.int64]

    @property
    def levels(self) -> Array:
        """Mean of the wave heights at the left and right edge of the camera image (N,) [m]."""
        return 0.5 * (np.asarray(self.sh_left) + np.asarray(self.sh_right))


def measured_waves(surfaces: Surfaces) -> tuple[Waves, Array]:
    """Returns the waves that a camera measured as complex numbers: height and azimuth.

    The fitted surface tells the direction, since the camera sees part of the wall only; without a
    fit the highest point that is seen does, unless part of the line is hidden. A side view tells
    the component in the image plane alone.

    Args:
        surfaces: of N images.

    Returns:
        (N,) height times the unit vector of the azimuth [m]; NaN: unknown.
        (N,) azimuth of the image plane's right, of side views [rad]; NaN: of other views.
    """
    columns = [np.atleast_1d(np.asarray(column, dtype=np.float64)) for column in surfaces[:-1]]
    msh, azimuth, fitted, fitted_azimuth, left, right, axis, slope = columns
    flags = np.atleast_1d(np.asarray(surfaces.flags, dtype=np.int64))
    # What is zero exactly was not measured: a publisher has left the message's default.
    hidden = ((flags & int(SurfaceFlag.OCCLUDED)) != 0) | ((azimuth == 0.0) & (fitted == 0.0))
    seen = np.where(hidden, np.nan, msh) * np.exp(1j * azimuth)
    whole = np.where(fitted == 0.0, np.nan, fitted) * np.exp(1j * fitted_azimuth)
    waves = np.where(np.isfinite(whole), whole, seen)
    side = np.isfinite(slope) & ((slope != 0.0) | (left != 0.0) | (right != 0.0))
    waves = np.where(side, 0.5 * (right - left) * np.exp(1j * axis), waves)
    waves[(flags & _NO_DIRECTION) != 0] = complex(np.nan, np.nan)
    return waves, np.where(side, axis, np.nan)


def wave_offset(
    seconds: Array, measured: Waves, expected: Waves, axis: Array, noise: float
) -> WaveOffset | None:
    """Computes the angle [rad] between the measured and the estimated wave of a motion.

    The turn is that of the least-squares rotation between the two, its error that of a jackknife
    over stretches of time. It is zero where a time offset explains the waves as well.

    Args:
        seconds: (N,) increasing [s].
        measured, expected: (N,) vectors of the waves [m]; NaN: unknown.
        axis: (N,) of `measured_waves`.
        noise: standard deviation of the measured heights [m]; NaN: unknown.

    Returns:
        the turn; None: the waves are too low, too short or too unlike to tell it.
    """
    known = np.isfinite(measured) & np.isfinite(expected)
    if np.count_nonzero(known) < 2 * TUNING.least_blocks:
        return None
    seconds, measured, expected = (
        seconds[known] - seconds[known][0],
        measured[known],
        expected[known],
    )
    high = max(TUNING.least_wave, TUNING.wave_noise * noise if math.isfinite(noise) else 0.0)
    if min(_rms(measured), _rms(expected)) < high:
        return None
    if np.isfinite(axis[known]).all():
        along = in_view(expected, axis[known])
        if np.vdot(along, along).real < TUNING.across * np.vdot(measured, measured).real:
            ratio = min(_rms(along) / _rms(expected), 1.0)
            return WaveOffset(math.acos(ratio), noise / _rms(measured) if noise == noise else 0.0)
        expected = along
    return _turn(seconds, measured, expected)


def _turn(seconds: Array, measured: Waves, expected: Waves) -> WaveOffset | None:
    """Returns the angle [rad] between measured and modelled wave, or None if it is uncertain."""
    # A rotary wave that comes late looks turned; a planar one half a period late, by 180 degrees.
    reach = round(TUNING.offset_far / TUNING.offset_step)
    lags = np.arange(-reach, reach + 1) * TUNING.offset_step
    products, energies = zip(
        *(_products(seconds, measured, expected, lag) for lag in lags.tolist()), strict=True
    )
    table, energy = np.array(products), np.array(energies)
    total = table.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        turned = np.where(energy > 0.0, np.abs(total) ** 2 / energy, 0.0)
        late = np.where(energy > 0.0, np.maximum(total.real, 0.0) ** 2 / energy, 0.0)
    best = int(np.argmax(np.where(np.abs(lags) <= TUNING.offset_near + 1e-9, turned, -1.0)))
    blocks = table[best][table[best] != 0.0]
    if turned[best] < TUNING.least_coherence or len(blocks) < TUNING.least_blocks:
        return None
    gain = float(turned[best] - late.max())
    if gain < TUNING.least_gain:
        return WaveOffset(0.0, 0.0)
    delay = float(lags[np.argmax(late)]) if gain < TUNING.clear_gain else math.nan
    turn = float(np.angle(blocks.sum()))
    without = np.angle((blocks.sum() - blocks) * np.exp(-1j * turn))
    spread = math.sqrt((len(blocks) - 1) / len(blocks) * float(np.sum(without**2)))
    return WaveOffset(turn, spread, delay)


def _products(seconds: Array, measured: Waves, expected: Waves, lag: float) -> tuple[Waves, float]:
    """Returns products of measured and delayed modelled wave per time block, and their energy."""
    moments = seconds - lag
    after = np.clip(np.searchsorted(seconds, moments), 1, len(seconds) - 1)
    inside = (moments >= seconds[0]) & (moments <= seconds[-1])
    inside &= seconds[after] - seconds[after - 1] <= TUNING.image_gap
    shifted = np.where(inside, np.interp(moments, seconds, expected), 0.0)
    seen = np.where(inside, measured, 0.0)
    product = seen * np.conj(shifted)
    number = (seconds // TUNING.error_block).astype(np.int64)
    sums = np.bincount(number, product.real) + 1j * np.bincount(number, product.imag)
    energy = float(np.vdot(seen, seen).real * np.vdot(shifted, shifted).real)
    return sums, energy


def _rms(waves: Waves) -> float:
    return float(np.sqrt(np.mean(np.abs(waves) ** 2)))
