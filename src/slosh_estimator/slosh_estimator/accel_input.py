"""Acceleration of the container's origin without gravity, as geometry_msgs/AccelStamped."""

from __future__ import annotations

import math

from slosh_estimator.gate import SampleGate
from slosh_estimator.sample import Sample

_KEPT_NAMES = 10


class AccelInput:
    """Takes accelerations in the frame `world` or `container`.

    The message carries no attitude. World axes serve as they are, so that azimuths count from the
    world's +x unless the container keeps its yaw; container axes are taken as those of a container
    that does not yaw.

    Args:
        gate: the gate, shared with the estimator.
        frames: names of the frames that are accepted; '' is not.

    Attributes:
        refused_frames: dropped messages by the name of their frame, the first few names.
    """

    def __init__(self, gate: SampleGate, frames: tuple[str, ...] = ("world", "container")) -> None:
        self._gate = gate
        self._frames = frozenset(frames)
        self.refused_frames: dict[str, int] = {}

    def update(
        self,
        stamp_ns: int,
        frame: str,
        ax: float,
        ay: float,
        az: float,
        receive_ns: int | None = None,
    ) -> Sample | None:
        """Takes a message; None where it is dropped. Units: ns, m/s²."""
        if frame not in self._frames:
            if frame in self.refused_frames or len(self.refused_frames) < _KEPT_NAMES:
                self.refused_frames[frame] = self.refused_frames.get(frame, 0) + 1
            return None
        start = self._gate.check(stamp_ns, math.isfinite(ax + ay + az), receive_ns)
        return None if start is None else Sample(stamp_ns, ax, ay, az, 0.0, start)

    @property
    def warning(self) -> str:
        """What is wrong with the messages, one line; '' where nothing is."""
        if not self.refused_frames:
            return ""
        names = ", ".join(repr(name) for name in self.refused_frames)
        return f"accelerations in the frame {names} are dropped: send them in world or container"
