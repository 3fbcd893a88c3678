"""What the images before tell of the next one: the liquid cannot jump.

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

from slosh_camera.cylinder.surface_evidence import USUAL_FADE, FadeShare
from slosh_model.bessel import bessel_derivative_root

FloatArray = NDArray[np.float64]

_ROOT = bessel_derivative_root(1)
_GRAVITY = 9.81
# Standard deviation of the container's acceleration, of which nothing is known here [m/s²].
_ACCELERATION = 3.0
# What a deviation takes from the agreement with a picture, by the logarithm of its square: robots
# rarely accelerate so much, and then much more. Beyond the second it takes no more.
_SURPRISE, _FARTHEST = 0.2, 4.0
# Standard deviation of a height in the image before, as a part of the radius.
_MEASURED = 0.01
# A liquid of which one image alone is known is on its way at a speed of this part of the radius
# times ω, or of its height times ω.
_AMPLITUDE = 0.15
# A crest of more than this that stays where it is, to the second, for so many radians of the swing
# stands: a wave leaves its turning point after half a radian [m].
_CREST, _STANDS, _STOOD = 2e-3, 2e-4, 4.0 * np.pi
# A period lasts for more than four images: so few surfaces, which come in turn so often, are old
# pictures.
_IN_TURN, _TURNS = (2, 3), 3
# Radians of the swing after which nothing is foretold, and the least time between images [s].
_FORGOTTEN = 1.5
_LEAST_TIME = 1e-3
# An image may not hold on: after so many in a row that the memory decided, it is emptied.
_DECIDED = 5
# How much the share of the fade may change from image to image, and how well it is known at best:
# the errors of one image are not independent of those of the next.
_FADE_DRIFT, _FADE_KNOWN = 0.02, 0.15


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """First mode that an image should show.

    Attributes:
        first: (2,) heights at +x and at +y above rest [m].
        stddev: of each [m].
    """

    first: FloatArray
    stddev: float

    def distance(self, first: FloatArray) -> float:
        """Distance of a first mode (2,) [m] in standard deviations."""
        return float(np.hypot(*(first - self.first))) / self.stddev

    def surprise(self, first: FloatArray) -> float:
        """What a first mode (2,) [m] takes from the agreement with a picture.

        It grows slowly and not without end: a picture that is clear enough always wins.
        """
        distance = min(self.distance(first), _FARTHEST)
        return _SURPRISE * float(np.log1p(distance**2))


class SurfaceMemory:
    """The first mode in the last two images."""

    def __init__(self, radius: float, fill_height: float) -> None:
        """Empty.

        Args:
            radius: of the container [m].
            fill_height: of the liquid [m].
        """
        depth = np.tanh(_ROOT * fill_height / radius)
        self._radius = radius
        self._frequency = float(np.sqrt(_GRAVITY * _ROOT / radius * depth))
        self._gain = 8.0 * float(depth) / (_ROOT * (_ROOT**2 - 1.0))
        self.forget()

    def forget(self) -> None:
        """Knows nothing any more."""
        self._seen: tuple[tuple[int, FloatArray], ...] = ()
        self._decided = 0
        self._fade = USUAL_FADE
        self._stands: tuple[int, FloatArray] | None = None
        self._recent: deque[FloatArray] = deque(maxlen=max(_IN_TURN) * _TURNS)

    @property
    def repeats(self) -> bool:
        """Whether the last images show two or three surfaces in turn, as old pictures do."""
        newest = list(reversed(self._recent))
        return any(
            len(newest) >= count * _TURNS
            and _spread(newest[:count]) > _CREST
            and all(_spread(newest[k : count * _TURNS : count]) < _STANDS for k in range(count))
            for count in _IN_TURN
        )

    @property
    def crest_stands(self) -> bool:
        """Whether the last images show a crest that does not swing, for two periods and more."""
        if self._stands is None or not self._seen:
            return False
        since_ns, first = self._stands
        phase = self._frequency * 1e-9 * (self._seen[-1][0] - since_ns)
        return phase > _STOOD and float(np.hypot(*first)) > _CREST

    @property
    def fade(self) -> FadeShare:
        """Share of the fade that this liquid's crests have shown."""
        return self._fade

    def arrive(self, stamp_ns: int) -> None:
        """The next image is of a moment [ns]; one before the last begins a recording anew."""
        if self._seen and stamp_ns < self._seen[-1][0]:
            self.forget()

    def expected(self, stamp_ns: int) -> Expected | None:
        """What the image of a moment [ns] should show; None: nothing is known.

        A gap, and a stamp that repeats or runs back, leave nothing to go by.
        """
        if not self._seen:
            return None
        last_ns, last = self._seen[-1]
        ahead = self._time(last_ns, stamp_ns)
        if np.isnan(ahead):
            return None
        measured = _MEASURED * self._radius
        phase = self._frequency * ahead
        pushed = self._gain * _ACCELERATION
        if len(self._seen) == 1:
            size = max(_AMPLITUDE * self._radius, float(np.hypot(*last)))
            spread = np.linalg.norm((measured, size * np.sin(phase), 0.5 * pushed * ahead**2))
            return Expected(last * np.cos(phase), float(spread))
        before_ns, before = self._seen[0]
        ago = self._time(before_ns, last_ns)
        ratio = np.sin(phase) / np.sin(self._frequency * ago)
        swung = np.cos(phase) + np.cos(self._frequency * ago) * ratio
        spread = np.linalg.norm(
            (measured * swung, measured * ratio, measured, 0.5 * pushed * ahead * (ahead + ago))
        )
        return Expected(last * swung - before * ratio, float(spread))

    def remember(
        self, stamp_ns: int, first: FloatArray, fade: FadeShare, *, decided: bool, jumped: bool
    ) -> None:
        """Take note of what an image showed.

        Args:
            stamp_ns: its moment [ns].
            first: (2,) heights of its first mode above rest [m].
            fade: share of the fade that it showed, the memory's own share in it.
            decided: the memory decided what it showed.
            jumped: it showed what could not be expected.
        """
        self.arrive(stamp_ns)
        if not (decided or jumped):
            spread = max(float(np.hypot(fade.stddev, _FADE_DRIFT)), _FADE_KNOWN)
            self._fade = FadeShare(float(np.clip(fade.mean, 0.0, 1.0)), spread)
        self._decided = self._decided + 1 if decided else 0
        if self._decided > _DECIDED:
            self.forget()
        follows = self._seen and not np.isnan(self._time(self._seen[-1][0], stamp_ns))
        stays = self._stands is not None and float(np.hypot(*(first - self._stands[1]))) < _STANDS
        if not (follows and stays):
            self._stands = stamp_ns, first.copy()
        if not follows:
            self._recent.clear()
        self._recent.append(first.copy())
        kept = self._seen[-1:] if follows and not jumped else ()
        self._seen = (*kept, (stamp_ns, first.copy()))

    def _time(self, before_ns: int, after_ns: int) -> float:
        """Time between two stamps [s]; NaN where the one says nothing of the other."""
        time = 1e-9 * (after_ns - before_ns)
        return time if _LEAST_TIME <= time <= _FORGOTTEN / self._frequency else float("nan")


def _spread(firsts: Sequence[FloatArray]) -> float:
    """Greatest distance from the first of them [m]."""
    return max(float(np.hypot(*(one - firsts[0]))) for one in firsts)
