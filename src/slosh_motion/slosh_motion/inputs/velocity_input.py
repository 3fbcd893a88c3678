"""Reads velocities of a frame that carries the container (Odometry, TwistStamped).

`OdometryPoses` reads the poses of Odometry messages whose twist is wrong.

They are differentiated once, by the same window as poses. The velocity of the container's origin
is v + ω × r, in the world's axes. Odometry tells the attitude; where a twist alone is known the
container counts as upright, and its yaw is the integral of the angular velocity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.checks.input_faults import (
    MIXED_INPUT,
    FaultWatch,
    find_mixed_velocities,
)
from slosh_motion.checks.message_checks import Dropouts, TwistCheck
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.frames import (
    Quaternion,
    SensorTransform,
    Vector,
    composed,
    rotated,
    sensor_from_container,
)
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import SECONDS_PER_NS, Sample
from slosh_motion.tuning import TUNING

_NOWHERE: Vector = (0.0, 0.0, 0.0)
_REMEDY = "mend the driver, or set the estimator's parameter odometry to pose"
_OWN = 8
"""Numbers of the memory beside those of the window: yaw, its rate, place, velocity."""


class Twist(NamedTuple):
    """Linear and angular velocity of a frame at a stamp.

    Attributes:
        stamp_ns: the moment [ns].
        linear: velocity of its origin [m/s].
        angular: velocity [rad/s].
        attitude: x, y, z, w, world ← frame; None: not known.
        position: of the frame [m]; None: not known.
    """

    stamp_ns: int
    linear: Vector
    angular: Vector
    attitude: Quaternion | None = None
    frame: str = ""
    position: Vector | None = None

    def compare(self, check: TwistCheck) -> None:
        """Adds a velocity in the axes of its moving frame to a check against its own pose."""
        if self.attitude is not None and self.position is not None:
            turned = rotated(self.attitude, self.linear)
            check.take(self.stamp_ns, self.position, turned, self.linear)


class VelocityInput(PoseInput):
    """Converts velocities of a frame to input samples.

    Args:
        settings: limits of the gate.
        window: length of the window [s]; 0.0: the longest that carries the modes.
        transform: container ← the frame that moves.
        frames: names of the world's frame, and of the container's. Velocities in any other have
            the axes of the frame that moves, too; see `update_twist`.
        checks: see `InputSettings`.
        noun: what comes, in the plural.
        smoothing: see `PoseInput`.
    """

    ORDER = 1
    LARGEST = TUNING.fastest_move
    STAIR = TUNING.stair_speed

    def __init__(
        self,
        settings: GateSettings,
        window: float = 0.0,
        transform: SensorTransform | None = None,
        frames: tuple[str, str] = ("world", "container"),
        checks: bool | None = True,
        noun: str = "velocities",
        smoothing: float = 0.0,
    ) -> None:
        super().__init__(settings, window, None, None, True, checks, noun, smoothing)
        mount = transform or SensorTransform()
        turn = sensor_from_container(mount)
        self._held = rotated(turn, mount.to_origin), turn  # where the container stands in it
        self._world = frames[0]
        self._twists, self._dropouts = TwistCheck(), Dropouts(noun)
        self._turns = FaultWatch(find=find_mixed_velocities)
        self._container, self._assumed = frames[1], ""
        self._yaw = self._rate = 0.0
        self._place, self._velocity = _NOWHERE, _NOWHERE
        self._last_ns = 0

    def update_twist(self, twist: Twist, now_ns: int | None = None) -> list[Sample]:
        """Returns the samples that a velocity message completes; see `PoseInput.update`.

        Args:
            twist: in the world's axes where its frame is the world's, else in the moving frame's.
            now_ns: the time of arrival [ns].
        """
        stamp_ns, linear, angular, attitude, frame, position = twist
        sent = linear
        in_world = bool(frame) and frame.lstrip("/") == self._world
        if attitude is None and not in_world and frame.lstrip("/") != self._container:
            self._assumed = f"in the frame {frame!r}" if frame else "without a frame"
        turned = self._integrated(stamp_ns, angular[2]) if attitude is None else attitude
        if not in_world:
            linear, angular = rotated(turned, linear), rotated(turned, angular)
        self._stairs.take(stamp_ns, sent)  # as a turn changes each value in the world's axes
        if position is not None:
            self._to_and_fro.take(position)
            self._twists.take(stamp_ns, position, linear, sent)
        x, y, z = rotated(turned, self._held[0])
        wx, wy, wz = angular
        velocity = (
            linear[0] + wy * z - wz * y, linear[1] + wz * x - wx * z, linear[2] + wx * y - wy * x
        )  # fmt: skip
        held = composed((_NOWHERE, turned), (_NOWHERE, self._held[1]))[1]
        return self.update(stamp_ns, velocity, held, now_ns)

    @property
    def memory(self) -> list[float]:
        """Returns the input reader's state as numbers, except the last stamp; see `take_up`."""
        return [self._yaw, self._rate, *self._place, *self._velocity, *super().memory]

    def take_up(self, stamp_ns: int, memory: Sequence[float]) -> None:
        """Restores the reader's state from the numbers that `memory` returned.

        Raises:
            SloshMotionError: the memory is of another kind of input.
        """
        if len(memory) < _OWN:
            raise SloshMotionError(
                f"saved state of a velocity input with {len(memory)} values: wrong number"
            )
        self._yaw, self._rate, *rest = memory[:_OWN]
        self._place = rest[0], rest[1], rest[2]
        self._velocity = rest[3], rest[4], rest[5]
        self._last_ns = stamp_ns
        super().take_up(stamp_ns, memory[_OWN:])

    def _integrated(self, stamp_ns: int, rate: float) -> Quaternion:
        """Integrates the yaw rate to the attitude of an upright frame."""
        seconds = (stamp_ns - self._last_ns) * SECONDS_PER_NS
        if 0.0 < seconds <= self.gate.max_gap_ns * SECONDS_PER_NS and math.isfinite(rate):
            self._yaw += 0.5 * seconds * (self._rate + rate)
        self._rate = rate if math.isfinite(rate) else 0.0
        return 0.0, 0.0, math.sin(0.5 * self._yaw), math.cos(0.5 * self._yaw)

    def _place_of(self, stamp_ns: int, vector: Vector) -> Vector:
        """Integrates velocities to a position, which drifts, for the plausibility check."""
        seconds = (stamp_ns - self._last_ns) * SECONDS_PER_NS
        if 0.0 < seconds <= self.gate.max_gap_ns * SECONDS_PER_NS:
            x, y, z = (
                p + 0.5 * seconds * (a + b)
                for p, a, b in zip(self._place, self._velocity, vector, strict=True)
            )
            self._place = x, y, z
        self._last_ns, self._velocity = stamp_ns, vector
        return self._place

    def _look(self, stamp_ns: int, position: Vector, quaternion: Quaternion) -> None:
        """Checks a velocity against those before it."""
        self._dropouts.take(stamp_ns, position)
        if stamp_ns > self._last_ns:  # as found in the look before
            self._turns.take(stamp_ns, position)
        self._jitter.take(stamp_ns, position)

    def _leap(self, pose: object) -> None:
        """Returns None: a leap of the velocity is no fault but a strong acceleration."""

    def message_doubts(self) -> tuple[Doubt, ...]:
        """Returns what messages that contradict themselves or each other show."""
        doubt = self._twists.raised
        if doubt is not None and doubt.wrong:
            doubt = Doubt(f"{doubt.text}; {_REMEDY}")
        self._turns.finish()
        mixed = None
        if self._turns.faults and not self._to_and_fro.raised:
            mixed = Doubt(f"successive {self._noun} jump to and fro: {MIXED_INPUT}")
        found = (*super().message_doubts(), doubt, self._dropouts.raised, mixed)
        return tuple(one for one in found if one is not None)

    def remark(self) -> str | None:
        """Returns a remark about assumed axes; None if they are known."""
        if not self._assumed:
            return None
        return (
            f"velocities {self._assumed} are assumed to have the axes of the moving frame; if "
            f"they have the world's, set frame_id to {self._world!r}"
        )

    @property
    def contradicted(self) -> bool:
        """Whether the twist of the messages is not the change of their pose."""
        return super().contradicted or (self.flags and self._twists.found)


class OdometryPoses(PoseInput):
    """Converts the poses of Odometry messages to input samples; see `PoseInput`."""

    @cached_property
    def _twists(self) -> TwistCheck:
        return TwistCheck()

    def update_twist(self, twist: Twist, now_ns: int | None = None) -> list[Sample]:
        """Returns the samples that an Odometry message completes; see `PoseInput.update`.

        Args:
            now_ns: the time of arrival [ns].
        """
        if twist.attitude is None or twist.position is None:
            raise SloshMotionError("a velocity without a pose cannot be read by its pose")
        twist.compare(self._twists)
        frame = self._frame or ""  # the parent's, which is the world
        return self.update(twist.stamp_ns, twist.position, twist.attitude, now_ns, frame)

    def message_doubts(self) -> tuple[Doubt, ...]:
        """Returns what messages that contradict themselves or each other show."""
        doubt = self._twists.raised
        if doubt is None:
            return super().message_doubts()
        used = "its poses are used" if doubt.wrong else "set the parameter odometry to twist"
        told = Doubt(f"{doubt.text}; {used}", wrong=not doubt.wrong)
        return (*super().message_doubts(), told)

    @property
    def contradicted(self) -> bool:
        """Whether values rise in stairs, or the pose stands where the twist moves."""
        doubt = self._twists.raised
        stands = doubt is not None and not doubt.wrong
        return super().contradicted or (self.flags and stands)
