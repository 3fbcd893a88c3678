"""Specific force and angular velocity of an inertial sensor on the container, as REP-145 has them.

At rest with z up the sensor reads +g. With R the rotation sensor → container, r the sensor's place
in the container and ω, ω̇ in the container's axes, the specific force at the container's origin is

    f = R f_sensor − ω̇ × r − ω × (ω × r)

and the models are driven by u = Rz(ψ) f − g ẑ with ψ = ∫ ω_z dt: the liquid of an axisymmetric
container does not follow its yaw, so the models live in axes that do not yaw either, while a tilt
enters as the lateral part of gravity that the liquid feels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_model.constants import GRAVITY

from slosh_estimator.checks import in_range
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.gate import SampleGate
from slosh_estimator.sample import Sample, Start

Vector = tuple[float, float, float]
Rotation = tuple[Vector, Vector, Vector]

IDENTITY: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_MEAN_TIME = 1.0  # s; over which the mean force is judged
_SETTLED = 3.0  # mean times until the judgement holds


def rotation_from_quaternion(x: float, y: float, z: float, w: float) -> Rotation:
    """Rotation matrix of a quaternion.

    Raises:
        SloshEstimatorError: the quaternion is not of unit length (± 1 %).
    """
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not abs(norm - 1.0) < 0.01:
        raise SloshEstimatorError(f"rotation ({x}, {y}, {z}, {w}) has the norm {norm:g}, not 1")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> Rotation:
    """Rz(yaw) Ry(pitch) Rx(roll), the convention of URDF [rad]."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


@dataclass(frozen=True, slots=True)
class ImuSettings:
    """The sensor's place and the filter.

    Attributes:
        rotation: sensor → container.
        translation: the sensor's place in the container's frame [m].
        rate_time_constant: of the low-passed derivative that gives ω̇ [s].

    Raises:
        SloshEstimatorError: a value out of range.
    """

    rotation: Rotation = IDENTITY
    translation: Vector = (0.0, 0.0, 0.0)
    rate_time_constant: float = 0.01

    def __post_init__(self) -> None:
        for axis, value in zip("xyz", self.translation, strict=True):
            in_range(f"translation {axis}", value, -10.0, 10.0, "m")
        in_range("rate_time_constant", self.rate_time_constant, 1e-4, 1.0, "s")


class ImuInput:
    """Turns sensor messages into samples.

    Args:
        gate: the gate, shared with the estimator.
        settings: the sensor's place and the filter.

    Attributes:
        without_rates: samples whose angular velocity was not reported: taken as no rotation.
    """

    def __init__(self, gate: SampleGate, settings: ImuSettings | None = None) -> None:
        self._gate = gate
        self._settings = settings or ImuSettings()
        self._has_lever = any(self._settings.translation)
        self.without_rates = 0
        self.reset()

    def reset(self) -> None:
        """Forgets the yaw and the filters."""
        self._yaw = 0.0
        self._last_ns = 0
        self._rate: Vector = (0.0, 0.0, 0.0)
        self._smooth: Vector = (0.0, 0.0, 0.0)
        self._mean: Vector | None = None
        self._mean_age = 0.0

    def update(
        self,
        stamp_ns: int,
        force: Vector,
        rate: Vector,
        receive_ns: int | None = None,
        *,
        force_reported: bool = True,
        rate_reported: bool = True,
    ) -> Sample | None:
        """Takes a message.

        Args:
            stamp_ns: its stamp [ns].
            force: specific force in the sensor's frame [m/s²].
            rate: angular velocity in the sensor's frame [rad/s]; NaN: not reported.
            receive_ns: its time of arrival [ns].
            force_reported, rate_reported: False where covariance[0] is −1.

        Returns:
            the sample, or None where the message is dropped.
        """
        finite = force_reported and math.isfinite(force[0] + force[1] + force[2])
        start = self._gate.check(stamp_ns, finite, receive_ns)
        if start is None:
            return None
        if not (rate_reported and math.isfinite(rate[0] + rate[1] + rate[2])):
            self.without_rates += 1
            rate = (0.0, 0.0, 0.0)
        f, w = self._rotated(force), self._rotated(rate)
        dt = 0.0
        if start is Start.CONTINUES:
            dt = (stamp_ns - self._last_ns) / 1e9
            self._yaw = math.remainder(self._yaw + 0.5 * dt * (self._rate[2] + w[2]), math.tau)
        else:
            self._smooth, self._mean, self._mean_age = w, f, 0.0
        self._last_ns, self._rate = stamp_ns, w
        self._watch_gravity(f, dt)
        if self._has_lever:
            f = self._at_origin(f, w, dt)
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        ax, ay, az = c * f[0] - s * f[1], s * f[0] + c * f[1], f[2] - GRAVITY
        return Sample(stamp_ns, ax, ay, az, self._yaw, start)

    @property
    def warning(self) -> str:
        """What is wrong with the messages, one line; '' where nothing is."""
        if self._mean is not None and self._mean_age > _SETTLED * _MEAN_TIME:
            norm = math.hypot(*self._mean)
            if norm < 0.5 * GRAVITY:
                return (
                    f"the mean specific force is {norm:.2f} m/s² instead of {GRAVITY}: the driver "
                    "seems to remove gravity; send the raw specific force (REP-145) or use accel"
                )
            if self._mean[2] < 0.5 * GRAVITY:
                return (
                    f"gravity is along ({self._mean[0]:.1f}, {self._mean[1]:.1f}, "
                    f"{self._mean[2]:.1f}) m/s² in the container's frame instead of +z: check the "
                    "transform sensor → container"
                )
        if self.without_rates:
            return "angular velocity is not reported: yaw and lever arm are not compensated"
        return ""

    def _rotated(self, v: Vector) -> Vector:
        x, y, z = v
        a, b, c = self._settings.rotation
        return (
            a[0] * x + a[1] * y + a[2] * z,
            b[0] * x + b[1] * y + b[2] * z,
            c[0] * x + c[1] * y + c[2] * z,
        )

    def _watch_gravity(self, f: Vector, dt: float) -> None:
        mean = self._mean if self._mean is not None else f
        k = 1.0 - math.exp(-dt / _MEAN_TIME)
        self._mean = (
            mean[0] + k * (f[0] - mean[0]),
            mean[1] + k * (f[1] - mean[1]),
            mean[2] + k * (f[2] - mean[2]),
        )
        self._mean_age += dt

    def _at_origin(self, f: Vector, w: Vector, dt: float) -> Vector:
        """The specific force at the container's origin."""
        tau = self._settings.rate_time_constant
        k = 1.0 - math.exp(-dt / tau)
        s = self._smooth
        # The derivative of the first-order low-pass, after its step.
        smooth = (s[0] + k * (w[0] - s[0]), s[1] + k * (w[1] - s[1]), s[2] + k * (w[2] - s[2]))
        self._smooth = smooth
        dw = ((w[0] - smooth[0]) / tau, (w[1] - smooth[1]) / tau, (w[2] - smooth[2]) / tau)
        r = self._settings.translation
        turned, inner = _cross(dw, r), _cross(w, _cross(w, r))
        return (
            f[0] - turned[0] - inner[0],
            f[1] - turned[1] - inner[1],
            f[2] - turned[2] - inner[2],
        )


def _cross(a: Vector, b: Vector) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )
