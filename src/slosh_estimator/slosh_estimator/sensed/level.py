"""Computes wall heights from a level sensor anywhere above the liquid."""

from __future__ import annotations

import math
from typing import NamedTuple

from slosh_estimator.errors import SloshEstimatorError
from slosh_model.bessel import radial_shape
from slosh_model.model import Model
from slosh_model.outline_wall import place_at_corners


class LevelPlace(NamedTuple):
    """Place on the surface at which a level sensor measures.

    Attributes:
        azimuth: about the container's axis [rad].
        radius: distance from the axis [m].
    """

    azimuth: float
    radius: float


def wall_factor(model: Model, place: LevelPlace) -> float:
    """Returns the ratio of the first mode's height at the wall to that at a place.

    In a round container the wave follows J₁(ξ₁r/R), else a sine up to the wall.

    Raises:
        SloshEstimatorError: the place is outside the container, or so near the axis that the wave
            is hardly seen; one line.
    """
    reach_x, reach_y = model.container.reaches
    c, s = math.cos(place.azimuth), math.sin(place.azimuth)
    corners = model.container.corners
    if len(corners):
        there = place_at_corners(place.azimuth, corners, len(corners), reach_x, reach_y)
        share = place.radius / max(math.hypot(reach_x * there[0], reach_y * there[1]), 1e-9)
        here = math.sin(0.5 * math.pi * min(share, 1.0))
    elif model.container.cornered:
        share = max(abs(c) * place.radius / reach_x, abs(s) * place.radius / reach_y)
        here = math.sin(0.5 * math.pi * min(share, 1.0))
    else:
        share = place.radius / reach_x
        here = float(radial_shape(1, min(share, 1.0)))
    if share > 1.0 + 1e-6:
        raise SloshEstimatorError(
            f"the level sensor is {1e3 * place.radius:.0f} mm from the axis, outside the container"
        )
    if share < 0.1:
        raise SloshEstimatorError(
            f"the level sensor is {1e3 * place.radius:.0f} mm from the axis, where no wave is "
            "seen: mount it near the wall"
        )
    return 1.0 / here


def strange_height(height: float, model: Model) -> str:
    """Returns why a height [m] above the still level is impossible, in one line; else empty."""
    container = model.container
    floor, top = -container.fill_height, max(container.fill_height, *container.reaches)
    if floor <= height <= top:
        return ""
    hint = ""
    if floor <= 1e-3 * height <= top:
        hint = ": is the sensor's value in mm? It must be m, and level_distance its zero"
    return f"level sensor: a height of {height:.4g} m is not in the container{hint}"
