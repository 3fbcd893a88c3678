"""Result of detecting the free surface in one image."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum, IntFlag
from typing import Self

import numpy as np

from slosh_base.types import Array

NAN = float("nan")


class Flag(IntFlag):
    """Bits that limit the validity of a measurement, as in slosh_msgs/FreeSurface."""

    NONE = 0
    SATURATED = 1
    TOO_DARK = 2
    TOO_BRIGHT = 4
    BLURRED = 8
    OCCLUDED = 16
    NOT_FOUND = 32
    FROZEN = 64
    BAD_IMAGE = 128
    CONTESTED = 256
    AMBIGUOUS = 512
    LEVEL_CHANGED = 1024


class PeakSide(IntEnum):
    """Part of the wall with the highest point, seen from the camera, as in slosh_msgs/FreeSurface.

    >>> PeakSide(2).name
    'REAR'
    """

    UNKNOWN = 0
    FRONT = 1
    REAR = 2


def _no_values() -> Array:
    return np.empty(0)


def _no_pixels() -> Array:
    return np.empty((0, 2))


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """Free surface measured in one image; heights are above the level at rest, NaN if unknown.

    >>> Flag.TOO_DARK in Measurement(stamp_ns=0).flagged(Flag.TOO_DARK).flags
    True

    Attributes:
        stamp_ns: moment of exposure [ns].
        msh: highest point of the wall [m], as seen; where it is hidden, as fitted, if that is the
            surer; a lower bound where SATURATED.
        msh_stddev: standard deviation of msh [m].
        azimuth: azimuth of that point [rad]; 0 or pi in a side view.
        fitted_msh: highest point of the fitted surface on the whole wall [m].
        fitted_msh_stddev: standard deviation of fitted_msh [m].
        fitted_azimuth: azimuth of the fitted highest point [rad].
        sh_left: height at the left edge of the inner wall in the image [m].
        sh_right: height at the right edge [m].
        azimuth_left: azimuth of the left edge [rad].
        azimuth_right: azimuth of the right edge [rad].
        slope_angle: of the straight line fitted to a side view [rad], positive where the liquid
            rises towards the container's +x, to the right.
        profile_azimuth: (N,) azimuths of the line on the wall [rad]: the front wall from left to
            right, then the rear wall, where it is seen, from right to left.
        profile_x: (N,) places of a side view's line [m], at equal distances from the left wall to
            the right wall; profile_azimuth is then empty.
        profile_height: (N,) heights of the line [m]; NaN where a side view's line is hidden.
        edge_pixels: (M, 2) the line in the image [px]; of a cylinder, point by point the profile.
        peak_pixel: (u, v) of the peak [px].
        peak_side: the wall that carries the peak.
        level_change: level of the liquid above that of the still image [m], where it has changed.
        level_change_stddev: standard deviation of level_change [m].
    """

    stamp_ns: int
    msh: float = NAN
    msh_stddev: float = NAN
    azimuth: float = NAN
    fitted_msh: float = NAN
    fitted_msh_stddev: float = NAN
    fitted_azimuth: float = NAN
    sh_left: float = NAN
    sh_right: float = NAN
    azimuth_left: float = NAN
    azimuth_right: float = NAN
    slope_angle: float = NAN
    profile_azimuth: Array = field(default_factory=_no_values)
    profile_x: Array = field(default_factory=_no_values)
    profile_height: Array = field(default_factory=_no_values)
    edge_pixels: Array = field(default_factory=_no_pixels)
    peak_pixel: tuple[float, float] = (NAN, NAN)
    peak_side: PeakSide = PeakSide.UNKNOWN
    level_change: float = NAN
    level_change_stddev: float = NAN
    flags: Flag = Flag.NONE

    def flagged(self, flag: Flag) -> Self:
        """Returns a copy of the measurement with one more flag set."""
        return replace(self, flags=self.flags | flag)


def bad_image(stamp_ns: int) -> Measurement:
    """Returns the measurement, without heights, of an image that could not be decoded.

    >>> bad_image(stamp_ns=0).flags == Flag.BAD_IMAGE
    True
    """
    return Measurement(stamp_ns=stamp_ns, flags=Flag.BAD_IMAGE)
