"""Shapes of robot motions, parameterised by frequency and amplitude.

Every coordinate is p(t) = A w(t) sin(k φ(t) + δ), with a window w that rises from 0 and returns to
it with three continuous derivatives: so position, velocity and acceleration begin and end at 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.tuning import TUNING
from slosh_model.constants import GRAVITY
from slosh_model.simulate import Inputs


@dataclass(frozen=True, slots=True)
class Swing:
    """Oscillation along one coordinate of a robot motion.

    Attributes:
        axis: 0, 1, 2 for x, y, z.
        size: in units of the family's amplitude.
        harmonic: k, its frequency in units of the family's.
        shift: δ [rad].
    """

    axis: int
    size: float = 1.0
    harmonic: float = 1.0
    shift: float = 0.0


@dataclass(frozen=True, slots=True)
class Family:
    """Robot motions of one shape, which differ in frequency and amplitude.

    Attributes:
        title: for people.
        swings: of the position.
        tilt: about y, in units of the largest tilt.
        yaw: in units of the largest yaw.
        sweep: its frequency rises over this factor's span around the nominal one; 1: constant.
    """

    title: str
    swings: tuple[Swing, ...]
    tilt: float = 0.0
    yaw: float = 0.0
    sweep: float = 1.0

    @property
    def turns(self) -> bool:
        """Whether the motion changes the container's attitude."""
        return self.tilt != 0.0 or self.yaw != 0.0


SIDE = math.sqrt(0.5)
QUARTER = 0.5 * math.pi
FAMILIES = (
    Family("back and forth along x", (Swing(0),)),
    Family("back and forth along y", (Swing(1),)),
    Family("back and forth along the diagonal of x and y", (Swing(0, SIDE), Swing(1, SIDE))),
    Family("figure of eight", (Swing(0), Swing(1, 0.4, harmonic=2.0))),
    Family("circle", (Swing(0), Swing(1, shift=QUARTER))),
    Family(
        "back and forth along x with heave at twice the frequency",
        (Swing(0), Swing(2, 0.25, harmonic=2.0, shift=QUARTER)),
    ),
    Family("back and forth along x with rising frequency", (Swing(0),), sweep=2.0),
    Family("tilting about y in place", (), tilt=1.0),
    Family("back and forth along x, tilting about y", (Swing(0, shift=QUARTER),), tilt=0.7),
    Family("yawing in place", (), yaw=1.0),
    Family("back and forth along x while yawing", (Swing(0),), yaw=1.0),
)


@dataclass(frozen=True, slots=True)
class CandidateMotion:
    """A robot motion of a given shape, with its frequency, acceleration and dwell time.

    Attributes:
        family: the family.
        frequency: [Hz].
        acceleration: bound of ‖a‖ [m/s²].
        dwell: length of the dwell [s].
    """

    family: Family
    frequency: float
    acceleration: float = 1.0
    dwell: float = TUNING.family_dwell


def inputs_of(motion: CandidateMotion) -> Inputs:
    """Returns the inputs of a candidate motion: rest, oscillation, dwell."""
    family = motion.family
    t = np.arange(
        0.0,
        TUNING.family_still + TUNING.family_swing + motion.dwell + 0.5 * TUNING.family_step,
        TUNING.family_step,
    )
    position, acceleration = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for swing in family.swings:
        place, _, second = _swing(t, motion, swing.harmonic, swing.shift)
        position[:, swing.axis] += swing.size * place
        acceleration[:, swing.axis] += swing.size * second
    amplitude = _amplitude(motion, position, acceleration)
    if not family.turns:
        return Inputs(t, amplitude * acceleration)
    about, angle, rate = _rotation(t, motion)
    attitude, angular_velocity = np.zeros((len(t), 4)), np.zeros((len(t), 3))
    attitude[:, about], attitude[:, 3] = np.sin(0.5 * angle), np.cos(0.5 * angle)
    angular_velocity[:, about] = rate
    return Inputs(t, amplitude * acceleration, attitude, angular_velocity)


def text_of(motion: CandidateMotion) -> str:
    """Describes a candidate motion with its values."""
    inputs = inputs_of(motion)
    peak = float(np.linalg.norm(inputs.acceleration, axis=1).max())
    parts = [f"{motion.family.title} at {motion.frequency:.2f} Hz"]
    if motion.family.sweep != 1.0:
        low, high = _sweep(motion)
        parts = [f"{motion.family.title}, {low:.2f} to {high:.2f} Hz"]
    if peak > 0.0:
        parts.append(f"at most {peak:.2g} m/s²")
    if inputs.attitude is not None:
        _, angle, _ = _rotation(inputs.t, motion)
        parts.append(f"turning by ±{math.degrees(float(np.abs(angle).max())):.0f}°")
    parts.append(f"{TUNING.family_swing:g} s long, then {motion.dwell:g} s at rest")
    return ", ".join(parts)


def _amplitude(motion: CandidateMotion, position: Array, acceleration: Array) -> float:
    """Returns the factor that scales a motion up to its limits of acceleration and travel."""
    peak = float(np.linalg.norm(acceleration, axis=1).max())
    extent = float(np.linalg.norm(np.ptp(position, axis=0)))
    if peak <= 0.0:
        return 0.0
    return min(motion.acceleration / peak, TUNING.most_travel / extent)


def _rotation(t: Array, motion: CandidateMotion) -> tuple[int, Array, Array]:
    """Returns axis, angle [rad] and angular rate [rad/s] of a candidate motion's rotation."""
    place, first, _ = _swing(t, motion, 1.0, 0.0)
    family = motion.family
    if family.tilt != 0.0:
        size = (
            min(TUNING.most_tilt, TUNING.tilt_share * motion.acceleration / GRAVITY) * family.tilt
        )
        return 1, size * place, size * first
    size = (
        min(TUNING.yaw, TUNING.most_yaw_rate / max(float(np.abs(first).max()), 1e-9)) * family.yaw
    )
    return 2, size * place, size * first


def _sweep(motion: CandidateMotion) -> tuple[float, float]:
    """Returns the start and end frequency of a frequency sweep [Hz]."""
    half = math.sqrt(motion.family.sweep)
    return motion.frequency / half, motion.frequency * half


def _swing(
    t: Array, motion: CandidateMotion, harmonic: float, shift: float
) -> tuple[Array, Array, Array]:
    """Returns the oscillation w sin(k φ + δ) with window w, and its first two time derivatives."""
    since = np.clip(t - TUNING.family_still, 0.0, TUNING.family_swing)
    low, high = (2.0 * math.pi * each for each in _sweep(motion))
    rate = low + (high - low) * since / TUNING.family_swing
    phase = low * since + 0.5 * (high - low) * since**2 / TUNING.family_swing
    angle, change = harmonic * phase + shift, harmonic * rate
    bend = harmonic * (high - low) / TUNING.family_swing
    s, ds = np.sin(angle), change * np.cos(angle)
    dds = bend * np.cos(angle) - change**2 * s
    w, dw, ddw = _window(since)
    return w * s, dw * s + w * ds, ddw * s + 2.0 * dw * ds + w * dds


def _window(since: Array) -> tuple[Array, Array, Array]:
    """Returns a window that rises from 0 to 1 and falls again, with its derivatives."""
    rise, falling = since / TUNING.family_ramp, (TUNING.family_swing - since) / TUNING.family_ramp
    x = np.clip(np.minimum(rise, falling), 0.0, 1.0)
    sign = np.where(rise <= falling, 1.0, -1.0)
    w = x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)
    dw = 140.0 * x**3 * (1.0 - x) ** 3
    ddw = 420.0 * x**2 * (1.0 - x) ** 2 * (1.0 - 2.0 * x)
    return w, sign * dw / TUNING.family_ramp, ddw / TUNING.family_ramp**2
