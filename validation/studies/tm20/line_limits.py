"""Finds the speed limit n_max of a straight surface for other theories and motion laws.

One repetition without noise or scatter; what remains is the theory's own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from tm20.design import (
    FILL_HEIGHT,
    FRAMES,
    GEOMETRIES,
    IDENTIFICATION,
    RATIO,
    SPEEDS,
    STROKE,
    TOLERANCE,
    Geometry,
)
from tm20.experiments import MODES, TENSION, places

from slosh_discovery.identify.validity import count_within
from slosh_model.errors import SloshModelError
from slosh_model.motion_profiles import LAWS, Cycle
from slosh_motion.signals.metrics import line_approximation_error
from slosh_testing.multimodal import Tanks, simulate_tanks

SLOWEST = 30
"""Below no geometry and no truth comes near the tolerance [1/min]."""


@dataclass(frozen=True, slots=True)
class Truth:
    """Theory by which the surface is computed, and the motion law.

    Attributes:
        name: in words.
        law: of the motion.
        order: in the surface's steepness.
        tension: σ/ρ [m³/s²].
        noise: of a measured profile that is added [m].
    """

    name: str
    law: str = IDENTIFICATION.law
    order: int = 3
    tension: float = TENSION
    noise: float = 0.0


WATER = 7.28e-5
"""σ/ρ of clean water [m³/s²]."""
WHOLE = Truth("third order")
TRUTHS = (
    Truth("linear multimodal theory", order=1),
    Truth("second order", order=2),
    WHOLE,
    replace(WHOLE, name="the same, surface tension of water", tension=WATER),
    replace(WHOLE, name="the same, edge error 0.15 mm", noise=0.15e-3),
    *(replace(WHOLE, name=f"the same, {law}", law=law) for law in LAWS if law != WHOLE.law),
)


@dataclass(frozen=True, slots=True)
class Limits:
    """Speed limits of all containers for one theory.

    Attributes:
        truth: it.
        fastest: n_max of each geometry [1/min]; 0: below SLOWEST.
        errors: ε̄ at the n_max of TM20 [m]; NaN: the wave broke.
    """

    truth: Truth
    fastest: tuple[int, ...]
    errors: tuple[float, ...]


def limits(truth: Truth) -> Limits:
    """Computes the speed limits n_max of all containers for one theory."""
    fastest, errors = [], []
    for geometry in GEOMETRIES:
        by_speed = {n: line_error(truth, geometry, n) for n in SPEEDS if n >= SLOWEST}
        count = count_within(list(by_speed.values()), TOLERANCE)
        fastest.append([0, *by_speed][count])
        errors.append(by_speed[geometry.published.fastest])
    return Limits(truth, tuple(fastest), tuple(errors))


def line_error(truth: Truth, geometry: Geometry, speed: int) -> float:
    """Returns the surface's mean deviation ε̄ from a straight line [m]; NaN if it breaks."""
    cycle = Cycle(truth.law, speed, STROKE, RATIO)
    count = round(FRAMES * RATIO)
    times = np.linspace(0.0, cycle.motion_time, 2 * count - 1)
    tanks = Tanks.of(geometry.width, FILL_HEIGHT, geometry.published.damping_ratio, truth.tension)
    try:
        surfaces = simulate_tanks(
            tanks, cycle.at(times)[2][:, np.newaxis], float(times[1]), order=truth.order,
            modes=MODES,
        )  # fmt: skip
    except SloshModelError:
        return float("nan")
    x = places(geometry)
    profile = surfaces.profile(x / geometry.width)[::2, 0]
    return float(np.hypot(line_approximation_error(x, profile), truth.noise))
