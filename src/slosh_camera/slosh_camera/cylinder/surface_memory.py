"""Predicts the first mode in the next image from the images before it.

The first mode's crest at the wall is a vector q, its heights at +x and +y. Left alone it swings,
q'' = -ω² q [DL22, eq. (12)], and an acceleration a of the container adds 4hm/(m_F R) a to q''. So
two images foretell the third, to what the unknown acceleration may do meanwhile.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.surface import USUAL_FADE, FadeShare
from slosh_camera.cylinder.tuning import TUNING
from slosh_model.bessel import bessel_derivative_root
from slosh_model.constants import GRAVITY

FloatArray = NDArray[np.float64]

_ROOT = bessel_derivative_root(1)
# A period lasts for more than four images: so few surfaces, which come in turn so often, are old
# pictures.
_IN_TURN = (2, 3)


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedMode:
    """Predicted first-mode amplitudes in the next image.

    Attributes:
        first: (2,) heights at +x and at +y above rest [m].
        stddev: of each [m].
    """

    first: FloatArray
    stddev: float

    def distance(self, first: FloatArray) -> float:
        """Returns a first mode's (2,) distance from the prediction in standard deviations."""
        return float(np.hypot(*(first - self.first))) / self.stddev

    def surprise(self, first: FloatArray) -> float:
        """Returns the score penalty for a first mode (2,) [m] far from the prediction.

        It grows slowly and not without end: a picture that is clear enough always wins.
        """
        distance = min(self.distance(first), TUNING.farthest)
        return TUNING.memory_surprise * float(np.log1p(distance**2))


class SurfaceMemory:
    """Stores the first mode's amplitudes in recent images, to predict the next ones."""

    def __init__(self, radius: float, fill_height: float) -> None:
        """Starts with an empty memory, before the first image.

        Args:
            radius: of the container [m].
            fill_height: of the liquid [m].
        """
        depth = np.tanh(_ROOT * fill_height / radius)
        self._radius = radius
        self._frequency = float(np.sqrt(GRAVITY * _ROOT / radius * depth))
        self._gain = 8.0 * float(depth) / (_ROOT * (_ROOT**2 - 1.0))
        self.forget()

    def forget(self) -> None:
        """Forgets the first-mode amplitudes of all earlier images."""
        self._seen: tuple[tuple[int, FloatArray], ...] = ()
        self._decided = 0
        self._fade = USUAL_FADE
        self._stands: tuple[int, FloatArray] | None = None
        self._recent: deque[FloatArray] = deque(maxlen=max(_IN_TURN) * TUNING.turns)

    @property
    def repeats(self) -> bool:
        """Whether recent images alternate between a few surfaces, as repeated old images do."""
        newest = list(reversed(self._recent))
        return any(
            len(newest) >= count * TUNING.turns
            and _spread(newest[:count]) > TUNING.crest
            and all(
                _spread(newest[k : count * TUNING.turns : count]) < TUNING.stands
                for k in range(count)
            )
            for count in _IN_TURN
        )

    @property
    def crest_stands(self) -> bool:
        """Whether a wave crest has stayed in place for two periods or more, as no wave does."""
        if self._stands is None or not self._seen:
            return False
        since_ns, first = self._stands
        phase = self._frequency * 1e-9 * (self._seen[-1][0] - since_ns)
        return phase > TUNING.stood and float(np.hypot(*first)) > TUNING.crest

    @property
    def fade(self) -> FadeShare:
        """Estimated degree to which this liquid's wave crests fade into the background."""
        return self._fade

    def arrive(self, stamp_ns: int) -> None:
        """Forgets earlier images if the next image's stamp [ns] is earlier than theirs."""
        if self._seen and stamp_ns < self._seen[-1][0]:
            self.forget()

    def expected(self, stamp_ns: int) -> ExpectedMode | None:
        """Predicts the first mode at a stamp [ns]; None without a recent earlier image.

        A gap, and a stamp that repeats or runs back, leave nothing to go by.
        """
        if not self._seen:
            return None
        last_ns, last = self._seen[-1]
        ahead = self._time(last_ns, stamp_ns)
        if np.isnan(ahead):
            return None
        measured = TUNING.measured * self._radius
        phase = self._frequency * ahead
        pushed = self._gain * TUNING.acceleration
        if len(self._seen) == 1:
            size = max(TUNING.amplitude * self._radius, float(np.hypot(*last)))
            spread = np.linalg.norm((measured, size * np.sin(phase), 0.5 * pushed * ahead**2))
            return ExpectedMode(last * np.cos(phase), float(spread))
        before_ns, before = self._seen[0]
        ago = self._time(before_ns, last_ns)
        ratio = np.sin(phase) / np.sin(self._frequency * ago)
        swung = np.cos(phase) + np.cos(self._frequency * ago) * ratio
        spread = np.linalg.norm(
            (measured * swung, measured * ratio, measured, 0.5 * pushed * ahead * (ahead + ago))
        )
        return ExpectedMode(last * swung - before * ratio, float(spread))

    def remember(
        self, stamp_ns: int, first: FloatArray, fade: FadeShare, *, decided: bool, jumped: bool
    ) -> None:
        """Stores the first mode that was measured in an image.

        Args:
            stamp_ns: its moment [ns].
            first: (2,) heights of its first mode above rest [m].
            fade: share of the fade that it showed, the memory's own share in it.
            decided: the memory decided what it showed.
            jumped: it showed what could not be expected.
        """
        self.arrive(stamp_ns)
        if not (decided or jumped):
            spread = max(float(np.hypot(fade.stddev, TUNING.fade_drift)), TUNING.fade_known)
            self._fade = FadeShare(float(np.clip(fade.mean, 0.0, 1.0)), spread)
        self._decided = self._decided + 1 if decided else 0
        if self._decided > TUNING.decided:
            self.forget()
        follows = self._seen and not np.isnan(self._time(self._seen[-1][0], stamp_ns))
        stays = (
            self._stands is not None
            and float(np.hypot(*(first - self._stands[1]))) < TUNING.stands
        )
        if not (follows and stays):
            self._stands = stamp_ns, first.copy()
        if not follows:
            self._recent.clear()
        self._recent.append(first.copy())
        kept = self._seen[-1:] if follows and not jumped else ()
        self._seen = (*kept, (stamp_ns, first.copy()))

    def _time(self, before_ns: int, after_ns: int) -> float:
        """Returns the time between two stamps [s], NaN if it is negative or too long."""
        time = 1e-9 * (after_ns - before_ns)
        return (
            time
            if TUNING.least_time <= time <= TUNING.forgotten / self._frequency
            else float("nan")
        )


def _spread(firsts: Sequence[FloatArray]) -> float:
    """Returns the greatest distance of a series' amplitude pairs from its initial pair [m]."""
    return max(float(np.hypot(*(one - firsts[0]))) for one in firsts)
