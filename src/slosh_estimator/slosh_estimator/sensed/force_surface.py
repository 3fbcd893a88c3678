"""Computes wave heights from the force under the container.

A sensor carries M (container and liquid), of which m sloshes at the displacement x. Its force is
F = M a + m ẍ with ẍ = -ω²x - 2ζωẋ - a (Ibrahim 2005, ch. 5), so that but for the damping

    x = -(F - F₀ - (M - m) a) / (m ω²),

and the wall's height is a gain times x. F₀, the sensor's zero with the cable's force, is the mean
over the last seconds. Force and acceleration are averaged over the same short blocks of time: the
result depends on their stamps alone, not on when they come.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.sensed.payload import UNITS, Payload
from slosh_estimator.tuning import TUNING
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.model import Model
from slosh_motion.tuning import TUNING as INPUTS


class Motion(NamedTuple):
    """Horizontal acceleration and yaw of the container at a stamp.

    Attributes:
        stamp_ns: the moment [ns].
        ax, ay: along axes that do not follow the container's yaw [m/s²].
        yaw: angle of the container's x axis in these axes [rad].
    """

    stamp_ns: int
    ax: float
    ay: float
    yaw: float


class SensedWave(NamedTuple):
    """Height, azimuth and standard deviation of the wave that a measured force indicates.

    Attributes:
        stamp_ns: the moment [ns].
        height: of the wave at the azimuth [m]; the wall opposite is as much lower.
        azimuth: in the container's axes [rad].
        stddev: standard deviation of the height [m].
        turned: whether the wave across is known, too; else the azimuth is a direction of the
            sensor and the height has a sign.
    """

    stamp_ns: int
    height: float
    azimuth: float
    stddev: float
    turned: bool


class ForceSurface:
    """Converts forces and accelerations to heights, one for each block of time.

    Args:
        model: of the liquid.
        payload: as it was identified.
    """

    def __init__(self, model: Model, payload: Payload) -> None:
        self._payload = payload
        self._block_ns = TUNING.force_block_ns
        self._delay_ns = round(payload.delay * SECOND)
        modes = model.nonlinear().mode_constants()
        container = model.container
        first = container.mass_ratio(1, X_AXIS)
        self._axes = []
        for along, sensor in payload.directions:
            size = math.hypot(along[0], along[1])
            c, s = along[0] / size, along[1] / size
            gain = ratio = 0.0
            for axis, share in ((X_AXIS, c * c), (Y_AXIS, s * s)):
                gain += share * model.nonlinear().height_gains(modes[:1], axis)[0]
                ratio += share * container.mass_ratio(1, axis) / first
            self._axes.append(_Axis(c, s, sensor, gain, payload.sloshing_mass * ratio))
        # What a mean over a block leaves of a sine of the natural frequency.
        half = 0.5 * payload.natural_frequency * self._block_ns / SECOND
        self._kept = math.sin(half) / half
        self._forces: deque[tuple[int, tuple[float, ...]]] = deque()
        self._motions: deque[Motion] = deque()
        self._newest_force_ns = self._newest_motion_ns = -(2**62)
        self._block: int | None = None
        self._zeros = [0.0] * len(self._axes)
        self._blocks = 0
        self.refused = 0
        self._load = LoadCheck(payload)

    @property
    def wrong(self) -> str:
        """Fault of the measured force that prevents heights, in one line; empty if none."""
        return self._load.wrong

    def take_force(self, stamp_ns: int, fx: float, fy: float, fz: float) -> list[SensedWave]:
        """Adds a force in the sensor's axes and unit; returns the waves of complete blocks."""
        stamp_ns -= self._delay_ns
        if not (math.isfinite(fx + fy + fz) and stamp_ns > self._newest_force_ns):
            self.refused += 1
            return self._restarted_if_set_back(stamp_ns, self._newest_force_ns)
        self._newest_force_ns = stamp_ns
        newton = self._payload.newton
        along = tuple(
            newton * (fx * axis.sensor[0] + fy * axis.sensor[1] + fz * axis.sensor[2])
            for axis in self._axes
        )
        self._forces.append((stamp_ns, along))
        return self._complete()

    def take_motion(self, motion: Motion) -> list[SensedWave]:
        """Adds an acceleration of the container; returns the waves of complete blocks."""
        finite = math.isfinite(motion.ax + motion.ay + motion.yaw)
        if not finite or motion.stamp_ns <= self._newest_motion_ns:
            self.refused += 1
            return self._restarted_if_set_back(motion.stamp_ns, self._newest_motion_ns)
        self._newest_motion_ns = motion.stamp_ns
        self._motions.append(motion)
        return self._complete()

    def _restarted_if_set_back(self, stamp_ns: int, newest_ns: int) -> list[SensedWave]:
        """Clears all data if a stamp shows that the clock was set back."""
        if newest_ns - stamp_ns > INPUTS.set_back_ns:
            self._forces.clear()
            self._motions.clear()
            self._newest_force_ns = self._newest_motion_ns = -(2**62)
            self._block, self._blocks = None, 0
        return []

    def _complete(self) -> list[SensedWave]:
        """Returns the waves of all time blocks for which force and acceleration are complete."""
        found: list[SensedWave] = []
        until = min(self._newest_force_ns, self._newest_motion_ns) // self._block_ns
        if not self._forces or not self._motions:
            return found
        if self._block is None:
            self._block = max(self._forces[0][0], self._motions[0].stamp_ns) // self._block_ns + 1
        while self._block < until:
            wave = self._wave(self._block)
            if wave is not None:
                found.append(wave)
            first_ns = min(self._forces[0][0], self._motions[0].stamp_ns) // self._block_ns
            # Over a gap at once.
            self._block = max(self._block + 1, min(first_ns, until))
        return found

    def _wave(self, block: int) -> SensedWave | None:
        """Evaluates a time block and drops its samples; None if force or motion is missing."""
        begin_ns, end_ns = block * self._block_ns, (block + 1) * self._block_ns
        forces, motions = [], []
        while self._forces and self._forces[0][0] < end_ns:
            stamp_ns, force = self._forces.popleft()
            if stamp_ns >= begin_ns:
                forces.append(force)
        while self._motions and self._motions[0].stamp_ns < end_ns:
            motion = self._motions.popleft()
            if motion.stamp_ns >= begin_ns:
                motions.append(motion)
        if not forces or not motions:
            return None
        pushes, size = _pushes(motions, self._axes)
        payload, noise = self._payload, 0.0
        heights, loads = [], []
        self._blocks += 1
        share = max(1.0 / self._blocks, self._block_ns / TUNING.force_zero_ns)
        for place, axis in enumerate(self._axes):
            mean = math.fsum(force[place] for force in forces) / len(forces)
            loads.append(mean - self._zeros[place])
            left = mean - (payload.mass - axis.mass) * pushes[place]
            self._zeros[place] += share * (left - self._zeros[place])
            per_force = axis.gain / (axis.mass * payload.natural_frequency**2 * self._kept)
            heights.append(-per_force * (left - self._zeros[place]))
            moving = size > TUNING.force_moves
            spread = payload.noise_moving if moving else payload.noise_at_rest
            noise = max(noise, abs(per_force) * math.hypot(spread, payload.mass_error * size))
        if self._blocks * self._block_ns < TUNING.force_zero_first_ns:
            return None
        if size > TUNING.force_moves:
            self._load.add(loads, pushes)
        if self._load.wrong:
            return None
        return self._told(begin_ns + self._block_ns // 2, heights, noise)

    def _told(self, stamp_ns: int, heights: list[float], stddev: float) -> SensedWave:
        axes = self._axes
        if len(heights) == 1:
            azimuth = math.atan2(axes[0].s, axes[0].c)
            return SensedWave(stamp_ns, heights[0], azimuth, stddev, turned=False)
        x = heights[0] * axes[0].c + heights[1] * axes[1].c
        y = heights[0] * axes[0].s + heights[1] * axes[1].s
        return SensedWave(stamp_ns, math.hypot(x, y), math.atan2(y, x), stddev, turned=True)


class _Axis(NamedTuple):
    """A horizontal direction in container and sensor axes, with its height gain and mass."""

    c: float
    s: float
    sensor: tuple[float, float, float]
    gain: float
    mass: float


def _pushes(motions: list[Motion], axes: list[_Axis]) -> tuple[list[float], float]:
    """Returns the mean acceleration along each force axis, and its magnitude [m/s²]."""
    x = y = 0.0
    for motion in motions:
        c, s = math.cos(motion.yaw), math.sin(motion.yaw)
        x += c * motion.ax + s * motion.ay
        y += c * motion.ay - s * motion.ax
    x, y = x / len(motions), y / len(motions)
    return [axis.c * x + axis.s * y for axis in axes], math.hypot(x, y)


class LoadCheck:
    """Compares the mass that force and acceleration in motion give with the identified mass.

    Args:
        payload: as it was identified.

    Attributes:
        wrong: in one line what is wrong with the force; empty if nothing is known to be.
    """

    def __init__(self, payload: Payload) -> None:
        self._payload = payload
        self._product = self._square = 0.0
        self._blocks = 0
        self.wrong = ""

    def add(self, forces: list[float], pushes: list[float]) -> None:
        """Adds the forces of a block of time in which the container moved to the check.

        Args:
            forces: less the sensor's zero, along each direction [N].
            pushes: acceleration along each direction [m/s²].
        """
        kept = TUNING.load_memory
        product = math.fsum(f * a for f, a in zip(forces, pushes, strict=True))
        self._product = kept * self._product + product
        self._square = kept * self._square + math.fsum(a * a for a in pushes)
        self._blocks += 1
        if self._blocks >= TUNING.load_least:
            self.wrong = self._judged(self._product / self._square / self._payload.mass)

    def _judged(self, ratio: float) -> str:
        """Explains a wrong ratio of measured to identified mass in one line; else empty."""
        if 1.0 / TUNING.load_wrong < ratio < TUNING.load_wrong:
            return ""
        told = f"the force in motion is {ratio:.2g} times that of the identified payload: "
        if ratio < 0.0 and 1.0 / TUNING.load_wrong < -ratio < TUNING.load_wrong:
            return told + "its sign is reversed; mount the sensor as identified, or identify anew"
        for unit, newton in UNITS.items():
            if abs(math.log(max(abs(ratio), 1e-12) * newton / self._payload.newton)) < math.log(
                TUNING.load_unit
            ):
                return told + f"it seems to be in {unit}; publish the unit of the identification"
        return told + "axes, unit or payload are others; identify anew"
