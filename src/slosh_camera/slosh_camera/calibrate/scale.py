"""Calibrates a side view from a known length in the image plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.box import Box, BoxView
from slosh_camera.optics.calibration import SideCalibration
from slosh_camera.optics.camera import PinholeCamera, Pose
from slosh_camera.optics.round_body import RoundBody, RoundView
from slosh_camera.settings import DetectionSettings

FloatArray = NDArray[np.float64]

# A camera so many lengths away sees no perspective.
_FAR = 1000.0


def calibrate_by_scale(
    size: tuple[int, int],
    left: tuple[float, float],
    right: tuple[float, float],
    length: float,
    fill_height: float,
    rim_height: float | None = None,
    body: RoundBody | None = None,
    distance: float | None = None,
) -> SideCalibration:
    """Calibrates a level side view from the two image points at the ends of the liquid level.

    Args:
        size: width and height of the image [px].
        left: left end of the still level (u, v) [px].
        length: of the line between the two [m].
        fill_height: of the liquid at rest [m].
        rim_height: of the inner wall above the floor [m]; None: unknown.
        body: a body of revolution that is seen, whose silhouette the line goes across; None: a
            face, or a wall of which only the image's plane counts.
        distance: of the camera from that body's axis [m].

    Returns:
        A side view of a container as wide as the line, whose heights are those in the image's
        plane, of a body those in the plane through its axis; `detection.scale_error`
        holds how well the scale is known.

    Raises:
        SloshCameraError: the ends are outside the image, alike, or no level line.
    """
    ends: FloatArray = np.array([left, right], dtype=np.float64)
    if not np.all(np.isfinite(ends)) or np.any(ends < -0.5) or np.any(ends > np.array(size) - 0.5):
        raise SloshCameraError(
            f"scale: a point is outside the image of {size[0]} x {size[1]} pixels"
        )
    if not (np.isfinite(length) and length > 0.0):
        raise SloshCameraError(f"length: {length} m, must be positive")
    across = ends[1] - ends[0]
    pixels = float(np.hypot(*across))
    if across[0] <= 0.0 or pixels < TUNING.least_pixels:
        raise SloshCameraError(
            f"scale: the points lie {across[0]:.0f} px apart, the second must be at least "
            f"{TUNING.least_pixels:g} px to the right of the first"
        )
    roll = float(np.arctan2(across[1], across[0]))
    if abs(roll) > TUNING.most_inclination:
        raise SloshCameraError(
            f"scale: the line is inclined by {np.rad2deg(roll):.0f} deg, must be the still level"
        )
    if body is None:
        distance, ratio = _FAR * length, pixels / length
    else:
        distance = _checked(distance, body)
        ratio = pixels / (length / body.width * body.seen_width(distance))
    focal = ratio * distance
    camera = PinholeCamera(*size, focal, focal, 0.5 * (size[0] - 1), 0.5 * (size[1] - 1))
    c, s = np.cos(roll), np.sin(roll)
    rotation = np.array([[c, 0.0, s], [s, 0.0, -c], [0.0, 1.0, 0.0]])
    middle = np.append((ends.mean(axis=0) - (camera.cx, camera.cy)) / focal, 1.0)
    pose = Pose(rotation, distance * middle)
    view = (
        BoxView(camera, pose, Box(length, fill_height, rim_height=rim_height))
        if body is None
        else RoundView(camera, pose, body)
    )
    error = float(np.hypot(np.sqrt(2.0) * TUNING.scale_click / pixels, TUNING.one_scale))
    return SideCalibration(view, detection=DetectionSettings(scale_error=error))


def _checked(distance: float | None, body: RoundBody) -> float:
    """Returns the camera's distance from a body of revolution [m]; an error if it is unusable.

    Raises:
        SloshCameraError: it is not known, or too short to see both sides.
    """
    if distance is None:
        raise SloshCameraError(
            "distance: is needed for a body of revolution: that of the camera from its axis [m], "
            "within 10 percent"
        )
    if not (np.isfinite(distance) and distance > body.width):
        raise SloshCameraError(
            f"distance: {distance:g} m, must be more than the container's width of "
            f"{body.width:.3g} m"
        )
    return float(distance)
