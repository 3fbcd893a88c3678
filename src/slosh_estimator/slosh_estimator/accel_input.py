"""Accelerations of the container's origin, gravity excluded (geometry_msgs/AccelStamped)."""

from __future__ import annotations

from math import isfinite

from slosh_estimator.gate import GateSettings, SampleGate, Verdict
from slosh_estimator.sample import Sample


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
        self.strange_frame = ""
        self._frames = frames

    def update(
        self, stamp_ns: int, frame: str, ax: float, ay: float, az: float, now_ns: int | None = None
    ) -> Sample | None:
        """The sample, or None where it is dropped; accelerations in m/s²."""
        if frame not in self._frames:
            self.gate.refuse(Verdict.WRONG_FRAME)
            self.strange_frame = frame
            return None
        verdict = self.gate.judge(stamp_ns, isfinite(ax + ay + az), now_ns)
        if verdict is Verdict.USE:
            return Sample(stamp_ns, ax, ay, az)
        if verdict is Verdict.RESTART:
            return Sample(stamp_ns, ax, ay, az, 0.0, True)
        return None

    def warning(self) -> str | None:
        """What the user should mend; None: nothing."""
        if not self.strange_frame:
            return None
        return (
            f"accelerations in frame {self.strange_frame!r} are dropped: "
            f"publish them in {' or '.join(map(repr, self._frames))}"
        )
