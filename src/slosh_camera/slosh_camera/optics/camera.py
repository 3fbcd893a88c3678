"""Camera model: pinhole projection with lens distortion, as in OpenCV and ROS, and its pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slosh_base.types import Array
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.lens import (
    COEFFICIENTS,
    EQUIDISTANT,
    PLUMB_BOB,
    is_unfolded,
    lens_of,
    lens_parameters,
)


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """Intrinsic parameters of a camera with axes x right, y down, z forward.

    The centre of the image's top-left pixel is (0, 0).

    Attributes:
        width: image width [px].
        height: image height [px].
        fx: focal length along a row [px].
        fy: focal length along a column [px].
        cx: column of the principal point [px].
        cy: row of the principal point [px].
        distortion: coefficients of the lens, in the order of the model.
        distortion_model: one of slosh_camera.optics.lens.COEFFICIENTS.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    distortion_model: str = PLUMB_BOB

    def __post_init__(self) -> None:
        """Raises SloshCameraError for invalid intrinsic parameters."""
        if self.width < 1 or self.height < 1:
            raise SloshCameraError(
                f"image size: {self.width} x {self.height} pixels, both must be positive"
            )
        for name in ("fx", "fy", "cx", "cy"):
            if not np.isfinite(getattr(self, name)):
                raise SloshCameraError(f"{name}: {getattr(self, name)} is not a finite number")
        for name in ("fx", "fy"):
            if getattr(self, name) <= 0.0:
                raise SloshCameraError(f"{name}: {getattr(self, name)} px, must be positive")
        if self.distortion_model not in COEFFICIENTS:
            raise SloshCameraError(
                f"distortion_model: {self.distortion_model!r} is not one of "
                f"{', '.join(COEFFICIENTS)}"
            )
        count = COEFFICIENTS[self.distortion_model]
        if len(self.distortion) != count or not np.all(np.isfinite(self.distortion)):
            raise SloshCameraError(
                f"distortion: {self.distortion}, must be {count} finite numbers"
            )

    @property
    def distorts(self) -> bool:
        """Whether the lens distorts the image."""
        return self.distortion_model == EQUIDISTANT or any(self.distortion)

    def without_distortion(self) -> PinholeCamera:
        """Returns the camera with the same matrix and without lens distortion."""
        pinhole = (0.0,) * COEFFICIENTS[PLUMB_BOB]
        return replace(self, distortion=pinhole, distortion_model=PLUMB_BOB)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image [px]."""
        return self.width, self.height

    @property
    def matrix(self) -> Array:
        """Camera matrix K, (3, 3) [px]."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def check(self, image: NDArray[np.generic]) -> None:
        """Raises SloshCameraError if an image's size or type does not match the camera.

        Args:
            image: (height, width) grey or (height, width, 3) in colour, 8-bit.

        Raises:
            SloshCameraError: it is of another size or kind.
        """
        size = (self.height, self.width)
        if image.dtype != np.uint8 or image.shape not in (size, (*size, 3)):
            shape = " x ".join(str(length) for length in (*image.shape[1::-1], *image.shape[2:]))
            raise SloshCameraError(
                f"image: {shape} of {image.dtype}, the calibration is for {self.width} x "
                f"{self.height} of uint8, grey or with three colours"
            )

    def project(self, points: ArrayLike) -> Array:
        """Projects points in the camera frame into the image.

        Args:
            points: (N, 3) in the optical frame [m].

        Returns:
            (N, 2) pixels (u, v); NaN for points that are not in front of the camera or lie
            beyond the angle up to which the distortion is invertible. Pixels outside the image
            are returned as they are.
        """
        array = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        depth = np.where(array[:, 2] > 0.0, array[:, 2], np.nan)
        normalised = array[:, :2] / depth[:, np.newaxis]
        if self.distorts:
            lens = lens_of(self.distortion_model, self.distortion)
            distorted, jacobian = lens.distort(normalised)
            distorted[~is_unfolded(jacobian)] = np.nan
            normalised = distorted
        return normalised * (self.fx, self.fy) + (self.cx, self.cy)

    def rays(self, pixels: ArrayLike) -> Array:
        """Returns the viewing directions of pixels in the camera frame.

        Args:
            pixels: (N, 2) pixels (u, v).

        Returns:
            (N, 3) directions in the optical frame, scaled to z = 1; NaN where the distortion
            has no inverse.
        """
        array = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        target = (array - (self.cx, self.cy)) / (self.fx, self.fy)
        normalised = target
        if self.distorts:
            normalised = lens_of(self.distortion_model, self.distortion).undistort(target)
        return np.column_stack((normalised, np.where(np.isfinite(normalised[:, 0]), 1.0, np.nan)))


def camera_from_info(
    k: Sequence[float],
    d: Sequence[float],
    width: int,
    height: int,
    model: str = PLUMB_BOB,
) -> PinholeCamera:
    """Creates a camera from the fields of a sensor_msgs/CameraInfo.

    Args:
        k: camera matrix, nine numbers row by row [px].
        d: distortion coefficients; none: the image is not distorted.
        width: image width [px].
        height: image height [px].

    Raises:
        SloshCameraError: the camera is not calibrated (K[0] is 0), a number is not finite, or
            the distortion model is not supported.
    """
    matrix = [float(value) for value in k]
    if len(matrix) != 9:
        raise SloshCameraError(f"camera_matrix: {len(matrix)} numbers, needs 9")
    if matrix[0] == 0.0:
        raise SloshCameraError(
            "camera_matrix: K[0] is 0, the camera is not calibrated; `slosh intrinsics` does it"
        )
    distortion_model, distortion = lens_parameters(model, d)
    if matrix[1] or matrix[3] or matrix[6] or matrix[7] or matrix[8] != 1.0:
        raise SloshCameraError("camera_matrix: must be [fx 0 cx; 0 fy cy; 0 0 1]")
    return PinholeCamera(
        width=width,
        height=height,
        fx=matrix[0],
        fy=matrix[4],
        cx=matrix[2],
        cy=matrix[5],
        distortion=distortion,
        distortion_model=distortion_model,
    )


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
