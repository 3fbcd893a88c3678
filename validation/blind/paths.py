"""Draws horizontal accelerations of robot motions along various paths, unscaled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.blind.laws import LAWS, Law, stroke, window

Array = NDArray[np.float64]
Random = np.random.Generator


@dataclass(frozen=True, slots=True)
class Span:
    """Start and duration of a robot motion [s], and the frequency of its content [Hz].

    Attributes:
        start, duration: of the motion [s].
        frequency: around which the motion's content lies [Hz].
    """

    start: float
    duration: float
    frequency: float


Shape = Callable[[Random, Array, Span], Array]
"""Gives (N, 2) horizontal acceleration of any size, at rest before and after."""


def any_law(random: Random) -> Law:
    """Draws one of the time laws."""
    return LAWS[random.integers(len(LAWS))]


def line(random: Random, t: Array, span: Span) -> Array:
    """Draws accelerations (N, 2) of strokes to and fro along a line, sometimes with pauses."""
    angle = random.choice([0.0, 0.5 * np.pi, random.uniform(0, np.pi)])
    along = _strokes(random, t, span, any_law(random))
    return np.outer(along, [np.cos(angle), np.sin(angle)])


def corner(random: Random, t: Array, span: Span) -> Array:
    """Draws accelerations (N, 2) of successive moves in different directions."""
    law = any_law(random)
    total = np.zeros((len(t), 2))
    start, end = span.start, span.start + span.duration
    while start < end - 0.2:
        duration = min(random.uniform(0.7, 1.4) / span.frequency, end - start)
        angle = random.uniform(0, 2.0 * np.pi)
        size = random.uniform(0.6, 1.0) * duration**2
        acceleration = stroke(t, start, duration, law)[2]
        total += size * np.outer(acceleration, [np.cos(angle), np.sin(angle)])
        start += duration + random.choice([0.0, random.uniform(0.05, 0.4)])
    return total


def _strokes(random: Random, t: Array, span: Span, law: Law) -> Array:
    """Draws the acceleration (N,) of equal strokes to and fro."""
    pause = random.choice([0.0, random.uniform(0.05, 0.3)])
    duration = random.uniform(0.7, 1.2) / span.frequency
    total = np.zeros_like(t)
    start, sign = span.start, 1.0
    while start + duration <= span.start + span.duration + 1e-9:
        total += sign * stroke(t, start, duration, law)[2]
        start += duration + pause
        sign = -sign
    return total


def circle(random: Random, t: Array, span: Span) -> Array:
    """Draws accelerations (N, 2) of whole turns on a circle, from rest to rest."""
    theta, rate, change = _turns(random, t, span)
    sense = random.choice([-1.0, 1.0])
    offset = random.uniform(0, 2.0 * np.pi)
    theta = sense * theta + offset
    x = -np.cos(theta) * rate**2 - np.sin(theta) * sense * change
    y = -np.sin(theta) * rate**2 + np.cos(theta) * sense * change
    return np.column_stack([x, y])


def eight(random: Random, t: Array, span: Span) -> Array:
    """Draws accelerations (N, 2) of whole turns on a figure eight, from rest to rest."""
    slow = Span(span.start, span.duration, 0.7 * span.frequency)
    theta, rate, change = _turns(random, t, slow)
    ratio = random.uniform(0.3, 0.8)
    x = np.cos(theta) * change - np.sin(theta) * rate**2
    y = ratio * (2.0 * np.cos(2 * theta) * change - 4.0 * np.sin(2 * theta) * rate**2)
    return _turned(np.column_stack([x, y]), random.uniform(0, 2.0 * np.pi))


def _turns(random: Random, t: Array, span: Span) -> tuple[Array, Array, Array]:
    """Draws the angle along a closed path, with its first two time derivatives."""
    law = any_law(random)
    count = max(1, round(span.frequency * span.duration * random.uniform(0.5, 0.8)))
    place, speed, acceleration = stroke(t, span.start, span.duration, law)
    turn = 2.0 * np.pi * count
    return turn * place, turn * speed, turn * acceleration


def burst(random: Random, t: Array, span: Span) -> Array:
    """Draws accelerations (N, 2) of an oscillation along a line that swells and fades."""
    angle = random.choice([0.0, 0.5 * np.pi, random.uniform(0, np.pi)])
    along = sine(t, span, random.uniform(0.2, 0.5), random.uniform(0, 2 * np.pi))
    return np.outer(along, [np.cos(angle), np.sin(angle)])


def ellipse(random: Random, t: Array, span: Span) -> Array:
    """Draws accelerations (N, 2) of two oscillations with different frequencies and phases."""
    rise = random.uniform(0.2, 0.5)
    other = Span(span.start, span.duration, span.frequency * random.uniform(0.8, 1.25))
    x = sine(t, span, rise, random.uniform(0, 2 * np.pi))
    y = random.uniform(0.4, 1.0) * sine(t, other, rise, random.uniform(0, 2 * np.pi))
    return _turned(np.column_stack([x, y]), random.uniform(0, 2.0 * np.pi))


def sine(t: Array, span: Span, rise: float, phase: float) -> Array:
    """Returns the second derivative (N,) of a sine multiplied by a window."""
    stage = np.clip((t - span.start) / span.duration, 0.0, 1.0)
    inside = (t > span.start) & (t < span.start + span.duration)
    value, first, second = window(stage, rise)
    first, second = first / span.duration, second / span.duration**2
    rate = 2.0 * np.pi * span.frequency
    angle = rate * (t - span.start) + phase
    whole = second * np.sin(angle) + 2.0 * first * rate * np.cos(angle)
    return np.where(inside, whole - value * rate**2 * np.sin(angle), 0.0)


def _turned(plane: Array, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(plane @ np.array([[c, s], [-s, c]]))


SHAPES: tuple[Shape, ...] = (line, corner, circle, eight, burst, ellipse)
