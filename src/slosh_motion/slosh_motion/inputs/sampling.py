"""Input samples of the models, and the rate at which they come.

Between two samples the models take the acceleration as a straight line. Of a wave of frequency ω,
sampled every T, this leaves sinc²(ωT/2): at 30 Hz 0.96 of a first mode of 3.4 Hz. What an input
does before, such as to differentiate poses, has a gain of its own. A mode whose gain is out of
CARRIED is estimated too low, or too high.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Integers
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.kernel import UPRIGHT
from slosh_model.model import Model
from slosh_motion.inputs.gate import SampleGate
from slosh_motion.tuning import TUNING

SECONDS_PER_NS = 1e-9
Pose = tuple[float, float, float, float, float, float, float, float, float, float]
"""How a container stands and turns: its attitude as a quaternion x, y, z, w, world ← container,
its angular velocity [rad/s] and its angular acceleration [rad/s²] in its own axes."""


class Sample(NamedTuple):
    """One input sample of the models: stamp, acceleration and attitude.

    A named tuple, because a thousand are made each second.

    Attributes:
        stamp_ns: the moment [ns].
        ax, ay, az: acceleration, gravity excluded [m/s²], in axes that are parallel to the
            container's but do not follow its yaw: the liquid in a round one does not either.
        yaw: angle of the container's x axis in these axes [rad].
        restarted: True for the first sample and after a gap: nothing links it to those before.
        pose: how the container stands and turns; None: upright, and it does not turn. Where the
            acceleration holds gravity's share along a tilted floor already, the attitude is that
            of the yaw alone.
        doubtful: whether what is measured cannot be what it is said to be.
        slow: whether the input comes too slowly to carry the sloshing modes.
        moving: whether it shows that the container moved already when the input began.
    """

    stamp_ns: int
    ax: float
    ay: float
    az: float
    yaw: float = 0.0
    restarted: bool = False
    pose: Pose | None = None
    doubtful: bool = False
    slow: bool = False
    moving: bool = False


class Samples(NamedTuple):
    """N input samples as columns; see Sample.

    Attributes:
        stamps: (N,) [ns].
        accelerations: (N, 3) [m/s²].
        yaws: (N,) [rad].
        restarted: (N,) whether nothing links a sample to those before.
        poses: (N, POSE_COUNT) as in Sample; None: upright throughout.
        doubtful, slow, moving: (N,) as in Sample; None: none of them.
    """

    stamps: NDArray[np.int64]
    accelerations: NDArray[np.float64]
    yaws: NDArray[np.float64]
    restarted: NDArray[np.bool_]
    poses: NDArray[np.float64] | None = None
    doubtful: NDArray[np.bool_] | None = None
    slow: NDArray[np.bool_] | None = None
    moving: NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, samples: Sequence[Sample]) -> Samples:
        """Combines single input samples to columns."""
        values = np.array([sample[1:5] for sample in samples], dtype=np.float64).reshape(-1, 4)
        return cls(
            np.array([sample.stamp_ns for sample in samples], dtype=np.int64),
            np.ascontiguousarray(values[:, :3]),
            values[:, 3].copy(),
            np.array([sample.restarted for sample in samples], dtype=bool),
            _poses(samples),
            np.array([sample.doubtful for sample in samples], dtype=bool),
            np.array([sample.slow for sample in samples], dtype=bool),
            np.array([sample.moving for sample in samples], dtype=bool),
        )

    def rows(self, chosen: NDArray[np.bool_]) -> Samples:
        """Returns the samples that a mask (N,) selects."""
        return Samples(
            self.stamps[chosen], self.accelerations[chosen], self.yaws[chosen],
            self.restarted[chosen],
            None if self.poses is None else self.poses[chosen],
            None if self.doubtful is None else self.doubtful[chosen],
            None if self.slow is None else self.slow[chosen],
            None if self.moving is None else self.moving[chosen],
        )  # fmt: skip

    def one(self, index: int) -> Sample:
        """Returns the input sample at an index."""
        ax, ay, az = self.accelerations[index].tolist()
        return Sample(
            int(self.stamps[index]), ax, ay, az, float(self.yaws[index]),
            bool(self.restarted[index]),
            None if self.poses is None else tuple(self.poses[index].tolist()),
            self.doubtful is not None and bool(self.doubtful[index]),
            self.slow is not None and bool(self.slow[index]),
            self.moving is not None and bool(self.moving[index]),
        )  # fmt: skip


def _poses(samples: Sequence[Sample]) -> NDArray[np.float64] | None:
    if all(sample.pose is None for sample in samples):
        return None
    return np.array([sample.pose or UPRIGHT for sample in samples], dtype=np.float64)


Modes = tuple[tuple[int, float], ...]
"""Modes as number and natural frequency [rad/s], rising by number."""
Gain = Callable[[float, float], float]
"""Of a wave of a frequency [rad/s] at an interval between samples [s]."""

TOO_SLOW = (
    "the rate of the estimator's input is too low for a sloshing mode: its heights are wrong"
)
BLOCK = 32
"""So many intervals tell the rate anew."""
MEMORY = BLOCK + 2
"""Numbers of a memory: the interval, whether a gap was last, and an unfinished block."""
_FASTEST, _STEP = 1000, 5
"""Rates that are proposed reach up to the first, in steps of the second [Hz]."""


def modes_of(model: Model) -> Modes:
    """Returns the modes of a model, along both axes, that its input must represent."""
    found = {
        (mode.number, mode.along(axis).natural_frequency)
        for mode in model.mode_constants()
        for axis in (X_AXIS, Y_AXIS)
    }
    return tuple(sorted(found))


def interpolation_gain(frequency: float, interval: float) -> float:
    """Returns the amplitude gain of a wave that is sampled and interpolated linearly.

    Args:
        frequency: of the wave [rad/s].
        interval: between the samples [s].
    """
    x = 0.5 * frequency * interval
    return (math.sin(x) / x) ** 2 if x > 0.0 else 1.0


class Sampling:
    """Measures the rate of an input and checks whether it suffices for all sloshing modes.

    The interval is the median by time: half of the time lies in intervals that are no longer. So
    jitter, single lost samples and messages that come in bursts do not move it much. All numbers
    are whole: live and in a replay the same samples bear the flag.

    Args:
        noun: what comes, in the plural.

    Attributes:
        interval_ns: between two samples [ns]; 0: not known yet.
        slow: whether a mode is not carried.
    """

    def __init__(
        self, noun: str, gain: Gain = interpolation_gain, remedy: str = "use a faster sensor"
    ) -> None:
        self.interval_ns = 0
        self.slow = False
        self.modes: Modes = ()
        self._noun, self._gain, self._remedy = noun, gain, remedy
        self._block: list[int] = []
        self._gapped = self._muted = False

    def mute(self) -> None:
        """Disables the check of the input's rate, for old recordings."""
        self._muted = True

    def carry(self, modes: Modes) -> None:
        """Sets the sloshing modes which the input must represent, when the model changes."""
        self.modes = modes
        self._judge()

    def take(self, interval_ns: int, *, restarted: bool) -> None:
        """Records the interval between two consecutive accepted samples.

        Args:
            interval_ns: the time [ns]; 0: there is none.
            restarted: whether it was too long to link them. A single gap says nothing of the rate,
                one gap after the other does.
        """
        counted = interval_ns > 0 and (self._gapped or not restarted)
        self._gapped = restarted
        if not counted:
            return
        block = self._block
        block.append(interval_ns)
        if len(block) < self._wanted:
            return
        self._settle(int(_typical(np.array([block]))[0]))
        block.clear()

    def take_many(self, intervals: Integers, restarted: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Records the intervals between consecutive samples; equals a call of `take` for each.

        Args:
            intervals: (N,) from the sample before to each [ns]; not positive: there is none.
            restarted: (N,) whether it was too long to link them.

        Returns:
            (N,) whether a mode is not carried, at each sample.
        """
        slow = np.empty(len(intervals), dtype=bool)
        gapped = np.concatenate(([self._gapped], restarted))
        self._gapped = bool(gapped[-1])
        counted = (intervals > 0) & (gapped[:-1] | ~restarted)
        places = np.flatnonzero(counted)
        start = done = 0
        # The first blocks may be short; then whole ones follow.
        while done + self._wanted - len(self._block) <= len(places):
            head = self._block
            missing = self._wanted - len(head)
            whole = 1 if head or not self.interval_ns else (len(places) - done) // BLOCK
            end = done + missing + (whole - 1) * BLOCK
            rows = np.concatenate([np.array(head, np.int64), intervals[places[done:end]]])
            for k, found in enumerate(_typical(rows.reshape(whole, -1)).tolist()):
                last = int(places[done + missing + k * BLOCK - 1])
                slow[start:last] = self.slow
                self._settle(found)
                start = last
            self._block, done = [], end
        self._block += intervals[places[done:]].tolist()
        slow[start:] = self.slow
        return slow

    @property
    def memory(self) -> list[float]:
        """Returns the state of the rate measurement as numbers for `take_up`."""
        unused = [math.nan] * (BLOCK - len(self._block))
        return [float(self.interval_ns), float(self._gapped), *map(float, self._block), *unused]

    def take_up(self, memory: Sequence[float]) -> None:
        """Restores a saved state of the rate measurement; old recordings contain none."""
        self.interval_ns = round(memory[0]) if memory else 0
        self._gapped = bool(memory) and memory[1] != 0.0
        self._block = [round(interval) for interval in memory[2:] if interval > 0.0]
        self._judge()

    @property
    def seconds(self) -> float:
        """Typical interval between samples [s]; 0 if not yet known."""
        return self.interval_ns * SECONDS_PER_NS

    def gains(self) -> dict[int, float]:
        """Returns the input's gain per sloshing mode number; empty if not yet known."""
        found: dict[int, float] = {}
        for number, frequency in self.modes if self.interval_ns else ():
            found[number] = min(found.get(number, math.inf), self._gain(frequency, self.seconds))
        return found

    def sentence(self) -> str:
        """Returns one line on a mode that the input's rate cannot represent; else empty."""
        if not self.slow:
            return ""
        number, frequency, gain = next(self._lost(self.seconds))
        rate = self._sufficient_rate()
        publish = f"publish at {rate:d} Hz or more, or " if rate else ""
        return (
            f"{self._noun} arrive at {1.0 / self.seconds:.3g} Hz: the gain at mode {number} "
            f"({frequency / math.tau:.1f} Hz) is {gain:.2f}, and the estimate is too "
            f"{'low' if gain < 1.0 else 'high'}; {publish}{self._remedy}"
        )

    @property
    def _wanted(self) -> int:
        return BLOCK if self.interval_ns else TUNING.first_rate

    def _settle(self, found: int) -> None:
        if TUNING.rate_change * abs(found - self.interval_ns) > self.interval_ns:
            self.interval_ns = found
            self._judge()

    def _judge(self) -> None:
        if not self._muted:
            self.slow = bool(self.interval_ns) and not self._carries(1.0 / self.seconds)

    def _lost(self, interval: float) -> Iterator[tuple[int, float, float]]:
        """Yields number, frequency and gain of those modes that a sample interval [s] distorts."""
        for number, frequency in self.modes:
            gain = self._gain(frequency, interval)
            if not TUNING.carried[0] <= gain <= TUNING.carried[1]:
                yield number, frequency, gain

    def _sufficient_rate(self) -> int | None:
        """Returns the lowest round rate [Hz] that represents all modes; None if none does."""
        rates = range(math.ceil(1.0 / self.seconds / _STEP) * _STEP, _FASTEST + 1, _STEP)
        # What a rate carries, a higher one carries too.
        found = bisect_left(rates, True, key=self._carries)
        return rates[found] if found < len(rates) else None

    def _carries(self, rate: float) -> bool:
        return not any(True for _ in self._lost(1.0 / rate))


def gap_sentence(gate: SampleGate, used: int, restarts: int) -> str:
    """Returns a line if most samples are farther apart than max_gap, else an empty text.

    Args:
        restarts: how many of these came after a gap.
    """
    if restarts < TUNING.restarts or TUNING.restarts * restarts < used:
        return ""
    apart, limit = gate.gap_ns * SECONDS_PER_NS, gate.max_gap_ns * SECONDS_PER_NS
    return (
        f"samples arrive every {1e3 * apart:.0f} ms, but max_gap is {1e3 * limit:.0f} "
        "ms: each sample counts as a restart after a gap, and nothing is estimated; set "
        f"max_gap to {2.0 * apart:.2g} s, or publish at {math.ceil(1.5 / limit)} Hz or more"
    )


def _typical(intervals: Integers) -> Integers:
    """Returns the duration-weighted median (M,) of each block of sample intervals (M, N) [ns]."""
    rising = np.sort(intervals, axis=1)
    elapsed = np.cumsum(rising, axis=1)
    middle = np.argmax(2 * elapsed >= elapsed[:, -1:], axis=1)
    found: Integers = np.take_along_axis(rising, middle[:, np.newaxis], axis=1)[:, 0]
    return found
