"""Heights on an inclined wall from those on the upright wall, on which surfaces are fitted."""

from __future__ import annotations

from dataclasses import replace

from slosh_base.types import Array
from slosh_camera.measurement import Measurement
from slosh_camera.optics.cup import Cup


def on_inclined_wall(measurement: Measurement, cup: Cup, zero: float) -> Measurement:
    """Returns a measurement on the container's own wall.

    Args:
        measurement: with upright heights, as `Cup.upright` gives them.
        cup: the container.
        zero: upright height of the still level, from which the heights are counted [m].
    """
    if not cup.taper:
        return measurement
    rest = float(cup.leaning(zero))

    def height(upright: float) -> float:
        return float(cup.leaning(upright + zero)) - rest

    def stddev(spread: float, upright: float) -> float:
        return spread / float(1.0 - cup.taper / cup.radius * (upright + zero)) ** 2

    profile: Array = cup.leaning(measurement.profile_height + zero) - rest
    return replace(
        measurement,
        msh=height(measurement.msh),
        msh_stddev=stddev(measurement.msh_stddev, measurement.msh),
        fitted_msh=height(measurement.fitted_msh),
        fitted_msh_stddev=stddev(measurement.fitted_msh_stddev, measurement.fitted_msh),
        sh_left=height(measurement.sh_left),
        sh_right=height(measurement.sh_right),
        profile_height=profile,
        level_change=height(measurement.level_change),
        level_change_stddev=stddev(measurement.level_change_stddev, measurement.level_change),
    )
