"""Waves that may be in the containers beside those that the governor's models compute.

A liquid whose state was not known at the start, or has become unknown, may have a free wave
beside the computed one. Of it a bound is known, and that it oscillates and decays. The bound is an
ellipse of displacement and velocity: vertical accelerations, which pump waves, change it as they
change the wave. A shift is a wave of which direction and time are known, and the most of its size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum

import numpy as np
from numba.types import float64, void

from slosh_base.compiled.compilation import (
    CHANGED_3,
    GIVEN_1,
    GIVEN_2,
    GIVEN_3,
    entry_point,
)
from slosh_base.types import Array
from slosh_governor.core.commands import ModelDoubt
from slosh_governor.core.cups import Cup
from slosh_governor.tuning import TUNING
from slosh_model.constants import GRAVITY
from slosh_model.layout import MODE, divided
from slosh_model.simulate import store_of

SOFTEST = 0.05
"""Least gravity in a falling container, of g: below it the wave hardly moves."""


class Cause(StrEnum):
    """Why the state of a liquid is not known."""

    NONE = ""
    START = "the liquid's state at the start is not known"
    LATE = "steps came late or early"
    CLOCK = "the clock jumped, went back or stood still"
    FUSED = "fused_estimate differs from the model"
    MOVED = "the container was moved by others"


class UnknownWave:
    """Bounds of the unknown waves of all containers.

    Args:
        cups: the containers.
        doubt: by how much the liquids may differ from the models.

    Attributes:
        heights: (C,) of the unknown waves, at most [m].
        largest: (C,) heights of the largest free waves that the containers hold [m].
        cause: why there is one; of several that of the largest.
    """

    def __init__(self, cups: Sequence[Cup], doubt: ModelDoubt) -> None:
        factors = (1.0 - doubt.frequency, 1.0, 1.0 + doubt.frequency)
        own = [
            [mode.natural_frequency * k for mode in cup.model.mode_constants() for k in factors]
            for cup in cups
        ]
        most = max(map(len, own))
        self._omega = np.array([(row * most)[:most] for row in own])
        self._decay = np.array(
            [
                min(m.damping_ratio * m.natural_frequency for m in cup.model.mode_constants())
                for cup in cups
            ]
        ) * factors[0] / doubt.damping  # fmt: skip
        runs = [divided(store_of(cup.model))[0][0] for cup in cups]
        self._lift = np.array([float(run["lift"]) for run in runs])
        self._gains = np.array([cup.gains for cup in cups])
        self.largest = np.array([largest_wave(cup) for cup in cups])
        self._ellipse = np.zeros((*self._omega.shape, 3))
        # Displacement along x, its velocity by the frequency, the same along y.
        self._shift = np.zeros((*self._omega.shape, 4))
        self.heights, self.cause = np.zeros(len(cups)), Cause.NONE

    def waited(self, seconds: float) -> Array:
        """Returns the heights (C,) to which the largest waves decay in a time [m]."""
        found: Array = self.largest * np.exp(-self._decay * seconds)
        return found

    def advance(self, seconds: float, vertical: Array) -> None:
        """Advances the waves by a time [s] with vertical accelerations (C,) [m/s²]."""
        if not self.heights.any():
            return
        advanced(
            self._ellipse, self._shift, self._omega, self._decay, self._lift, vertical, seconds
        )
        self._measure()

    def add(self, heights: Array, cause: Cause) -> None:
        """Adds waves of heights (C,) [m] and any phase; together not above the largest ones."""
        if not heights.any():
            return
        self._because(heights, cause)
        size = self._radius()
        for cup in np.flatnonzero(heights > 0.0):
            more, own = heights[cup], np.maximum(size[cup], 1e-12)
            self._ellipse[cup] *= (1.0 + more / own)[:, np.newaxis]
            self._ellipse[cup, :, ::2] += ((1.0 + own / more) * more * more)[:, np.newaxis]
        self._measure()
        for cup in np.flatnonzero(self.heights > self.largest):
            self.bound(int(cup), float(self.largest[cup]), self.cause)

    def shift(self, moved: Array, cause: Cause) -> None:
        """Adds the waves of displacements (C, 2) [m], each at most as large as given."""
        self._because(np.abs(moved).max(axis=1), cause)
        self._shift[:, :, ::2] += (self._gains * moved)[:, np.newaxis]
        self._measure()
        for cup in np.flatnonzero(self.heights > self.largest):
            self.bound(int(cup), float(self.largest[cup]), self.cause)

    def turned(self, seconds: float) -> Array:
        """Returns by how much (C,) [m] the shifts change at most within a time [s]."""
        size = np.sqrt((self._shift**2).sum(axis=-1))
        found: Array = (chord(self._omega * seconds) * size).max(axis=1)
        return found

    def bound(self, cup: int, height: float, cause: Cause) -> None:
        """Replaces what may be in a container by any wave up to a height [m]."""
        if height > self.heights[cup]:
            self.cause = cause
        self._ellipse[cup] = height * height * np.array([1.0, 0.0, 1.0])
        self._shift[cup] = 0.0
        self._measure()

    def _because(self, heights: Array, cause: Cause) -> None:
        if (heights >= self.heights).any():
            self.cause = cause

    def _radius(self) -> Array:
        p, q, r = np.moveaxis(self._ellipse, -1, 0)
        found: Array = np.sqrt(0.5 * (p + r) + np.sqrt(0.25 * (p - r) ** 2 + q * q))
        return found

    def _measure(self) -> None:
        heights = measured(self._ellipse, self._shift)
        heights[heights < TUNING.still] = 0.0
        self.heights = heights
        if not heights.any():
            self._ellipse[:], self._shift[:], self.cause = 0.0, 0.0, Cause.NONE


@entry_point(void(CHANGED_3, CHANGED_3, GIVEN_2, GIVEN_1, GIVEN_1, GIVEN_1, float64))
def advanced(ellipses, shifts, omega, decay, lift, vertical, seconds):  # type: ignore[no-untyped-def]
    """Advances unknown waves, each as a free wave of one frequency.

    Args:
        ellipses: (C, V, 3) of displacement and velocity by the frequency; changed.
        shifts: (C, V, 4) the same along x and y; changed.
        omega: (C, V) frequencies [rad/s].
        decay, lift: (C,) rates of decay [1/s]; 1 where the vertical acceleration acts.
        vertical: (C,) acceleration [m/s²].
        seconds: time [s].
    """
    for n in range(omega.shape[0]):
        soft = math.sqrt(max(1.0 + lift[n] * vertical[n] / GRAVITY, SOFTEST))
        left = math.exp(-decay[n] * seconds)
        for k in range(omega.shape[1]):
            angle = omega[n, k] * soft * seconds
            a, b = left * math.cos(angle), left * math.sin(angle) / soft
            c = -left * math.sin(angle) * soft
            p, q, r = ellipses[n, k, 0], ellipses[n, k, 1], ellipses[n, k, 2]
            ellipses[n, k, 0] = a * a * p + 2.0 * a * b * q + b * b * r
            ellipses[n, k, 1] = a * c * p + (a * a + b * c) * q + a * b * r
            ellipses[n, k, 2] = c * c * p + 2.0 * a * c * q + a * a * r
            for axis in range(0, 4, 2):
                x, v = shifts[n, k, axis], shifts[n, k, axis + 1]
                shifts[n, k, axis], shifts[n, k, axis + 1] = a * x + b * v, c * x + a * v


@entry_point(float64[::1](GIVEN_3, GIVEN_3))
def measured(ellipses, shifts):  # type: ignore[no-untyped-def]
    """Returns the heights (C,) [m] of unknown waves at most; arguments as `advanced`."""
    heights = np.zeros(ellipses.shape[0])
    for n in range(ellipses.shape[0]):
        for k in range(ellipses.shape[1]):
            p, q, r = ellipses[n, k, 0], ellipses[n, k, 1], ellipses[n, k, 2]
            size = math.sqrt(0.5 * (p + r) + math.sqrt(0.25 * (p - r) * (p - r) + q * q))
            square = 0.0
            for axis in range(4):
                square += shifts[n, k, axis] * shifts[n, k, axis]
            heights[n] = max(heights[n], size + math.sqrt(square))
    return heights


def largest_wave(cup: Cup) -> float:
    """Returns the height [m] of the largest free wave that a container holds.

    At its crest the surface falls with g at most (Taylor 1953); what is higher breaks. What is
    above the rim flows out.
    """
    rim = cup.model.container.height_below_rim()
    steepest = GRAVITY / cup.model.mode_constants()[0].natural_frequency ** 2
    return steepest if rim is None else min(rim, steepest)


def wave_heights(
    stores: Array,
    modal: Array | None = None,
    scales: Array | None = None,
    *,
    seconds: float | None = None,
) -> Array:
    """Returns the heights (M,) [m] that free waves of models may reach, or of their difference.

    Args:
        stores: (M, …) of the models of a container.
        modal: (modes, 4) x, y, vx, vy of the masses from which the difference is taken; None: 0.
        scales: (M,) factors of it for each model.
        seconds: the difference is that from the waves up to this time [s] later.
    """
    runs, own = divided(stores[0])
    modes = np.ascontiguousarray(stores[:, -len(own) * MODE.itemsize // 8 :]).view(MODE)
    run = runs[0]
    other = np.zeros((1, 4)) if modal is None else modal
    factor = np.ones((len(stores), 1)) if scales is None else scales[:, np.newaxis]
    omega, ratio = modes["natural_frequency"], modes["frequency_ratio"]
    x = np.hypot(factor * other[:, 0] - modes["x"], (factor * other[:, 2] - modes["vx"]) / omega)
    y = np.hypot(
        factor * other[:, 1] - modes["y"], (factor * other[:, 3] - modes["vy"]) / (omega * ratio)
    )
    x, y = modes["height_gain"] * x, modes["height_gain_y"] * y
    if seconds is not None:
        x, y = x * chord(omega * seconds), y * chord(omega * ratio * seconds)
    plain = run["cornered"] == 0.0 and run["corner_count"] == 0.0
    found: Array = (np.hypot(x, y) if plain else x + y).sum(axis=1)
    return found


def chord(angles: Array) -> Array:
    """Returns the greatest change of a unit vector that turns by up to angles [rad]."""
    found: Array = 2.0 * np.sin(0.5 * np.minimum(angles, math.pi))
    return found
