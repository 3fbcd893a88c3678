"""The pinhole camera with the plumb-bob distortion of OpenCV and ROS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slosh_camera.errors import SloshCameraError

FloatArray = NDArray[np.float64]

PLUMB_BOB = "plumb_bob"
_NEWTON_STEPS = 20
_TOLERANCE = 1e-10


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """Intrinsic parameters of an optical camera: x right, y down, z forward.

    The centre of the image's top-left pixel is (0, 0).

    Attributes:
        width: image width [px].
        height: image height [px].
        fx: focal length along a row [px].
        fy: focal length along a column [px].
        cx: column of the principal point [px].
        cy: row of the principal point [px].
        distortion: plumb-bob coefficients k1, k2, p1, p2, k3.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Refuse a camera that cannot be."""
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
        if len(self.distortion) != 5 or not np.all(np.isfinite(self.distortion)):
            raise SloshCameraError(
                f"distortion: {self.distortion}, must be five finite numbers k1, k2, p1, p2, k3"
            )

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image [px]."""
        return self.width, self.height

    @property
    def matrix(self) -> FloatArray:
        """Camera matrix K, (3, 3) [px]."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def check(self, image: NDArray[np.generic]) -> None:
        """Refuse an image that cannot be of this camera.

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

    def project(self, points: ArrayLike) -> FloatArray:
        """Project points of the camera frame into the image.

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
        if any(self.distortion):
            distorted, jacobian = self._distort(normalised)
            distorted[~_is_unfolded(jacobian)] = np.nan
            normalised = distorted
        return normalised * (self.fx, self.fy) + (self.cx, self.cy)

    def rays(self, pixels: ArrayLike) -> FloatArray:
        """Directions in which pixels look.

        Args:
            pixels: (N, 2) pixels (u, v).

        Returns:
            (N, 3) directions in the optical frame, scaled to z = 1; NaN where the distortion
            has no inverse.
        """
        array = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        target = (array - (self.cx, self.cy)) / (self.fx, self.fy)
        normalised = self._undistort(target) if any(self.distortion) else target
        return np.column_stack((normalised, np.where(np.isfinite(normalised[:, 0]), 1.0, np.nan)))

    def _distort(self, normalised: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distorted coordinates (N, 2) and their Jacobian (N, 2, 2)."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = normalised[:, 0], normalised[:, 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)
        distorted = np.column_stack(
            (
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            )
        )
        jacobian = np.empty((x.size, 2, 2))
        jacobian[:, 0, 0] = radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
        jacobian[:, 1, 1] = radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
        jacobian[:, 0, 1] = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
        jacobian[:, 1, 0] = jacobian[:, 0, 1]
        return distorted, jacobian

    def _undistort(self, target: FloatArray) -> FloatArray:
        """Newton's method on the distortion; NaN where it finds no solution."""
        normalised = target.copy()
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON_STEPS):
                distorted, jacobian = self._distort(normalised)
                error = distorted - target
                if np.all(np.abs(error) < _TOLERANCE):
                    break
                normalised = normalised - _solve(jacobian, error)
            distorted, jacobian = self._distort(normalised)
            solved = np.all(np.abs(distorted - target) < 10.0 * _TOLERANCE, axis=1)
            solved &= _is_unfolded(jacobian)
        normalised[~solved] = np.nan
        return normalised


def camera_from_info(
    k: Sequence[float],
    d: Sequence[float],
    width: int,
    height: int,
    model: str = PLUMB_BOB,
) -> PinholeCamera:
    """Camera from the fields of a sensor_msgs/CameraInfo.

    Args:
        k: camera matrix, nine numbers row by row [px].
        d: distortion coefficients: none, or four or five of the plumb-bob model.
        width: image width [px].
        height: image height [px].
        model: name of the distortion model.

    Returns:
        The camera.

    Raises:
        SloshCameraError: the camera is not calibrated (K[0] is 0), a number is not finite, or
            the distortion model is not supported.
    """
    matrix = [float(value) for value in k]
    coefficients = [float(value) for value in d]
    if len(matrix) != 9:
        raise SloshCameraError(f"camera_matrix: {len(matrix)} numbers, needs 9")
    if matrix[0] == 0.0:
        raise SloshCameraError(
            "camera_matrix: K[0] is 0, the camera is not calibrated; `slosh intrinsics` does it"
        )
    if coefficients and model != PLUMB_BOB:
        raise SloshCameraError(f"distortion_model: {model!r} is not supported, use {PLUMB_BOB}")
    if len(coefficients) not in (0, 4, 5):
        raise SloshCameraError(
            f"distortion_coefficients: {len(coefficients)} numbers, {PLUMB_BOB} has 0, 4 or 5"
        )
    if matrix[1] or matrix[3] or matrix[6] or matrix[7] or matrix[8] != 1.0:
        raise SloshCameraError("camera_matrix: must be [fx 0 cx; 0 fy cy; 0 0 1]")
    k1, k2, p1, p2, k3 = coefficients + [0.0] * (5 - len(coefficients))
    return PinholeCamera(
        width=width,
        height=height,
        fx=matrix[0],
        fy=matrix[4],
        cx=matrix[2],
        cy=matrix[5],
        distortion=(k1, k2, p1, p2, k3),
    )


def _determinant(jacobian: FloatArray) -> FloatArray:
    determinant: FloatArray = (
        jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] * jacobian[:, 1, 0]
    )
    return determinant


def _is_unfolded(jacobian: FloatArray) -> NDArray[np.bool_]:
    """Where the distortion keeps the order of points: both eigenvalues are positive."""
    trace = jacobian[:, 0, 0] + jacobian[:, 1, 1]
    return np.asarray((_determinant(jacobian) > 0.0) & (trace > 0.0))


def _solve(jacobian: FloatArray, error: FloatArray) -> FloatArray:
    determinant = _determinant(jacobian)
    return np.column_stack(
        (
            (jacobian[:, 1, 1] * error[:, 0] - jacobian[:, 0, 1] * error[:, 1]) / determinant,
            (jacobian[:, 0, 0] * error[:, 1] - jacobian[:, 1, 0] * error[:, 0]) / determinant,
        )
    )
