"""Which flags limit what a fitted surface says."""

from __future__ import annotations

import numpy as np

from slosh_camera.cylinder.surface_evidence import INLIER, SurfaceFit, Unrolled
from slosh_camera.cylinder.surface_prior import HIGHEST
from slosh_camera.cylinder.wall_geometry import WallGeometry
from slosh_camera.measurement import Flag

_LEAST_POINTS = 10
# Part of the scan lines that must show an edge of the fitted surface for it to be one, and part
# that may be hidden without a remark.
_LEAST_READ = 0.5
_HIDDEN = 0.13
# Lines that must reach the image's border for the surface to be cut off.
_CUT_LINES = 2


def surface_flags(wall: WallGeometry, view: Unrolled, fit: SurfaceFit) -> Flag:
    """Flags of a fit to a picture; NOT_FOUND where too few edges agree with it.

    Args:
        wall: tables of the scan lines.
        view: the picture.
        fit: a surface and its edges.
    """
    flags = Flag.TOO_BRIGHT if view.clipped else Flag.NONE
    points = fit.points
    front = (fit.front_weight > INLIER) & ~points.bound
    upper = fit.upper_weight > INLIER
    if _is_cut_off(wall, fit):
        flags |= Flag.SATURATED
    looked_at = np.count_nonzero(~points.bound)
    read = np.count_nonzero(front | (upper & ~points.bound))
    impossible = float(np.hypot(*fit.heights[1:3])) > HIGHEST * wall.radius
    if impossible or read < max(_LEAST_READ * looked_at, _LEAST_POINTS):
        return flags | Flag.NOT_FOUND
    if read < (1.0 - _HIDDEN) * looked_at:
        flags |= Flag.OCCLUDED
    return flags


def _is_cut_off(wall: WallGeometry, fit: SurfaceFit) -> bool:
    """Whether liquid or its surface reaches the image's border, in the image or by the fit."""
    cut = fit.points.bound & (wall.first_row > 0)
    if np.count_nonzero(cut) >= _CUT_LINES:
        return True
    return bool(np.any(wall.beyond_border(fit.heights)))
