"""Accelerations of the container's origin, gravity excluded (geometry_msgs/AccelStamped)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slosh_estimator.gate import GateSettings, SampleGate, Verdict
from slosh_estimator.sample import Sample, Samples
from slosh_estimator.sampling import MEMORY, Sampling
from slosh_estimator.state import remembered

Array = NDArray[np.float64]


class AccelInput:
    """Takes accelerations in the world's or the container's axes.

    Without an attitude the container counts as upright and not yawing: the two frames have the
    same axes, and azimuths refer to them.

    Args:
        settings: limits of the gate.
        frames: names of the frames that are taken; a sample in any other is dropped and counted.
    """

    def __init__(self, settings: GateSettings, frames: tuple[str, ...]) -> None:
        self.gate = SampleGate(settings)
        self.sampling = Sampling("accelerations")
        self.strange_frame = ""
        self._frames = frames
        self._told = 0

    def update(
        self, stamp_ns: int, frame: str, ax: float, ay: float, az: float, now_ns: int | None = None
    ) -> Sample | None:
        """The sample, or None where it is dropped; accelerations in m/s²."""
        if frame not in self._frames:
            self.gate.refuse(Verdict.WRONG_FRAME)
            self.strange_frame = frame
            return None
        verdict = self.gate.judge(stamp_ns, (ax, ay, az), now_ns)
        if verdict is Verdict.USE:
            self.sampling.take(self.gate.interval_ns, restarted=False)
            return Sample(stamp_ns, ax, ay, az, slow=self.sampling.slow)
        if verdict is Verdict.RESTART:
            self.sampling.take(self.gate.interval_ns, restarted=True)
            return Sample(stamp_ns, ax, ay, az, 0.0, True, slow=self.sampling.slow)
        return None

    @property
    def memory(self) -> list[float]:
        """What the next samples depend on, beside the last one's stamp."""
        return [*self.gate.last, *self.sampling.memory]

    def take_up(self, stamp_ns: int, memory: Sequence[float]) -> None:
        """Goes on behind the message that another reader used last, with its memory.

        Raises:
            SloshEstimatorError: the memory is of another kind of input.
        """
        ax, ay, az, *rate = remembered(memory, 3, MEMORY)
        self.gate.go_on(stamp_ns, (ax, ay, az))
        self.sampling.take_up(rate)

    def update_many(
        self, stamps: NDArray[np.int64], frames: NDArray[np.object_], accelerations: Array
    ) -> Samples:
        """The samples of N messages, without those that are dropped.

        Args:
            stamps: (N,) [ns].
            frames: (N,) names of their frames.
            accelerations: (N, 3) [m/s²].
        """
        known = np.logical_or.reduce([frames == frame for frame in self._frames])
        for frame in frames[~known].tolist():
            self.gate.refuse(Verdict.WRONG_FRAME)
            self.strange_frame = frame
        stamps, accelerations = stamps[known], np.ascontiguousarray(accelerations[known])
        before = self.gate.last_ns
        used, restarted = self.gate.judge_many(stamps, accelerations)
        stamps, restarted = stamps[used], restarted[used]
        slow = self.sampling.take_many(
            np.diff(stamps, prepend=stamps[:1] if before is None else np.int64(before)), restarted
        )
        return Samples(stamps, accelerations[used], np.zeros(len(stamps)), restarted, slow=slow)

    def warning(self) -> str | None:
        """What the user should mend, by what has come since the last call; None: nothing."""
        strange = self.gate.counts[Verdict.WRONG_FRAME]
        new, self._told = strange - self._told, strange
        if not new:
            return None
        return (
            f"accelerations in frame {self.strange_frame!r} are dropped: "
            f"publish them in {' or '.join(map(repr, self._frames))}"
        )
