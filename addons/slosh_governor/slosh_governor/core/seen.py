"""Comparison of observed states of the liquid with the governor's own models."""

from __future__ import annotations

import cmath
import math
from collections import deque
from typing import NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_governor.core.commands import SeenLiquid
from slosh_governor.core.past import PastLiquid
from slosh_governor.core.unknown import wave_heights
from slosh_governor.tuning import TUNING
from slosh_model.layout import divided

MOST = 10.0
"""Displacement [m] and velocity [m/s] of a liquid that no container has."""
FACTORS = (0.5, 2.0)
"""Frequency factors that an observer may tell."""


class Look(NamedTuple):
    """One comparison: time [s], distance from the models [m], slow amplitudes of both (2,) [m]."""

    t: float
    distance: float
    own: Array
    seen: Array

    @property
    def apart(self) -> Array:
        """Slow amplitude (2,) by which they differ [m]."""
        found: Array = self.seen - self.own
        return found


class Witness:
    """Tells how far observed states are from the models, and whether the observer sees the liquid.

    An observer sees the liquid if its state changes as the models' do when the container drives
    them: a camera that is frozen, mirrored, turned, late or of another scale does not. Where the
    container hardly moves nothing is proven. Without measurements an observer is a model as the
    governor's: its state changes alike whatever the liquid does, so that nothing is proven either.

    Args:
        scale: (MODELS,) frequency factors of the models.
        wave: period of the first mode [s].
        limit: of the height [m].
    """

    def __init__(self, scale: Array, wave: float, limit: float) -> None:
        self._scale, self._wave, self._limit = scale, wave, limit
        self._looks: deque[Look] = deque()
        self._driven = self._missed = self._watched = self._least = 0.0

    def look(self, liquid: SeenLiquid, past: PastLiquid) -> float:
        """Compares an observed state with those of the models then.

        Args:
            liquid: the state.
            past: of the models.

        Returns:
            the height of the wave by which it differs from the nearest model [m]; NaN: it is of a
            time that the governor does not know.
        """
        stores = past.at(liquid.stamp_ns)
        if stores is None:
            return math.nan
        scales = (liquid.frequency_factor / self._scale) ** 2
        distance = float(wave_heights(stores, liquid.modal, scales).min())
        mode = divided(stores[0])[1][0]
        own = np.array([[mode["x"], mode["y"], mode["vx"], mode["vy"]]])
        t, omega = liquid.stamp_ns / SECOND, float(mode["natural_frequency"])
        turn = cmath.exp(-1j * math.fmod(omega * t, 2.0 * math.pi))
        gains = np.array([mode["height_gain"], mode["height_gain_y"]])
        slow = [
            turn * gains * (row[0, :2] - 1j * row[0, 2:] / omega)
            for row in (own, scales[0] * liquid.modal)
        ]
        if not liquid.uncorrected <= self._wave:
            self._forget()
        self._compare(Look(t, distance, *slow), liquid.stddev)
        return distance

    def _compare(self, look: Look, stddev: float) -> None:
        """Adds to the evidence how the models have changed in a period, and how differently both.

        Measurements of a motion come later than it, and an observer follows them gradually: until
        then it tells what its own model does. So the difference is taken some periods later, too.
        """
        looks = self._looks
        before = looks[-1].t if looks else look.t
        if not 0.0 <= look.t - before < self._wave:
            self._forget()
        looks.append(look)
        later = TUNING.answered * self._wave
        while len(looks) > 1 and looks[1].t <= look.t - later - self._wave:
            looks.popleft()
        if looks[0].t > look.t - later - self._wave:
            return
        moved = next(one for one in reversed(looks) if one.t <= look.t - later)
        step = look.t - before
        left = math.exp(-step / (TUNING.memory * self._wave))
        first = looks[0]
        driven = float((np.abs(moved.own - first.own) ** 2).sum())
        missed = max(float((np.abs(one.apart - first.apart) ** 2).sum()) for one in (moved, look))
        self._driven = left * self._driven + step * driven
        self._missed = left * self._missed + step * missed
        self._watched = left * self._watched + step
        self._least = max(TUNING.driven * self._limit, 4.0 * stddev)

    def _forget(self) -> None:
        """Forgets the evidence."""
        self._looks.clear()
        self._driven = self._missed = self._watched = 0.0

    @property
    def highest(self) -> float:
        """Height [m] of the wave that the models do not tell, at most; infinite: not proven."""
        share = TUNING.unlike
        if self._watched < self._wave:
            return math.inf
        if self._missed > share * share * self._driven:
            return math.inf
        if self._driven < self._watched * self._least**2:
            return math.inf
        return max(one.distance for one in self._looks) / (1.0 - share)


def refusal(liquid: SeenLiquid, modes: int, last_ns: int) -> str:
    """Returns why an observed state is not usable; empty: it is.

    Args:
        liquid: the state.
        modes: of the model.
        last_ns: stamp of the last one [ns].
    """
    modal = np.asarray(liquid.modal, dtype=np.float64)
    if modal.shape != (modes, 4):
        return f"a state of {modal.size // 4} modes, the model has {modes}"
    if not np.abs(modal).max() <= MOST:
        return "a modal state that is no number or that no liquid has"
    if not 0.0 <= liquid.stddev < math.inf:
        return f"msh_stddev = {liquid.stddev:g} m must not be negative"
    if not FACTORS[0] <= liquid.frequency_factor <= FACTORS[1]:
        return f"frequency_factor = {liquid.frequency_factor:g} must lie in 0.5 … 2"
    if liquid.stamp_ns <= last_ns:
        return "a stamp that is not after the last one"
    return ""
