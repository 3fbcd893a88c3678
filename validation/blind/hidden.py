"""Effects that a test case may hide: parameter ranges, and needs of motions and base model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from validation.blind.motions import Need
from validation.blind.truth_model import Truth

Random = np.random.Generator
Draw = Callable[[Random, Truth], dict[str, float]]


def sign(random: Random) -> float:
    """Draws -1 or +1."""
    return float(random.choice([-1.0, 1.0]))


def uniform(**ranges: tuple[float, float]) -> Draw:
    """Returns a function that draws each parameter uniformly from its range."""
    return lambda random, _: {name: random.uniform(*pair) for name, pair in ranges.items()}


def logarithmic(**ranges: tuple[float, float]) -> Draw:
    """Returns a function that draws each parameter log-uniformly from its range."""
    return lambda random, _: {
        name: float(np.exp(random.uniform(*np.log(pair)))) for name, pair in ranges.items()
    }


def either_side(centre: float, low: float, high: float, name: str) -> Draw:
    """Returns a function that draws a parameter at a distance from its neutral value."""

    def draw(random: Random, _: Truth) -> dict[str, float]:
        return {name: centre + sign(random) * random.uniform(low, high)}

    return draw


def _damping_factor(random: Random, _: Truth) -> dict[str, float]:
    factor = float(np.exp(random.uniform(np.log(1.3), np.log(3.0))))
    return {"factor": factor if random.random() < 0.6 else 1.0 / factor}


def _fill_level(random: Random, truth: Truth) -> dict[str, float]:
    low = max(-0.025, 0.35 * truth.radius - truth.fill_height)
    delta = random.uniform(low, -0.004) if random.random() < 0.6 else random.uniform(0.004, 0.025)
    return {"delta": delta}


def _static_tilt(random: Random, _: Truth) -> dict[str, float]:
    size, side = np.radians(random.uniform(0.5, 5.0)), random.uniform(0, 2.0 * np.pi)
    return {"roll": float(size * np.cos(side)), "pitch": float(size * np.sin(side))}


def _lever(random: Random, _: Truth) -> dict[str, float]:
    return {axis: sign(random) * random.uniform(0.02, 0.25) for axis in "xyz"}


def _anisotropy(random: Random, _: Truth) -> dict[str, float]:
    return {"e": random.uniform(0.01, 0.12), "axis": random.uniform(0.0, np.pi)}


def _cubic(random: Random, _: Truth) -> dict[str, float]:
    beta = random.uniform(1.0, 6.0) if random.random() < 0.7 else -random.uniform(1.0, 3.0)
    return {"beta": beta, "axis": random.uniform(0.0, np.pi)}


def changing(least: float, most: float, settled: float) -> Draw:
    """Returns a function that draws the parameters of an effect that changes with time.

    Args:
        least, most: the factor from the first to the last, or its inverse.
        settled: the size is right at a time up to this share of the way.
    """

    def draw(random: Random, _: Truth) -> dict[str, float]:
        rise = sign(random) * random.uniform(np.log(least), np.log(most))
        start = float(np.exp(-rise * random.uniform(0.0, settled)))
        if random.random() < 0.5:
            return {"motion": rise / MOTION, "start": start}
        return {"session": rise / SESSION, "start": start}

    return draw


PLAIN = Need()
MOTION, SESSION = 5.0, 120.0
"""About how long a motion lasts, and several with pauses [s]."""


@dataclass(frozen=True, slots=True)
class Hidden:
    """An effect that a test case can hide, with its parameter range and its needs.

    Attributes:
        draw: its parameters.
        need: what the motions must have.
        planar_base: the base must lack the vertical acceleration.
        linear_base: the base must be linear.
        upright: the container must not turn.
        msh_only: only the maximum is measured.
        own_clock: the heights' clock must be the inputs' own.
        own_level: the heights' zero must be the still level.
    """

    draw: Draw = lambda _random, _truth: {}
    need: Need = PLAIN
    planar_base: bool = False
    linear_base: bool = False
    upright: bool = False
    msh_only: bool = False
    own_clock: bool = False
    own_level: bool = False


LISTED: Mapping[str, Hidden] = {
    "vertical_acceleration": Hidden(need=Need(vertical=True), planar_base=True),
    "surface_nonlinearity": Hidden(uniform(alpha=(0.3, 0.9)), linear_base=True),
    "second_mode": Hidden(logarithmic(damping_ratio=(0.004, 0.05)), Need(fast=True)),
    "damping_mismatch": Hidden(_damping_factor),
    "quadratic_damping": Hidden(logarithmic(beta=(0.02, 0.4))),
    "contact_line_friction": Hidden(logarithmic(mu=(0.001, 0.012))),
    "fill_level": Hidden(_fill_level),
    "fill_loss": Hidden(logarithmic(rate=(1.0e-4, 3.0e-3)), own_level=True),
    "anisotropic_stiffness": Hidden(_anisotropy),
    "yaw_coupling": Hidden(uniform(kappa=(0.05, 1.0)), Need(yaw=True)),
    "gravity_tilt": Hidden(need=Need(tilt=True)),
    "static_tilt": Hidden(_static_tilt, upright=True, own_level=True),
    "lever_arm": Hidden(_lever, Need(yaw=True)),
    "robot_dynamics": Hidden(
        uniform(frequency=(15.0, 90.0), damping_ratio=(0.3, 1.2)), upright=True, own_clock=True
    ),
    "accel_gain": Hidden(either_side(1.0, 0.03, 0.3, "gain")),
    "time_offset": Hidden(either_side(0.0, 0.005, 0.08, "tau"), own_clock=True),
    "height_scale": Hidden(either_side(1.0, 0.03, 0.3, "gain")),
    "height_offset": Hidden(either_side(0.0, 0.0004, 0.006, "offset"), own_level=True),
    "frame_saturation": Hidden(uniform(cap=(0.004, 0.025)), own_level=True),
    "visible_arc": Hidden(
        uniform(centre=(-np.pi, np.pi), width=(0.5, 4.0)),
        upright=True,
        msh_only=True,
    ),
    "crest_asymmetry": Hidden(uniform(kappa=(0.1, 0.8))),
    "draining_film": Hidden(logarithmic(speed=(0.02, 0.25))),
    "sensor_lag": Hidden(uniform(time=(0.008, 0.06)), own_clock=True),
    "amplitude_damping": Hidden(logarithmic(gamma=(5.0, 60.0))),
}
"""Listed effects, with a physically sensible range of every parameter."""

OUTSIDE: Mapping[str, Hidden] = {
    "damping_drift": Hidden(uniform(start=(1.6, 3.0), time=(50.0, 200.0))),
    "cubic_spring": Hidden(_cubic),
    "coriolis": Hidden(either_side(0.0, 0.2, 3.0, "rate")),
    "accel_compression": Hidden(uniform(gamma=(0.003, 0.0065))),
    "damping_growth": Hidden(changing(1.5, 5.0, 1.0)),
    "gain_drift": Hidden(changing(1.1, 1.6, 1.0), own_level=True),
}
"""What no listed effect is."""

NEAREST: Mapping[str, frozenset[str]] = {
    "damping_drift": frozenset({"damping_mismatch", "quadratic_damping", "contact_line_friction"}),
    "cubic_spring": frozenset({"surface_nonlinearity", "anisotropic_stiffness"}),
    "coriolis": frozenset({"yaw_coupling", "anisotropic_stiffness"}),
    "accel_compression": frozenset({"accel_gain", "height_scale", "surface_nonlinearity"}),
    "damping_growth": frozenset({"damping_mismatch", "amplitude_damping"}),
    "gain_drift": frozenset({"accel_gain", "height_scale"}),
}
"""The listed effects that are physically nearest."""
