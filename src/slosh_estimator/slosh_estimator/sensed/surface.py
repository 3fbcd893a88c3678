"""What sensors tell of the surface, as the fields of FreeSurface.msg that a camera would fill.

All points that are told are places on the wall whose heights are measured: see
`observer.surface_heights.wall_heights`.
"""

from __future__ import annotations

import math

from slosh_estimator.sensed.force_surface import SensedWave


def wave_fields(wave: SensedWave, reach: float) -> dict[str, float]:
    """Returns the fields of a wave that a force tells, without those that stay unknown.

    A force does not tell the still level: opposite points are as high as they are deep, so that
    their mean says nothing. Their independent errors are halves of their variances, and four of
    them tell what two do: a point's deviation is twice that of the wave.

    Args:
        wave: to tell.
        reach: from the axis to the wall [m].
    """
    height, azimuth, stddev = wave.height, wave.azimuth, 2.0 * wave.stddev
    opposite = math.remainder(azimuth + math.pi, 2.0 * math.pi)
    fields = {"msh": height, "azimuth": azimuth, "msh_stddev": stddev, "sh_left": -height,
              "azimuth_left": opposite}  # fmt: skip
    if wave.turned:
        return fields | {
            "fitted_msh": height, "fitted_azimuth": azimuth, "fitted_msh_stddev": stddev
        }  # fmt: skip
    if height < 0.0:
        fields |= {"msh": -height, "azimuth": opposite}
    # As in a view from the side, where the two edges alone are seen.
    return fields | {
        "sh_right": height, "azimuth_right": azimuth, "slope_angle": math.atan2(height, reach)
    }  # fmt: skip


def level_fields(height: float, azimuth: float, stddev: float) -> dict[str, float]:
    """Returns the fields of a height at one place on the wall [m, rad]."""
    return {"sh_left": height, "azimuth_left": azimuth, "msh_stddev": stddev}
