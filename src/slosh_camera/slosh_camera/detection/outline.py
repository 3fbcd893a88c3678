"""Where a container's outline, height scale and fitted surface lie in the image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_camera.measurement import Measurement
from slosh_camera.optics.box import BoxView
from slosh_camera.optics.cup import CupView

FloatArray = NDArray[np.float64]

_AROUND = 73
_FITTED_POINTS = 241


def levels(view: CupView | BoxView) -> tuple[float, float]:
    """Heights of the container's floor and rim above the still level [m].

    Of an unknown rim a height stands in that leaves room for most waves.
    """
    if isinstance(view, BoxView):
        holder, size = view.box, view.box.width
        return -holder.fill_height, holder.rim_level or 0.5 * size
    cup = view.cup
    return -cup.fill_height, cup.rim_level or cup.radius


def outline(view: CupView | BoxView) -> FloatArray:
    """Pixels (N, 2) of the container's rim and floor; NaN where the camera cannot see."""
    ends = levels(view)
    if isinstance(view, BoxView):
        half = 0.5 * view.box.width
        return np.vstack([view.project_face([-half, half], level) for level in ends])
    around = np.linspace(-np.pi, np.pi, _AROUND)
    return np.vstack([view.project_wall(around, level) for level in ends])


def scale_places(view: CupView | BoxView, heights: FloatArray) -> FloatArray:
    """Pixels (N, 2) of heights (N,) [m] on the container's right edge in the image.

    On a round container it is the outer edge, which nothing bends.
    """
    if isinstance(view, BoxView):
        return view.project_face(0.5 * view.box.width, heights)
    azimuth = view.tangent_azimuths()[1]
    points = view.wall_points(azimuth, heights)
    points[:, :2] *= 1.0 + view.cup.wall_thickness / view.cup.radius
    return view.project(points)


def fitted_line(view: CupView | BoxView, measurement: Measurement) -> FloatArray:
    """Pixels (N, 2) of the surface that was fitted; empty where none was.

    On a cylinder's wall every mode of one azimuthal wave is a cosine; of a side view it is the
    straight line.
    """
    if isinstance(view, BoxView):
        slope = np.tan(measurement.slope_angle)
        half = 0.5 * view.box.width
        x = np.linspace(-half, half, _FITTED_POINTS // 3)
        rest = measurement.profile_height - slope * measurement.profile_x
        if not np.any(np.isfinite(rest)):
            return np.empty((0, 2))
        return view.project_face(x, np.nanmean(rest) + slope * x)
    height, azimuth = measurement.fitted_msh, measurement.fitted_azimuth
    if not (np.isfinite(height) and np.isfinite(azimuth)):
        return np.empty((0, 2))
    around = view.camera_azimuth + np.linspace(-np.pi, np.pi, _FITTED_POINTS)
    return view.project_wall(around, height * np.cos(around - azimuth))
