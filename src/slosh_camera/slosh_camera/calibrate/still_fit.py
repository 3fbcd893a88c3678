"""Quality of a calibrated pose: agreement with image edges, and uncertainty of heights."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.curves import AZIMUTH, Curve, view_at
from slosh_camera.calibrate.doubt import QUANTITIES, GivenView
from slosh_camera.calibrate.fit import PlaceFit
from slosh_camera.calibrate.pose import CameraPlace
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import CupView, Wall

FloatArray = NDArray[np.float64]

HEIGHTS = (-0.02, 0.0, 0.02)
"""Heights at which the error of a measured height is stated [m]."""
# The part of either wall at which it is stated [rad], 0 towards or away from the camera.
_ARC = np.deg2rad(np.linspace(-60.0, 60.0, 13))
# Step of a derivative.
_STEP = 1e-6


@dataclass(frozen=True, slots=True)
class CurveCheck:
    """Agreement of one curve of the container with the image's edges.

    Attributes:
        name: of the curve.
        share: part of its samples that have an edge within 1.5 px, 0 to 1.
        offset: median signed distance of the edges [px]; outwards for a side, upwards for a
            level; NaN: no edges.
        rms: root mean square distance of the edges within 1.5 px [px]; NaN: none.
    """

    name: str
    share: float
    offset: float
    rms: float


@dataclass(frozen=True, slots=True, eq=False)
class StillFit:
    """A calibrated pose and its quality.

    Attributes:
        view: camera, pose and container.
        place: the camera's place about the container.
        stddev: (8,) standard errors of the place's numbers and of what was told about the focal
            length, the wall's thickness and the fill height, in the order and units of
            CameraPlace and of GivenView.off_by; 0 for what was known.
        residual: rms distance between the liquid's outline and the edges [px].
        residual_height: what the residual of the still level is as a height on the front wall [m].
        height_stddev: largest standard error of a height of -20 to 20 mm on the front and on the
            rear wall [m].
        curves: the single curves.
        level_shows: the image shows that the level is a liquid's, or it was told; so do edges
            alone of a pose that is known.
    """

    view: CupView
    place: CameraPlace
    stddev: FloatArray
    residual: float
    residual_height: float
    height_stddev: dict[Wall, float]
    curves: tuple[CurveCheck, ...]
    level_shows: bool = True


def still_fit(fit: PlaceFit, camera: PinholeCamera, azimuth: float) -> StillFit:
    """Returns the calibrated pose and its quality from a fit.

    Args:
        fit: of the container's curves to an image without distortion.
        camera: that took the image, with its distortion.
        azimuth: at which the camera stands about the container's axis [rad].
    """
    lens = replace(
        fit.camera, distortion=camera.distortion, distortion_model=camera.distortion_model
    )
    view = view_at(lens, fit.cup, fit.place, azimuth)
    upright = view_at(fit.camera, fit.cup, fit.place)
    checks = tuple(
        _checked(seen.curve, seen.samples, residual)
        for seen, residual in zip(fit.seen, fit.residuals, strict=True)
    )
    front = [check.rms for check in checks if check.name == Curve.FRONT.value]
    ((u, v),) = upright.project_wall(AZIMUTH, 0.0, Wall.FRONT)
    return StillFit(
        view,
        fit.place,
        _doubtful(fit) * np.sqrt(np.diag(fit.covariance)),
        fit.rms,
        (front[0] if front else float("nan")) * upright.height_per_pixel((u, v), Wall.FRONT),
        {wall: _height_stddev(upright, fit, wall) for wall in Wall},
        checks,
    )


def height_shift(view: CupView, truth: CupView, wall: Wall) -> FloatArray:
    """Returns the height errors that one pose causes if another pose is the true one [m].

    NaN where a ray misses the view's wall.
    """
    shift: FloatArray = _heights(view, truth, wall) - np.repeat(HEIGHTS, _ARC.size)
    return shift


def _checked(curve: Curve, samples: int, residual: FloatArray) -> CurveCheck:
    near = residual[np.abs(residual) < TUNING.inlier]
    rms = float(np.sqrt(np.mean(near**2))) if near.size else float("nan")
    offset = float(np.median(residual)) if residual.size else float("nan")
    return CurveCheck(curve.value, near.size / samples, offset, rms)


def _height_stddev(view: CupView, fit: PlaceFit, wall: Wall) -> float:
    """Returns the largest standard deviation of measured heights due to the pose [m]."""
    told = GivenView(fit.camera, fit.cup)
    here = _heights(view, view, wall)
    columns = []
    for step in _STEP * np.eye(len(fit.covariance)):
        place = CameraPlace(*(fit.place.numbers + step[:-QUANTITIES]))
        other = view_at(*told.off_by(step[-QUANTITIES:]), place)
        columns.append((_heights(other, view, wall) - here) / _STEP)
    slope = np.column_stack(columns)
    variance = np.einsum("ni,ij,nj->n", slope, fit.covariance, slope)
    known = variance[np.isfinite(variance)]
    return _doubtful(fit) * float(np.sqrt(known.max())) if known.size else float("inf")


def _doubtful(fit: PlaceFit) -> float:
    """Returns the factor by which contradictory edges enlarge the pose's standard deviations."""
    return float(np.nanmax([fit.tension, fit.rms / TUNING.usual_residual, 1.0]))


def _heights(view: CupView, truth: CupView, wall: Wall) -> FloatArray:
    """Returns the heights that one pose assigns to wall points projected by another [m]."""
    arc = AZIMUTH + (_ARC if wall is Wall.FRONT else np.pi - _ARC)
    azimuth, height = np.tile(arc, len(HEIGHTS)), np.repeat(HEIGHTS, arc.size)
    return view.on_wall(truth.project_wall(azimuth, height, wall), wall)[1]
