"""Draws random robot motions: rest, a path and rest, if needed with lift or rotation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slosh_model.simulate import Inputs
from validation.blind import theory
from validation.blind.laws import stroke
from validation.blind.paths import SHAPES, Span, any_law, sine
from validation.blind.truth import simulate
from validation.blind.truth_model import Truth

Array = NDArray[np.float64]
Random = np.random.Generator

LEAST_ACCELERATION, MOST_ACCELERATION = 1.5, 7.0
LEAST_HEIGHT, MOST_HEIGHT, MOST_SHARE = 0.005, 0.030, 0.55
ATTEMPTS = 60


@dataclass(frozen=True, slots=True)
class Need:
    """What a motion must contain to show a hidden effect, such as rotation or a long rest.

    Attributes:
        vertical: a vertical part.
        yaw, tilt: the container turns about its axis, leans.
        fast: content above the first mode's frequency.
        columns: how the attitude is told: "both", "attitude", "rates" (yaw only).
        dwell: longest dwell [s]; 0: as it comes.
    """

    vertical: bool = False
    yaw: bool = False
    tilt: bool = False
    fast: bool = False
    columns: str = "both"
    dwell: float = 0.0


def robot_motion(random: Random, truth: Truth, need: Need) -> Inputs:
    """Draws a random motion in which the liquid rises by 5 to 30 mm.

    Raises:
        RuntimeError: none found.
    """
    for _ in range(ATTEMPTS):
        inputs, moving = _draw(random, truth, need)
        scaled = _scaled(random, truth, inputs, moving)
        if scaled is not None:
            return scaled
    raise RuntimeError("no motion within the acceleration's limits moves this liquid enough")


def _draw(random: Random, truth: Truth, need: Need) -> tuple[Inputs, Span]:
    own = np.sqrt(theory.frequency_squared(truth.radius, np.array(truth.fill_height))[0])
    ratio = random.uniform(0.4, 1.15) if random.random() < 0.8 else random.uniform(0.3, 1.5)
    if need.fast:
        ratio = random.uniform(1.0, 1.9)
    rest = 0.5 if random.random() < 0.85 else 0.02
    duration = random.uniform(2.5, 4.0)
    dwell = random.uniform(0.7, 1.5) if random.random() < 0.6 else random.uniform(2.0, 3.0)
    dwell = max(dwell, need.dwell)
    rate = random.choice([200.0, 250.0, 400.0, 500.0])
    first = 0.0 if random.random() < 0.7 else round(random.uniform(0.0, 500.0), 3)
    t = np.arange(round((rest + duration + dwell) * rate) + 1) / rate
    span = Span(rest, duration, ratio * own / (2.0 * np.pi))
    shape = SHAPES[random.integers(len(SHAPES))]
    acceleration = np.zeros((len(t), 3))
    acceleration[:, :2] = shape(random, t, span)
    peak = np.linalg.norm(acceleration, axis=1).max()
    acceleration *= random.uniform(LEAST_ACCELERATION, MOST_ACCELERATION) / peak
    if need.vertical:
        acceleration[:, 2] = _vertical(random, t, span, own / (2.0 * np.pi))
    attitude, rates = _attitude(random, t, span, need)
    return Inputs(t + first, acceleration, attitude, rates), span


def _vertical(random: Random, t: Array, span: Span, own: float) -> Array:
    """Draws a vertical acceleration (N,) of 1 to 5 m/s²: a lift or an oscillation."""
    size = random.uniform(1.0, 5.0)
    if random.random() < 0.4:
        law, part = any_law(random), random.uniform(0.25, 0.5) * span.duration
        up = stroke(t, span.start, part, law)[2]
        down = stroke(t, span.start + span.duration - part, part, law)[2]
        shape = up - down
    else:
        frequency = own * random.choice([random.uniform(0.3, 1.6), random.uniform(2.3, 2.6)])
        bounce = Span(span.start, span.duration, frequency)
        shape = sine(t, bounce, random.uniform(0.2, 0.5), random.uniform(0, 2 * np.pi))
    return np.asarray(size * shape / np.abs(shape).max())


def _attitude(
    random: Random, t: Array, span: Span, need: Need
) -> tuple[Array | None, Array | None]:
    """Draws attitude and angular velocity of a tool that tilts to one side and yaws."""
    if not (need.yaw or need.tilt):
        return None, None
    yaw, yaw_rate = _turning(random, t, span, random.uniform(0.4, 2.5) * need.yaw)
    lean, lean_rate = _turning(random, t, span, np.radians(random.uniform(2, 14)) * need.tilt)
    side = random.uniform(0, 2.0 * np.pi)
    axis = np.array([np.cos(side), np.sin(side), 0.0])
    zero = np.zeros_like(t)
    spin = Rotation.from_rotvec(np.column_stack([zero, zero, yaw]))
    attitude = Rotation.from_rotvec(np.outer(lean, axis)) * spin
    rates = spin.inv().apply(np.outer(lean_rate, axis))
    rates[:, 2] += yaw_rate
    if need.columns == "attitude":
        return attitude.as_quat(), None
    if need.columns == "rates" and not need.tilt:
        return None, rates
    return attitude.as_quat(), rates


def _turning(random: Random, t: Array, span: Span, size: float) -> tuple[Array, Array]:
    """Draws an angle (N,) over time and its rate: there and perhaps back, or an oscillation."""
    if size == 0.0:
        return np.zeros_like(t), np.zeros_like(t)
    law, size = any_law(random), size * random.choice([-1.0, 1.0])
    count = random.integers(1, 4)
    duration = span.duration / count
    angle, rate, sign = np.zeros_like(t), np.zeros_like(t), 1.0
    for k in range(count):
        place, speed, _ = stroke(t, span.start + k * duration, duration, law)
        angle += sign * size * place
        rate += sign * size * speed
        sign = -sign
    return angle, rate


def _scaled(random: Random, truth: Truth, inputs: Inputs, moving: Span) -> Inputs | None:
    """Scales a motion so that the liquid rises by 5 to 30 mm; None if that is impossible."""
    ceiling = min(MOST_HEIGHT, MOST_SHARE * truth.radius)
    wanted = random.uniform(LEAST_HEIGHT, ceiling)
    for _ in range(4):
        height = float(simulate(truth, inputs).msh.max())
        if LEAST_HEIGHT <= height <= ceiling and abs(height / wanted - 1.0) < 0.3:
            return inputs if acceptable(inputs) else None
        inputs = _larger(inputs, float(np.clip(wanted / height, 0.2, 5.0)))
        if not acceptable(inputs):
            return None
    return None


def _larger(inputs: Inputs, factor: float) -> Inputs:
    """Returns the motion with its horizontal acceleration multiplied by a factor."""
    acceleration = inputs.acceleration * np.array([factor, factor, 1.0])
    return replace(inputs, acceleration=acceleration)


def acceptable(inputs: Inputs) -> bool:
    """Whether the peak horizontal acceleration is in the range of usual robots."""
    peak = float(np.hypot(inputs.acceleration[:, 0], inputs.acceleration[:, 1]).max())
    return LEAST_ACCELERATION <= peak <= MOST_ACCELERATION
