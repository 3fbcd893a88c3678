"""The product's observer with a camera that looks at an independent liquid, rightly or not."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from independent_liquid import Liquids

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import WallHeights
from slosh_governor.core import SeenLiquid
from slosh_model import Model
from slosh_motion.inputs.sampling import Sample

EVERY, PHASE = 0.005, 0.3
"""Time [s] and phase of the first mode [rad] between two samples of the accelerometer, at most."""
NOISE, ACCELERATION = 3e-4, 0.02
"""Standard deviations of a height [m] and of an acceleration [m/s²]."""
ROUND = np.linspace(-math.pi, 0.0, 12)
SIDES = np.array([-math.pi, -0.5 * math.pi, 0.0, 0.5 * math.pi])


class Fault(NamedTuple):
    """What is wrong with a camera.

    Attributes:
        late: by how much its stamps are late [s].
        turned: the angle by which azimuths are turned [rad].
        mirrored: whether left and right are exchanged.
        scale: of the heights.
        frozen: whether it shows the first picture for ever.
        stops: when it stops [s].
    """

    late: float = 0.0
    turned: float = 0.0
    mirrored: bool = False
    scale: float = 1.0
    frozen: bool = False
    stops: float = math.inf


FAULTS = {
    "a camera": Fault(),
    "its stamps 0.1 s late": Fault(late=0.1),
    "its stamps 0.1 s early": Fault(late=-0.1),
    "its images mirrored": Fault(mirrored=True),
    "its images turned": Fault(turned=0.5 * math.pi),
    "its heights at half scale": Fault(scale=0.5),
    "its images frozen": Fault(frozen=True),
    "it stops at once": Fault(stops=0.12),
}


class WatchedLiquid:
    """An observer that takes accelerations and, through a camera, heights of the first liquid.

    It believes, as the estimator does, that the liquid is at rest when it begins; what the camera
    shows up to then is still liquid.

    Args:
        model: of the observer.
        liquids: the first of which the camera sees.
        fault: of the camera.
        rng: draws rate, latency and noise.
        limit: of the height [m]; a camera that sees it is less noisy than a part of it.
    """

    def __init__(
        self, model: Model, liquids: Liquids, fault: Fault, rng: np.random.Generator, limit: float
    ) -> None:
        self._observer, self._liquids, self._fault, self._rng = (
            Observer(model),
            liquids,
            fault,
            rng,
        )
        self.every = min(EVERY, PHASE * liquids.period / (2.0 * math.pi))
        self._azimuths = SIDES if liquids.cornered else ROUND
        self._apart, self._latency = 1.0 / rng.choice([30.0, 60.0]), rng.uniform(0.01, 0.1)
        self._stddev = min(NOISE, 0.02 * limit)
        self._gain = rng.normal(1.0, 0.01)
        self._next, self._first = 0.0, True
        self._images: deque[tuple[float, WallHeights]] = deque()
        self._shown: Array | None = None
        self.states: deque[SeenLiquid] = deque()

    def still(self, begin_ns: int, seconds: float) -> None:
        """Looks at still liquid in a container at rest for a time [s] before `begin_ns`."""
        count = max(round(seconds / self.every), 1)
        for k in range(count):
            t = -seconds + seconds * k / count
            self.follow(t, begin_ns + round(t * SECOND), np.zeros(3), still=True)
        self.states.clear()

    def follow(self, t: float, now_ns: int, acceleration: Array, *, still: bool = False) -> None:
        """Takes an acceleration [m/s²] at a time t [s], and the images that have come by then."""
        if t >= self._next or self._first:
            self._next = t + self._apart
            if t < self._fault.stops:
                self._look(t, now_ns, still=still)
        while self._images and self._images[0][0] <= t:
            self._observer.take(self._images.popleft()[1])
        felt = self._gain * acceleration + ACCELERATION * self._rng.normal(size=3)
        ax, ay, az = felt.tolist()
        state = self._observer.follow(Sample(now_ns, ax, ay, az, restarted=self._first))
        self._first = False
        if state is not None and state.trusted:
            modal = np.array(state.modal).reshape(-1, 4)
            told = SeenLiquid(
                state.stamp_ns, modal, state.msh_stddev, state.frequency_factor, state.uncorrected
            )
            self.states.append(told)

    def _look(self, t: float, now_ns: int, *, still: bool) -> None:
        fault, azimuths = self._fault, self._azimuths
        where = (math.pi - azimuths if fault.mirrored else azimuths) + fault.turned
        heights = self._liquids.at(where) * (0.0 if still else fault.scale)
        if fault.frozen:
            heights = self._shown if self._shown is not None else heights
            self._shown = heights
        read = heights + self._stddev * self._rng.normal(size=len(azimuths))
        points = np.column_stack([azimuths, read, np.full(len(azimuths), self._stddev)])
        image = WallHeights(now_ns + round(fault.late * SECOND), points)
        self._images.append((t + self._latency, image))
