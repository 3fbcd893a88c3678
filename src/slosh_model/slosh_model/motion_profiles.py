"""Rest-to-rest motion laws, and a machine's cycle of rise and dwell (TM20, §2.1).

A law is dimensionless: it leads from 0 to 1 while its argument, the relative time, does. Before 0
and after 1 it rests.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from slosh_base.types import Array
from slosh_model.checks import within
from slosh_model.errors import SloshModelError

Law = Callable[[Array], tuple[Array, Array, Array]]
"""(N,) relative time to position 0 … 1, its first and its second derivative, (N,) each."""

_LEAST_STROKE = 1e-6  # m
MINUTE = 60.0
PEAK = 1.0 / (0.25 / math.pi + 0.125)
"""Largest second derivative of the modified trapezoid, 4.888."""
EDGE = 0.05
"""Length of each edge of the acceleration pulses, as a share of the motion time."""
_K = 4.0 * math.pi
_BREAKS = (0.125, 0.375, 0.625, 0.875)


def quintic(u: Array) -> tuple[Array, Array, Array]:
    """Evaluates the motion law 10u³ − 15u⁴ + 6u⁵; speed and acceleration are 0 at both ends."""
    u = np.clip(u, 0.0, 1.0)
    rest = 1.0 - u
    position = u**3 * (10.0 + u * (6.0 * u - 15.0))
    return position, 30.0 * (u * rest) ** 2, 60.0 * u * rest * (1.0 - 2.0 * u)


def cycloidal(u: Array) -> tuple[Array, Array, Array]:
    """Evaluates the motion law u − sin(2πu)/2π, whose acceleration is a sine."""
    u = np.clip(u, 0.0, 1.0)
    turn = 2.0 * math.pi
    angle = turn * u
    # By sin² of the nearer end, so that rounding leaves no velocity where it begins and ends.
    velocity = 2.0 * np.sin(math.pi * np.minimum(u, 1.0 - u)) ** 2
    return u - np.sin(angle) / turn, velocity, turn * np.sin(angle)


def harmonic(u: Array) -> tuple[Array, Array, Array]:
    """Evaluates the motion law (1 − cos πu)/2, whose acceleration jumps at both ends.

    Its peak, π²/2 = 4.93, is the least but that of constant accelerations.
    """
    inside = (u > 0.0) & (u < 1.0)
    angle = math.pi * np.clip(u, 0.0, 1.0)
    velocity = np.where(inside, 0.5 * math.pi * np.sin(angle), 0.0)
    acceleration = np.where((u >= 0.0) & (u <= 1.0), 0.5 * math.pi**2 * np.cos(angle), 0.0)
    return np.sin(0.5 * angle) ** 2, velocity, acceleration


def modified_trapezoid(u: Array) -> tuple[Array, Array, Array]:
    """Evaluates the modified-trapezoid motion law; its acceleration has quarter-sine edges.

    The acceleration rises as a quarter sine, stays, falls through zero as a cosine (two segments),
    stays, and returns to zero.
    """
    return _mirrored(u, _modified_trapezoid_half)


def acceleration_pulse(u: Array) -> tuple[Array, Array, Array]:
    """Evaluates a motion law of constant acceleration, then deceleration, with linear edges.

    TM20 shows its acceleration pulse in a figure alone. Assumed is what the name says, two equal
    pulses of opposite sign that fill the motion time; an edge takes EDGE of it, as no drive
    changes its acceleration at once. Its peak, 4/(1 − 2·EDGE) = 4.44, lies below the quintic's
    5.77, as the paper states of the two.
    """
    return _mirrored(u, _pulse_half)


LAWS: Mapping[str, Law] = MappingProxyType(
    {
        "quintic": quintic,
        "acceleration_pulse": acceleration_pulse,
        "modified_trapezoidal": modified_trapezoid,
        "cycloidal": cycloidal,
        "harmonic": harmonic,
    }
)
"""The laws by name."""


@dataclass(frozen=True, slots=True)
class Cycle:
    """A machine's cycle: a stroke of the container, then a dwell.

    Attributes:
        law: name of the law of the rise, one of LAWS.
        speed: operating speed n [1/min]; a cycle takes 60/n seconds.
        stroke: way of one cycle [m]; negative: the other way.
        ratio: b, share of the cycle in which the container moves.

    Raises:
        SloshModelError: another law, or a value out of bounds.
    """

    law: str
    speed: float
    stroke: float
    ratio: float = 0.4

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise SloshModelError(
                f"motion profile {self.law!r:.60} is not one of {', '.join(LAWS)}"
            )
        within("speed", self.speed, "1/min", 0.1, 6000.0)
        within("stroke", self.stroke, "m", -10.0, 10.0)
        if abs(self.stroke) < _LEAST_STROKE:
            raise SloshModelError(f"stroke {self.stroke:g} m: must be at least 0.001 mm")
        within("ratio", self.ratio, "", 0.01, 1.0)

    @property
    def cycle_time(self) -> float:
        """Duration T_cycle of the whole cycle [s]."""
        return MINUTE / self.speed

    @property
    def motion_time(self) -> float:
        """Duration T_mot = b · T_cycle of the motion [s]; then the container dwells."""
        return self.ratio * self.cycle_time

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Returns position, velocity and acceleration in the cycle [m, m/s, m/s²] at given times.

        Args:
            t: (N,) not before 0 [s].

        Returns:
            position [m], velocity [m/s], acceleration [m/s²], (N,) each.
        """
        number = np.floor(t / self.cycle_time)
        u = (t - number * self.cycle_time) / self.motion_time
        position, velocity, acceleration = LAWS[self.law](u)
        pace = self.stroke / self.motion_time
        return (
            self.stroke * (number + position),
            pace * velocity,
            pace / self.motion_time * acceleration,
        )


def _mirrored(u: Array, first_half: Law) -> tuple[Array, Array, Array]:
    """Returns a motion law that is point symmetric about (1/2, 1/2), from its first half."""
    u = np.clip(u, 0.0, 1.0)
    second = u > 0.5
    position, velocity, acceleration = first_half(np.where(second, 1.0 - u, u))
    return (
        np.where(second, 1.0 - position, position),
        velocity,
        np.where(second, -acceleration, acceleration),
    )


def _pulse_half(u: Array) -> tuple[Array, Array, Array]:
    peak = 4.0 / (1.0 - 2.0 * EDGE)
    rise, fall = u < EDGE, u > 0.5 - EDGE
    v1, s1 = 0.5 * peak * EDGE, peak * EDGE**2 / 6.0
    flat = 0.5 - 2.0 * EDGE
    v2, s2 = v1 + peak * flat, s1 + v1 * flat + 0.5 * peak * flat**2
    x, y = u - EDGE, u - (0.5 - EDGE)
    slope = peak / EDGE
    acceleration = np.where(rise, slope * u, np.where(fall, peak - slope * y, peak))
    velocity = np.where(
        rise,
        0.5 * slope * u**2,
        np.where(fall, v2 + y * (peak - 0.5 * slope * y), v1 + peak * x),
    )
    position = np.where(
        rise,
        slope * u**3 / 6.0,
        np.where(
            fall,
            s2 + y * (v2 + y * (0.5 * peak - slope * y / 6.0)),
            s1 + x * (v1 + 0.5 * peak * x),
        ),
    )
    return position, velocity, acceleration


def _modified_trapezoid_half(u: Array) -> tuple[Array, Array, Array]:
    b1, b2 = _BREAKS[:2]
    rise, fall = u < b1, u >= b2
    v1 = PEAK / _K
    v2 = v1 + PEAK * (b2 - b1)
    s1 = v1 * (b1 - 1.0 / _K)
    s2 = s1 + v1 * (b2 - b1) + 0.5 * PEAK * (b2 - b1) ** 2
    x, y = u - b1, u - b2
    acceleration = np.where(
        rise, PEAK * np.sin(_K * u), np.where(fall, PEAK * np.cos(_K * y), PEAK)
    )
    velocity = np.where(
        rise,
        v1 * (1.0 - np.cos(_K * u)),
        np.where(fall, v2 + v1 * np.sin(_K * y), v1 + PEAK * x),
    )
    position = np.where(
        rise,
        v1 * (u - np.sin(_K * u) / _K),
        np.where(
            fall,
            s2 + v2 * y + v1 / _K * (1.0 - np.cos(_K * y)),
            s1 + v1 * x + 0.5 * PEAK * x**2,
        ),
    )
    return position, velocity, acceleration
