"""Computes where a camera sees points of a cup's inner wall through refracting glass.

A ray that crosses coaxial cylinders keeps two numbers: the vertical component of its optical
direction, and its optical angular momentum about the axis. With these two as unknowns the path
through camera - outer wall - inner wall (- air - far inner wall) is a sum of plain terms, and
the ray that meets a given point is found by two nested root searches. This shares nothing with
the detector's geometry.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]


@dataclass(frozen=True)
class View:
    """A camera and a glass cup; lengths in metres, angles in radians.

    Attributes:
        rotation, translation: X_cam = rotation X_cup + translation.
        focal: fx, fy in pixels; centre: cx, cy; k1: OpenCV's first radial coefficient.
        size: width and height in pixels.
        radius, wall: the cup's inner radius and wall thickness.
        rim: height of the cup's rim above the still level.
        index: refractive index of the wall.
    """

    rotation: Array
    translation: Array
    focal: tuple[float, float]
    centre: tuple[float, float]
    size: tuple[int, int]
    k1: float
    radius: float
    wall: float
    rim: float
    index: float

    @property
    def position(self) -> Array:
        """Position of the camera's centre in the cup's frame [m]."""
        return np.asarray(-self.rotation.T @ self.translation)

    @property
    def distance(self) -> float:
        """Horizontal distance of the camera from the cup's axis [m]."""
        return float(np.hypot(self.position[0], self.position[1]))

    @property
    def azimuth(self) -> float:
        """Azimuth of the camera about the cup's axis [rad]."""
        return float(math.atan2(self.position[1], self.position[0]))

    def project(self, point: Array) -> tuple[float, float] | None:
        """Returns the pixel of a point without refraction; None if it is behind the camera."""
        x, y, z = self.rotation @ np.asarray(point, dtype=float) + self.translation
        if z <= 0:
            return None
        x, y = x / z, y / z
        bend = 1 + self.k1 * (x * x + y * y)
        return (
            float(self.focal[0] * x * bend + self.centre[0]),
            float(self.focal[1] * y * bend + self.centre[1]),
        )

    def wall_point(self, azimuth: float, height: float) -> Array:
        """Returns the point of the inner wall at `azimuth` [rad] and `height` [m]."""
        return np.array([self.radius * math.cos(azimuth), self.radius * math.sin(azimuth), height])

    def contains(self, pixel: tuple[float, float]) -> bool:
        """Whether a pixel lies in the image; pixel centres are whole numbers."""
        return -0.5 <= pixel[0] < self.size[0] - 0.5 and -0.5 <= pixel[1] < self.size[1] - 0.5

    def tangents(self) -> tuple[float, float]:
        """Azimuths [rad] where straight lines from the camera touch the inner wall (2,)."""
        half = math.acos(self.radius / self.distance)
        return wrap(self.azimuth - half), wrap(self.azimuth + half)

    def edges(self) -> tuple[float, float]:
        """Azimuths [rad] of the inner wall seen at the cup's visible edges: left, right."""
        outer = self.radius + self.wall
        half = math.acos(outer / self.distance)
        half += math.asin(outer / (self.index * self.radius)) - math.asin(1 / self.index)
        return wrap(self.azimuth - half), wrap(self.azimuth + half)

    def project_refracted(self, azimuth: float, height: float) -> tuple[float, float] | None:
        """Returns the pixel of an inner wall point seen through the glass; None if no ray hits it.

        Points between the apparent edges are taken as front wall (glass only), others as rear
        wall (front glass, then air).
        """
        turn = wrap(azimuth - self.azimuth)
        rear = self._is_rear(azimuth)
        direction = self._direction(turn, height - self.position[2], rear)
        if direction is None:
            return None
        return self.project(self.position + direction)

    def seen(self, azimuth: float, height: float) -> tuple[float, float] | None:
        """Returns the pixel of an inner wall point, through the glass or over the front rim."""
        point = self.wall_point(azimuth, height)
        if self._is_rear(azimuth) and self._crosses_front_at(point) > self.rim:
            return self.project(point)
        return self.project_refracted(azimuth, height)

    def _is_rear(self, azimuth: float) -> bool:
        left, _ = self.edges()
        return abs(wrap(azimuth - self.azimuth)) > abs(wrap(left - self.azimuth))

    def _crosses_front_at(self, point: Array) -> float:
        """Returns the height [m] where the line from a wall point to the camera leaves the cup."""
        towards = self.position - point
        flat = towards[:2]
        # The other intersection of the line with the circle through the point.
        share = -2 * float(point[:2] @ flat) / float(flat @ flat)
        return float(point[2] + share * towards[2])

    def _direction(self, turn: float, rise: float, rear: bool) -> Array | None:
        """Returns the direction from the camera of the ray with given azimuth turn and rise."""

        def excess(vertical: float) -> float:
            momentum = self._momentum(turn, vertical, rear)
            if momentum is None:
                return math.nan
            return self._path(momentum, vertical, rear)[1] - rise

        vertical = _root(excess, rise / math.hypot(self.distance, rise))
        if vertical is None:
            return None
        momentum = self._momentum(turn, vertical, rear)
        if momentum is None:
            return None
        horizontal = math.sqrt(1 - vertical**2)
        angle = self.azimuth + math.pi - math.asin(momentum / (horizontal * self.distance))
        return np.array([horizontal * math.cos(angle), horizontal * math.sin(angle), vertical])

    def _momentum(self, turn: float, vertical: float, rear: bool) -> float | None:
        """Returns the angular momentum of the ray that arrives at azimuth `turn`."""
        air = math.sqrt(1 - vertical**2)
        limit = air * (self.radius if rear else self.radius + self.wall) * (1 - 1e-12)

        # A ray to the rear wall sweeps about pi.
        target = turn % (2 * math.pi) if rear else turn

        def miss(momentum: float) -> float:
            return self._path(momentum, vertical, rear)[0] - target

        if miss(-limit) * miss(limit) > 0:
            return None
        return float(brentq(miss, -limit, limit, xtol=1e-16))

    def _path(self, momentum: float, vertical: float, rear: bool) -> tuple[float, float]:
        """Returns a ray's azimuth change [rad] and rise [m] from the camera to the inner wall."""
        legs = [
            (1.0, self.distance, self.radius + self.wall),
            (self.index, self.radius + self.wall, self.radius),
        ]
        swept = rise = 0.0
        for index, start, end in legs:
            horizontal = math.sqrt(index**2 - vertical**2)
            offset = momentum / horizontal
            swept += math.asin(_unit(offset / end)) - math.asin(_unit(offset / start))
            rise += (_leg(start, offset) - _leg(end, offset)) * vertical / horizontal
        if rear:
            horizontal = math.sqrt(1 - vertical**2)
            offset = momentum / horizontal
            swept += math.pi - 2 * math.asin(_unit(offset / self.radius))
            rise += 2 * _leg(self.radius, offset) * vertical / horizontal
        # A positive momentum here turns counter-clockwise as seen from above.
        return swept, rise


def _root(excess: Callable[[float], float], guess: float) -> float | None:
    """Returns the zero of an increasing function near a guess, or None."""
    for reach, count in ((0.04, 2), (0.35, 41)):
        samples = np.clip(guess + np.linspace(-reach, reach, count), -0.95, 0.95)
        values = [excess(float(sample)) for sample in samples]
        for low, high, a, b in zip(samples, samples[1:], values, values[1:], strict=False):
            if a <= 0 <= b:
                return float(brentq(excess, low, high, xtol=1e-13))
    return None


def wrap(angle: float) -> float:
    """Returns the equivalent angle in (-π, π] [rad]."""
    return math.atan2(math.sin(angle), math.cos(angle))


def _unit(sine: float) -> float:
    return min(1.0, max(-1.0, sine))


def _leg(radius: float, offset: float) -> float:
    return math.sqrt(max(0.0, radius**2 - offset**2))
