"""Reads heights on the container's wall from a FreeSurface message."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slosh_estimator.observer.states import WallHeights
from slosh_estimator.sight import AMBIGUOUS, FROZEN, SATURATED, UNUSABLE, SurfaceFlag
from slosh_estimator.tuning import TUNING

_NOTHING = UNUSABLE | SATURATED | AMBIGUOUS | FROZEN | int(SurfaceFlag.CONTESTED)
_NO_POINTS = np.empty((0, 3))


class SurfaceHeights(NamedTuple):
    """The fields of FreeSurface.msg, in the same units."""

    msh: float
    msh_stddev: float
    azimuth: float
    fitted_msh: float
    fitted_msh_stddev: float
    fitted_azimuth: float
    sh_left: float
    sh_right: float
    azimuth_left: float
    azimuth_right: float
    slope_angle: float
    flags: int


def wall_heights(stamp_ns: int, surface: SurfaceHeights) -> WallHeights:
    """Returns measured wall heights by azimuth: at both image edges, the crest and the zero line.

    A fitted wave has no height a quarter of a turn beside its maximum. A side view shows the two
    edges alone. Heights that are lower bounds or do not show this moment are left out.
    """
    if surface.flags & _NOTHING:
        return WallHeights(stamp_ns, _NO_POINTS)
    stddev = _known(surface.msh_stddev)
    places = [
        (surface.azimuth_left, surface.sh_left, stddev),
        (surface.azimuth_right, surface.sh_right, stddev),
    ]
    if math.isnan(surface.slope_angle):
        places.append((surface.azimuth, surface.msh, stddev))
        if math.isfinite(surface.fitted_msh):
            fitted = _known(surface.fitted_msh_stddev)
            quarter = 0.5 * math.pi
            places += [
                (surface.fitted_azimuth + turn, 0.0, fitted) for turn in (-quarter, quarter)
            ]
    seen = [place for place in places if all(map(math.isfinite, place))]
    if not seen and math.isfinite(surface.msh):  # a sensor that tells no place
        seen = [(math.nan, surface.msh, stddev)]
    return WallHeights(stamp_ns, np.array(seen).reshape(-1, 3))


def _known(stddev: float) -> float:
    """Returns a standard deviation [m], raised to a minimum; a default if not finite."""
    if not math.isfinite(stddev):
        return TUNING.usual_stddev
    return max(stddev, TUNING.least_stddev)
