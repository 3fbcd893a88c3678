"""Base of all inputs, and those of single sensors: AccelStamped and Imu.

AccelStamped tells the acceleration of the container's origin, without gravity; Imu specific force
and angular velocity of an inertial sensor (REP-145). At rest with z up that reads +g along z. What
drives the liquid is the specific force at the container's origin, in axes that do not follow the
container's yaw:

    f = R f_s + ω̇ × r + ω × (ω × r),        a = Rz(ψ) f - g ẑ,        ψ = ∫ ω_z dt,

with the fixed rotation R from the sensor's to the container's axes and r from the sensor to the
container's origin. A tilt needs no further care: gravity's share along the container's floor is
part of f. So the attitude of the samples is the yaw ψ alone: what turns gravity by an attitude
(`gravity_tilt`) must not do so once more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_model.constants import GRAVITY
from slosh_motion.checks.constancy import Beginning, began_doubt
from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.checks.imu_check import ImuCheck
from slosh_motion.checks.input_checks import AccelCheck, Check
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.frames import SensorTransform, Vector, cross, rotate, yaw_of_quaternion
from slosh_motion.inputs.gate import GateSettings, SampleGate, SampleVerdict, fault_of
from slosh_motion.inputs.sampling import MEMORY, SECONDS_PER_NS, Pose, Sample, Samples, Sampling
from slosh_motion.tuning import TUNING


class CheckedInput:
    """An input whose samples are checked for plausibility.

    Args:
        checks: whether doubts are told and flagged; None: as before these checks existed, so
            that recordings of that time have the flags of that time.

    Attributes:
        flags: whether a doubt makes samples doubtful.
        began: what shows that the container moved when the input began; None: nothing.
    """

    def __init__(self, check: Check, checks: bool | None) -> None:
        self.check = check
        self.flags = bool(checks)
        self._remembers = checks is not None
        self.began: Doubt | None = None
        self._beginning = Beginning()

    @property
    def doubt(self) -> Doubt | None:
        """The current fault of the input, or None if no fault is known."""
        return self.check.doubt if self.flags else None

    def assume_rest(self) -> None:
        """Takes the container as at rest before the first sample, or as known from elsewhere."""
        self._beginning.open = False

    def _began(self, stamp_ns: int, acceleration: Vector) -> bool:
        """Returns whether an acceleration shows that the input began in motion."""
        if not self._beginning.take(stamp_ns, acceleration) or not self.flags:
            return False
        self.began = began_doubt(f"{self._beginning.size:.2g} m/s² along the floor")
        return True

    def message_doubts(self) -> tuple[Doubt, ...]:
        """Returns what messages that contradict themselves or each other show."""
        return ()

    @property
    def contested(self) -> bool:
        """Whether successive messages show two publishers."""
        return False

    @property
    def contradicted(self) -> bool:
        """Whether messages contradict themselves, so that what follows from them is wrong."""
        return False

    def remark(self) -> str | None:
        """Returns a remark about settings without effect, or None if there are none."""
        return None

    def refusal(self) -> str | None:
        """Returns why samples in a wrong coordinate frame were dropped; None if none were."""
        return None

    def checked_memory(self, stamp_ns: int) -> list[float]:
        """Returns the plausibility check's state at a sample's stamp [ns] as numbers."""
        return self.check.memory(stamp_ns) if self._remembers else []

    def take_up_check(self, stamp_ns: int, memory: Sequence[float]) -> Sequence[float]:
        """Restores the plausibility check from saved numbers; returns the numbers left."""
        self.assume_rest()
        count = self.check.MEMORY
        if not self._remembers or len(memory) < count:
            return memory
        self.check.take_up(stamp_ns, memory[-count:])
        return memory[:-count]


def remembered(memory: Sequence[float], count: int, rate: int = 0) -> Sequence[float]:
    """Checks the length of an input reader's saved state, and returns that state.

    Args:
        rate: numbers about the input's rate that follow them, but in recordings of old.

    Raises:
        SloshMotionError: it does not consist of so many numbers.
    """
    if len(memory) not in (count, count + rate):
        raise SloshMotionError(
            f"saved state of an input with {len(memory)} values, must have {count + rate}"
        )
    return memory


class AccelInput(CheckedInput):
    """Converts accelerations in world or container axes to input samples of the models.

    Without an attitude the container counts as upright and not yawing: the two frames have the
    same axes, and azimuths refer to them.

    Args:
        settings: limits of the gate.
        frames: names of the frames that are taken; a sample in any other is dropped and counted.
        transform: container ← axes of the messages. Its lever arm needs angular velocities, which
            these messages do not tell; see `slosh_motion.inputs.transform_poses`.
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


def imu_reading(
    force: Vector, rate: Vector, force_known: float, rate_known: float
) -> tuple[Vector, Vector | None]:
    """Returns specific force (NaN: not reported) and angular velocity (None) of an Imu message.

    Args:
        force_known, rate_known: first entries of their covariances, below 0: not reported.
    """
    if force_known < 0.0:
        force = (math.nan, math.nan, math.nan)
    return force, rate if rate_known >= 0.0 and rate[0] == rate[0] else None


class ImuInput(CheckedInput):
    """Converts specific forces and angular velocities of an IMU to input samples.

    Args:
        settings: limits of the gate.
        transform: container ← sensor.
        checks: see `InputSettings`; None: only a mean force far from gravity's is doubtful.
    """

    check: ImuCheck

    def __init__(
        self, settings: GateSettings, transform: SensorTransform, checks: bool | None = None
    ) -> None:
        super().__init__(ImuCheck(transform.matrix), checks)
        self.gate = SampleGate(settings)
        self.sampling = Sampling("IMU samples")
        self._matrix = transform.matrix
        self._to_origin = transform.to_origin
        self._stamp_ns = 0
        self._slow_rate: Vector = (0.0, 0.0, 0.0)
        self._last_yaw_rate = 0.0
        self._yaw = 0.0
        self._mean_force: float | None = None
        self._rate_missing = False

    def update(
        self, stamp_ns: int, force: Vector, rate: Vector | None, now_ns: int | None = None
    ) -> Sample | None:
        """Converts an Imu message to an input sample; returns None if it is dropped.

        Args:
            stamp_ns: the moment [ns].
            force: specific force in the sensor's axes [m/s²].
            rate: angular velocity in the sensor's axes [rad/s]; None: the sensor reports none.
            now_ns: the time of arrival [ns].
        """
        fault = None if rate is None else fault_of(rate, TUNING.fastest_turn)
        verdict = self.gate.judge(stamp_ns, force, now_ns, fault)
        if verdict not in (SampleVerdict.USE, SampleVerdict.RESTART):
            return None
        # As the sensor gives them: what is clipped is so in its own axes.
        self.check.faults.take(stamp_ns, force)
        restarted = verdict is SampleVerdict.RESTART
        self.sampling.take(self.gate.interval_ns, restarted=restarted)
        self._rate_missing = rate is None
        omega = rotate(self._matrix, rate) if rate is not None else (0.0, 0.0, 0.0)
        dt = 0.0 if restarted else (stamp_ns - self._stamp_ns) * SECONDS_PER_NS
        self._stamp_ns = stamp_ns
        if restarted:
            self._slow_rate, self._last_yaw_rate = omega, omega[2]
        change = self._angular_acceleration(omega, dt)
        fx, fy, fz = self._force_at_origin(rotate(self._matrix, force), omega, change)
        # The yaw by the trapezoidal rule, as the acceleration is interpolated linearly too.
        self._yaw += 0.5 * dt * (omega[2] + self._last_yaw_rate)
        self._last_yaw_rate = omega[2]
        self._watch_gravity(math.sqrt(fx * fx + fy * fy + fz * fz), dt)
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        half = 0.5 * self._yaw
        a = (c * fx - s * fy, s * fx + c * fy, fz - GRAVITY)
        turn = None if rate is None else omega
        found = self.check.add(stamp_ns, a, turn, self._yaw, restarted=restarted)
        return Sample(
            stamp_ns, *a, self._yaw, restarted,
            (0.0, 0.0, math.sin(half), math.cos(half), *omega, *change),
            found and self.flags if self._remembers else self._doubtful, self.sampling.slow,
            self._beginning.open and self._began(stamp_ns, a),
        )  # fmt: skip

    @property
    def memory(self) -> list[float]:
        """Returns the input reader's state as numbers, except the last stamp; see `take_up`."""
        mean = math.nan if self._mean_force is None else self._mean_force
        own = [*self.gate.last, *self._slow_rate, self._last_yaw_rate, self._yaw, mean]
        return [*own, *self.sampling.memory, *self.checked_memory(self._stamp_ns)]

    def take_up(self, stamp_ns: int, memory: Sequence[float]) -> None:
        """Restores the reader's state from the numbers that `memory` returned.

        Raises:
            SloshMotionError: the memory is of another kind of input.
        """
        own = remembered(self.take_up_check(stamp_ns, memory), 9, MEMORY)
        fx, fy, fz, sx, sy, sz, rate, yaw, mean, *sampling = own
        self.gate.go_on(stamp_ns, (fx, fy, fz))
        self._stamp_ns, self._slow_rate = stamp_ns, (sx, sy, sz)
        self._last_yaw_rate, self._yaw = rate, yaw
        self._mean_force = None if math.isnan(mean) else mean
        self.sampling.take_up(sampling)

    def warning(self) -> str | None:
        """Returns a warning with a remedy; None if nothing is wrong."""
        if self._rate_missing and self._to_origin != (0.0, 0.0, 0.0):
            return "the sensor reports no angular velocity: its lever arm is not accounted for"
        return None

    @property
    def _doubtful(self) -> bool:
        mean = self._mean_force
        return mean is not None and not TUNING.too_light <= mean <= TUNING.too_heavy

    def _angular_acceleration(self, omega: Vector, dt: float) -> Vector:
        """Returns the angular acceleration [rad/s²] from low-pass filtered angular velocities."""
        blend = dt / (TUNING.angular_filter + dt)
        slow = self._slow_rate
        change = (omega[0] - slow[0], omega[1] - slow[1], omega[2] - slow[2])
        self._slow_rate = (
            slow[0] + blend * change[0],
            slow[1] + blend * change[1],
            slow[2] + blend * change[2],
        )
        inverse = 1.0 / (TUNING.angular_filter + dt)
        return change[0] * inverse, change[1] * inverse, change[2] * inverse

    def _force_at_origin(self, force: Vector, omega: Vector, change: Vector) -> Vector:
        """Returns the specific force at the container's origin [m/s²]."""
        turn = cross(change, self._to_origin)
        swing = cross(omega, cross(omega, self._to_origin))
        return (
            force[0] + turn[0] + swing[0],
            force[1] + turn[1] + swing[1],
            force[2] + turn[2] + swing[2],
        )

    def _watch_gravity(self, magnitude: float, dt: float) -> None:
        mean = magnitude if self._mean_force is None else self._mean_force
        self._mean_force = mean + dt / (TUNING.gravity_filter + dt) * (magnitude - mean)
