"""Reads the acceleration of the container's origin, without gravity, from AccelStamped."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_motion.checks.input_checks import AccelCheck
from slosh_motion.inputs.checked_input import CheckedInput, remembered
from slosh_motion.inputs.gate import GateSettings, SampleGate, SampleVerdict
from slosh_motion.inputs.mounting import SensorTransform
from slosh_motion.inputs.rotation import rotate, yaw_of_quaternion
from slosh_motion.inputs.sample import Pose, Sample, Samples
from slosh_motion.inputs.sampling import MEMORY, Sampling


class AccelInput(CheckedInput):
    """Converts accelerations in world or container axes to input samples of the models.

    Without an attitude the container counts as upright and not yawing: the two frames have the
    same axes, and azimuths refer to them.

    Args:
        settings: limits of the gate.
        frames: names of the frames that are taken; a sample in any other is dropped and counted.
        transform: container ← axes of the messages. Its lever arm needs angular velocities, which
            these messages do not tell; see `slosh_motion.inputs.placed_accel`.
        checks: see `InputSettings`.
        apart: that fixed transforms place the messages' frame apart from the container, and
            nothing tells how it turns: all are dropped.
    """

    check: AccelCheck

    def __init__(
        self,
        settings: GateSettings,
        frames: tuple[str, ...],
        transform: SensorTransform | None = None,
        checks: bool | None = None,
        *,
        apart: bool = False,
    ) -> None:
        super().__init__(AccelCheck(), checks)
        mount = transform or SensorTransform()
        self._matrix = mount.matrix if mount.turns else None
        self._arm = mount.to_origin
        self._apart = apart
        self.gate = SampleGate(settings)
        self.sampling = Sampling("accelerations")
        self.strange_frame = ""
        self._frames = frames
        self._told = 0

    def update(
        self,
        stamp_ns: int,
        frame: str,
        ax: float,
        ay: float,
        az: float,
        now_ns: int | None = None,
        pose: Pose | None = None,
    ) -> Sample | None:
        """Converts an acceleration [m/s²] to an input sample; returns None if it is dropped.

        Args:
            stamp_ns, frame, ax, ay, az: of the message.
            now_ns: the time of arrival [ns].
            pose: how the container stands and turns; None: upright, and it does not turn.
        """
        if frame not in self._frames or self._apart:
            self.gate.refuse(SampleVerdict.WRONG_FRAME)
            self.strange_frame = frame
            return None
        verdict = self.gate.judge(stamp_ns, (ax, ay, az), now_ns)
        if verdict is not SampleVerdict.USE and verdict is not SampleVerdict.RESTART:
            return None
        restarted = verdict is SampleVerdict.RESTART
        if self._matrix is not None:
            ax, ay, az = rotate(self._matrix, (ax, ay, az))
        self.sampling.take(self.gate.interval_ns, restarted=restarted)
        doubtful = self.check.add(stamp_ns, (ax, ay, az), restarted=restarted) and self.flags
        slow = self.sampling.slow
        yaw = 0.0 if pose is None else yaw_of_quaternion(*pose[:4])
        moving = self._beginning.open and self._began(stamp_ns, (ax, ay, az))
        return Sample(stamp_ns, ax, ay, az, yaw, restarted, pose, doubtful, slow, moving)

    @property
    def memory(self) -> list[float]:
        """Returns the input reader's state as numbers, except the last stamp; see `take_up`."""
        own = [*self.gate.last, *self.sampling.memory]
        return [*own, *self.checked_memory(self.gate.last_ns or 0)]

    def take_up(self, stamp_ns: int, memory: Sequence[float]) -> None:
        """Restores the reader's state from the numbers that `memory` returned.

        Raises:
            SloshMotionError: the memory is of another kind of input.
        """
        own = remembered(self.take_up_check(stamp_ns, memory), 3, MEMORY)
        ax, ay, az, *rate = own
        self.gate.go_on(stamp_ns, (ax, ay, az))
        self.sampling.take_up(rate)

    def update_many(
        self,
        stamps: NDArray[np.int64],
        frames: NDArray[np.object_],
        accelerations: Array,
        poses: Array | None = None,
    ) -> Samples:
        """Returns the samples of N messages; dropped messages are omitted.

        Args:
            stamps: (N,) [ns].
            frames: (N,) names of their frames.
            accelerations: (N, 3) [m/s²].
            poses: (N, POSE_COUNT) as in `update`; None: upright.
        """
        known = np.logical_or.reduce([frames == frame for frame in self._frames])
        known &= not self._apart
        for frame in frames[~known].tolist():
            self.gate.refuse(SampleVerdict.WRONG_FRAME)
            self.strange_frame = frame
        stamps, accelerations = stamps[known], np.ascontiguousarray(accelerations[known])
        poses = None if poses is None else np.ascontiguousarray(poses[known])
        before = self.gate.last_ns
        used, restarted = self.gate.judge_many(stamps, accelerations)
        stamps, accelerations, restarted = stamps[used], accelerations[used], restarted[used]
        yaws = np.zeros(len(stamps))
        if poses is not None:
            poses = poses[used]
            yaws[:] = [yaw_of_quaternion(*turn) for turn in poses[:, :4].tolist()]
        slow = self.sampling.take_many(
            np.diff(stamps, prepend=stamps[:1] if before is None else np.int64(before)), restarted
        )
        if self._matrix is not None:
            x, y, z = accelerations.T
            turned = [row[0] * x + row[1] * y + row[2] * z for row in self._matrix]
            accelerations = np.ascontiguousarray(np.column_stack(turned))
        doubtful = self.check.add_many(stamps, accelerations, restarted)
        return Samples(
            stamps, accelerations, yaws, restarted, poses,
            doubtful if self.flags else None, slow, self._began_many(stamps, accelerations),
        )  # fmt: skip

    def _began_many(self, stamps: Integers, accelerations: Array) -> NDArray[np.bool_] | None:
        """Returns at which accelerations (N,) it is known that the input began in motion."""
        if not self._beginning.open:
            return None
        moving = np.zeros(len(stamps), dtype=bool)
        for row, (stamp, (x, y, z)) in enumerate(
            zip(stamps.tolist(), accelerations.tolist(), strict=True)
        ):
            moving[row] = self._began(stamp, (x, y, z))
        return moving

    def warning(self) -> str | None:
        """Returns a warning with a remedy if new messages were dropped, otherwise None."""
        strange = self.gate.counts[SampleVerdict.WRONG_FRAME]
        new, self._told = strange - self._told, strange
        if not new:
            return None
        return self.refusal()

    def remark(self) -> str | None:
        """Returns a remark about settings without effect, or None if there are none."""
        if any(self._arm) and not self._apart:
            return (
                "sensor_to_origin has no effect: the input accel contains no rotation; connect "
                "its frame with the world by transforms, or use the input imu or pose"
            )
        return None

    def refusal(self) -> str | None:
        """Returns why samples in a wrong coordinate frame were dropped; None if none were."""
        if not self.gate.counts[SampleVerdict.WRONG_FRAME]:
            return None
        if self._apart:
            return (
                f"accelerations in frame {self.strange_frame!r}, {math.hypot(*self._arm):.3f} m "
                "from the container, are dropped: nothing tells how it turns; publish transforms "
                "from the world to the container, or use the input imu or pose"
            )
        return (
            f"accelerations in frame {self.strange_frame!r} are dropped: "
            f"publish them in {' or '.join(map(repr, self._frames))}, or publish the transforms "
            "(/tf) that connect their frame with the container's"
        )
