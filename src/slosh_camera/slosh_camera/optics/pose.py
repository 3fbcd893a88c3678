"""Pose of a camera: the rigid transform from the container's frame to the camera's frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from slosh_base.types import Array
from slosh_camera.errors import SloshCameraError

_ORTHONORMAL_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Rigid transform container -> camera: X_camera = rotation X_container + translation.

    Attributes:
        rotation: (3, 3), orthonormal, determinant +1.
        translation: (3,) [m].
    """

    rotation: Array
    translation: Array

    def __post_init__(self) -> None:
        """Copies and checks the arrays and makes them read-only."""
        rotation = _frozen(self.rotation, (3, 3), "rotation")
        translation = _frozen(self.translation, (3,), "translation")
        deviation = float(np.max(np.abs(rotation @ rotation.T - np.eye(3))))
        if deviation > _ORTHONORMAL_TOLERANCE:
            raise SloshCameraError(f"rotation: is not orthonormal, off by {deviation:.2g}")
        if np.linalg.det(rotation) < 0.0:
            raise SloshCameraError("rotation: has determinant -1, it mirrors; must be +1")
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    @property
    def camera_centre(self) -> Array:
        """Position of the camera in the container frame, (3,) [m]."""
        centre: Array = -self.rotation.T @ self.translation
        return centre


def look_at(camera_centre: ArrayLike, target: ArrayLike) -> Pose:
    """Creates the pose of an upright camera that looks at a point.

    Args:
        camera_centre: (3,) camera's centre in the container frame [m].
        target: (3,) point on the optical axis, in the container frame [m].

    Returns:
        The pose; image columns are as parallel to the container's axis as can be.

    Raises:
        SloshCameraError: the camera would look along the container's axis.
    """
    centre = np.asarray(camera_centre, dtype=np.float64)
    forward = np.asarray(target, dtype=np.float64) - centre
    right = np.cross(forward, (0.0, 0.0, 1.0))
    length = float(np.linalg.norm(right))
    if not (np.isfinite(length) and length > 1e-9):
        raise SloshCameraError("camera: looks along the container's axis, no upright pose")
    right /= length
    forward /= np.linalg.norm(forward)
    rotation = np.vstack((right, np.cross(forward, right), forward))
    return Pose(rotation, -rotation @ centre)


def _frozen(values: ArrayLike, shape: tuple[int, ...], name: str) -> Array:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise SloshCameraError(f"{name}: has shape {array.shape}, needs {shape}")
    if not np.all(np.isfinite(array)):
        raise SloshCameraError(f"{name}: holds a number that is not finite")
    array.setflags(write=False)
    return array
