"""Lens distortion models: from a ray's direction to an image position, and back.

The models are those of OpenCV and ROS (`sensor_msgs/CameraInfo.distortion_model`). All map
normalised coordinates (x, y) = (X/Z, Y/Z) of the optical frame to distorted ones; the camera
matrix turns these into pixels.

- plumb_bob, rational_polynomial, thin_prism: one formula with 5, 8 or 12 coefficients in
  OpenCV's order k1 k2 p1 p2 k3, k4 k5 k6, s1 s2 s3 s4 (OpenCV, "Camera Calibration and 3D
  Reconstruction").
- equidistant (fisheye): θ = atan(r), θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) in place of r
  (Kannala and Brandt 2006; OpenCV, "Fisheye camera model").
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_camera.errors import SloshCameraError

PLUMB_BOB = "plumb_bob"
RATIONAL_POLYNOMIAL = "rational_polynomial"
THIN_PRISM = "thin_prism"
EQUIDISTANT = "equidistant"
COEFFICIENTS = {PLUMB_BOB: 5, RATIONAL_POLYNOMIAL: 8, THIN_PRISM: 12, EQUIDISTANT: 4}
"""How many coefficients each model has."""
_ALIASES = {
    "radtan": PLUMB_BOB,
    "brown_conrady": PLUMB_BOB,
    "rational": RATIONAL_POLYNOMIAL,
    "fisheye": EQUIDISTANT,
    "kannala_brandt": EQUIDISTANT,
    "kannala_brandt4": EQUIDISTANT,
}
_NO_LENS = ("", "none", "pinhole")
_TILTED = 14
"""OpenCV's longest list: the last two tilt the sensor."""
_NEWTON_STEPS = 20
_TOLERANCE = 1e-10


class Lens(Protocol):
    """Interface of all lens distortion models."""

    def distort(self, normalised: Array) -> tuple[Array, Array]:
        """Returns distorted coordinates (N, 2) of normalised ones, with Jacobians (N, 2, 2)."""

    def undistort(self, distorted: Array) -> Array:
        """Returns normalised coordinates (N, 2) of distorted ones; NaN if there is no solution."""


def lens_of(model: str, coefficients: Sequence[float]) -> Lens:
    """Creates the lens model with a given name and coefficients."""
    if model == EQUIDISTANT:
        return EquidistantLens(coefficients)
    return PolynomialLens(coefficients)


def lens_parameters(model: str, coefficients: Sequence[float]) -> tuple[str, tuple[float, ...]]:
    """Normalises the lens model name and coefficients of a file or message.

    Args:
        model: name of the distortion model, as drivers and calibration programs write it.
        coefficients: as they stand beside it; none: the image is not distorted.

    Returns:
        One of COEFFICIENTS, and as many coefficients.

    Raises:
        SloshCameraError: the model is not supported, or has another number of coefficients.
    """
    given = tuple(float(value) for value in coefficients)
    name = _ALIASES.get(model.lower(), model.lower())
    if name in _NO_LENS or not given:
        if any(given):
            raise SloshCameraError(
                f"distortion_model: {model!r} has no coefficients, but {len(given)} are given; "
                f"name one of {', '.join(COEFFICIENTS)}"
            )
        if name == EQUIDISTANT:
            return EQUIDISTANT, (0.0,) * COEFFICIENTS[EQUIDISTANT]
        return PLUMB_BOB, (0.0,) * COEFFICIENTS[PLUMB_BOB]
    if name not in COEFFICIENTS:
        raise SloshCameraError(
            f"distortion_model: {model!r} is not supported, use one of {', '.join(COEFFICIENTS)}; "
            "or rectify the images and give no coefficients"
        )
    if name == EQUIDISTANT:
        return EQUIDISTANT, _exactly(name, given, (COEFFICIENTS[name],))
    return _polynomial(name, given)


def _polynomial(name: str, given: tuple[float, ...]) -> tuple[str, tuple[float, ...]]:
    """Returns the smallest polynomial lens model that includes all given coefficients."""
    allowed = {PLUMB_BOB: (4, 5), RATIONAL_POLYNOMIAL: (8, 12, _TILTED), THIN_PRISM: (12, _TILTED)}
    given = _exactly(name, given, allowed[name])
    if any(given[12:]):
        raise SloshCameraError(
            f"distortion_coefficients: a tilted sensor ({given[12]:g}, {given[13]:g} rad) is not "
            "supported; rectify the images and give no coefficients"
        )
    held = next(
        model
        for model in (PLUMB_BOB, RATIONAL_POLYNOMIAL, THIN_PRISM)
        if len(given) <= COEFFICIENTS[model] or not any(given[COEFFICIENTS[model] :])
    )
    count = COEFFICIENTS[held]
    return held, (given + (0.0,) * count)[:count]


def _exactly(name: str, given: tuple[float, ...], counts: tuple[int, ...]) -> tuple[float, ...]:
    if not np.all(np.isfinite(given)):
        raise SloshCameraError(f"distortion_coefficients: {given} must be finite numbers")
    if len(given) in counts:
        return given
    *first, last = (0, *counts)
    has = f"{', '.join(map(str, first))} or {last}"
    fits = [model for model, count in COEFFICIENTS.items() if count == len(given) != 4]
    remedy = f": with {len(given)} the model is {fits[0]}, set distortion_model" if fits else ""
    raise SloshCameraError(
        f"distortion_coefficients: {len(given)} numbers, {name} has {has}{remedy}"
    )


class PolynomialLens:
    """Polynomial lens model with radial, decentring and thin-prism terms.

    Args:
        coefficients: 5, 8 or 12 of them.
    """

    def __init__(self, coefficients: Sequence[float]) -> None:
        padded = (*coefficients, *(0.0,) * (COEFFICIENTS[THIN_PRISM] - len(coefficients)))
        self._k1, self._k2, self._p1, self._p2, self._k3 = padded[:5]
        self._below, self._prism = padded[5:8], padded[8:]

    def distort(self, normalised: Array) -> tuple[Array, Array]:
        """Distorts normalised coordinates (N, 2) and computes the Jacobians; see Lens."""
        p1, p2 = self._p1, self._p2
        x, y = normalised[:, 0], normalised[:, 1]
        r2 = x * x + y * y
        radial, slope = self._radial(r2)
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
        if any(self._prism):
            self._add_prism(r2, normalised, distorted, jacobian)
        return distorted, jacobian

    def _radial(self, r2: Array) -> tuple[Array, Array]:
        """Returns the radial distortion factor and its derivative with respect to r²."""
        k1, k2, k3 = self._k1, self._k2, self._k3
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)
        if not any(self._below):
            return radial, slope
        k4, k5, k6 = self._below
        below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
        below_slope = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6)
        # A denominator that has passed zero belongs to no lens.
        below = np.where(below > 0.0, below, np.nan)
        radial = radial / below
        return radial, (slope - radial * below_slope) / below

    def _add_prism(self, r2: Array, normalised: Array, distorted: Array, jacobian: Array) -> None:
        for axis, (linear, square) in enumerate((self._prism[:2], self._prism[2:])):
            distorted[:, axis] += r2 * (linear + r2 * square)
            slope = linear + 2.0 * r2 * square
            jacobian[:, axis] += 2.0 * normalised * slope[:, np.newaxis]

    def undistort(self, distorted: Array) -> Array:
        """Removes the distortion by Newton's method; see Lens."""
        normalised = distorted.copy()
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON_STEPS):
                found, jacobian = self.distort(normalised)
                error = found - distorted
                if np.all(np.abs(error) < _TOLERANCE):
                    break
                normalised = normalised - _solve(jacobian, error)
            found, jacobian = self.distort(normalised)
            solved = np.all(np.abs(found - distorted) < 10.0 * _TOLERANCE, axis=1)
            solved &= is_unfolded(jacobian)
        normalised[~solved] = np.nan
        return normalised


class EquidistantLens:
    """Equidistant fisheye lens model.

    Args:
        coefficients: k1 … k4.
    """

    def __init__(self, coefficients: Sequence[float]) -> None:
        self._k = tuple(coefficients)

    def distort(self, normalised: Array) -> tuple[Array, Array]:
        """Distorts normalised coordinates (N, 2) and computes the Jacobians; see Lens."""
        radius = np.hypot(normalised[:, 0], normalised[:, 1])
        angle = np.arctan(radius)
        turned, turning = self._turned(angle)
        # Along the radius the derivative is dθ_d/dr, across it θ_d/r; both are 1 at r = 0.
        centre = radius < 1e-8
        safe = np.where(centre, 1.0, radius)
        across = np.where(centre, 1.0, turned / safe)
        along = np.where(centre, 1.0, turning / (1.0 + radius * radius))
        unit = np.where(centre[:, np.newaxis], 0.0, normalised / safe[:, np.newaxis])
        jacobian = (along - across)[:, np.newaxis, np.newaxis] * (
            unit[:, :, np.newaxis] * unit[:, np.newaxis, :]
        )
        jacobian[:, 0, 0] += across
        jacobian[:, 1, 1] += across
        return normalised * across[:, np.newaxis], jacobian

    def undistort(self, distorted: Array) -> Array:
        """Removes the distortion by Newton's method on the angle; NaN for 90 deg and more."""
        goal = np.hypot(distorted[:, 0], distorted[:, 1])
        angle = np.minimum(goal, 0.5 * np.pi)
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON_STEPS):
                turned, turning = self._turned(angle)
                angle = angle - (turned - goal) / turning
            turned, turning = self._turned(angle)
            solved = (np.abs(turned - goal) < _TOLERANCE) & (turning > 0.0)
            solved &= (angle >= 0.0) & (angle < 0.5 * np.pi)
            scale = np.where(goal > 1e-8, np.tan(angle) / np.maximum(goal, 1e-300), 1.0)
        normalised: Array = distorted * scale[:, np.newaxis]
        normalised[~solved] = np.nan
        return normalised

    def _turned(self, angle: Array) -> tuple[Array, Array]:
        """Returns the distorted angle θ_d and its derivative with respect to θ."""
        k1, k2, k3, k4 = self._k
        square = angle * angle
        factor = 1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4)))
        turning = 1.0 + square * (
            3.0 * k1 + square * (5.0 * k2 + square * (7.0 * k3 + square * 9.0 * k4))
        )
        return angle * factor, turning


def _determinant(jacobian: Array) -> Array:
    determinant: Array = (
        jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] * jacobian[:, 1, 0]
    )
    return determinant


def is_unfolded(jacobian: Array) -> NDArray[np.bool_]:
    """Whether distortions with these Jacobians (N, 2, 2) preserve orientation."""
    trace = jacobian[:, 0, 0] + jacobian[:, 1, 1]
    return np.asarray((_determinant(jacobian) > 0.0) & (trace > 0.0))


def _solve(jacobian: Array, error: Array) -> Array:
    determinant = _determinant(jacobian)
    return np.column_stack(
        (
            (jacobian[:, 1, 1] * error[:, 0] - jacobian[:, 0, 1] * error[:, 1]) / determinant,
            (jacobian[:, 0, 0] * error[:, 1] - jacobian[:, 1, 0] * error[:, 0]) / determinant,
        )
    )
