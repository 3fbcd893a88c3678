"""Reads specific force and angular velocity of an inertial sensor from Imu (REP-145).

At rest with z up the sensor reads +g along z. What drives the liquid is the specific force at the
container's origin, in axes that do not follow the container's yaw:

    f = R f_s + ω̇ × r + ω × (ω × r),        a = Rz(ψ) f - g ẑ,        ψ = ∫ ω_z dt,

with the fixed rotation R from the sensor's to the container's axes and r from the sensor to the
container's origin. A tilt needs no further care: gravity's share along the container's floor is
part of f. So the attitude of the samples is the yaw ψ alone: what turns gravity by an attitude
(`gravity_tilt`) must not do so once more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from slosh_model.constants import GRAVITY
from slosh_motion.checks.imu_check import ImuCheck
from slosh_motion.inputs.checked_input import CheckedInput, remembered
from slosh_motion.inputs.gate import GateSettings, SampleGate, SampleVerdict, fault_of
from slosh_motion.inputs.mounting import SensorTransform
from slosh_motion.inputs.rotation import Vector, cross, rotate
from slosh_motion.inputs.sample import SECONDS_PER_NS, Sample
from slosh_motion.inputs.sampling import MEMORY, Sampling
from slosh_motion.tuning import TUNING


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
