"""Determines flags that limit the validity of a fitted surface."""

from __future__ import annotations

import numpy as np

from slosh_camera.cylinder.surface_evidence import SurfaceFit, Unrolled
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.cylinder.wall_geometry import WallGeometry
from slosh_camera.measurement import Flag


def surface_flags(wall: WallGeometry, view: Unrolled, fit: SurfaceFit) -> Flag:
    """Returns the flags of a fitted surface; NOT_FOUND if too few edges agree with it.

    Args:
        wall: tables of the scan lines.
        view: the picture.
        fit: a surface and its edges.
    """
    flags = Flag.TOO_BRIGHT if view.clipped else Flag.NONE
    points = fit.points
    front = (fit.front_weight > TUNING.inlier) & ~points.bound
    upper = fit.upper_weight > TUNING.inlier
    if _is_cut_off(wall, fit):
        flags |= Flag.SATURATED
    looked_at = np.count_nonzero(~points.bound)
    read = np.count_nonzero(front | (upper & ~points.bound))
    impossible = float(np.hypot(*fit.heights[1:3])) > TUNING.highest * wall.radius
    if impossible or read < max(TUNING.least_read * looked_at, TUNING.least_samples):
        return flags | Flag.NOT_FOUND
    if read < (1.0 - TUNING.hidden_share) * looked_at:
        flags |= Flag.OCCLUDED
    return flags


def _is_cut_off(wall: WallGeometry, fit: SurfaceFit) -> bool:
    """Whether the liquid or its surface reaches the border of the image."""
    cut = fit.points.bound & (wall.first_row > 0)
    if np.count_nonzero(cut) >= TUNING.cut_lines:
        return True
    return bool(np.any(wall.beyond_border(fit.heights)))
