"""Computes the shape of the free surface over the cross-section.

Heights are above the still level. `wall_heights` has one row per mode: its height on the wall at
the container's +x and +y side [m], the mode's displacement times its gain (DL22, Tables 1, 2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from slosh_base.types import Array
from slosh_model.bessel import radial_shape
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.response import Response


def plane_surface(
    wall_heights: ArrayLike, relative_radius: ArrayLike, azimuth: ArrayLike
) -> Array:
    """Returns the height [m] of the linear model's plane surface (DL22, eq. (18)).

    Args:
        wall_heights: (modes, 2) [m].
        relative_radius: r/R, in [0, 1]; any shape that broadcasts with azimuth.
        azimuth: θ from the container's +x [rad].

    Returns:
        η [m], in the broadcast shape.
    """
    height_x, height_y = _rows(wall_heights).sum(axis=0)
    profile = wall_profile(height_x, height_y, azimuth)
    surface: Array = np.asarray(relative_radius, dtype=np.float64) * profile
    return surface


def bessel_surface(
    wall_heights: ArrayLike,
    relative_radius: ArrayLike,
    azimuth: ArrayLike,
    numbers: Sequence[int] | None = None,
) -> Array:
    """Returns the height [m] of the nonlinear model's curved surface (DL22, eq. (19)).

    Args:
        wall_heights: (modes, 2) [m].
        relative_radius: r/R, in [0, 1]; any shape that broadcasts with azimuth.
        azimuth: θ from the container's +x [rad].
        numbers: n of each row; None: 1, 2 and so on.

    Returns:
        η [m], in the broadcast shape.
    """
    heights = _rows(wall_heights)
    if numbers is None:
        numbers = range(1, len(heights) + 1)
    total = np.zeros(np.broadcast_shapes(np.shape(relative_radius), np.shape(azimuth)))
    for n, (height_x, height_y) in zip(numbers, heights, strict=True):
        total = total + radial_shape(n, relative_radius) * wall_profile(
            height_x, height_y, azimuth
        )
    return total


def surface_height(
    model: Model, modal: ArrayLike, relative_radius: ArrayLike, azimuth: ArrayLike
) -> Array:
    """Returns the height [m] of a model's surface at one time: plane if linear, else Bessel.

    Args:
        model: the model.
        modal: (modes, 4) x, y, vx, vy [m, m/s], as `simulate` gives them.
        relative_radius: r/R, in [0, 1]; any shape that broadcasts with azimuth.
        azimuth: θ in the axes of modal [rad].

    Returns:
        η [m], in the broadcast shape.
    """
    _refuse_computed(model)
    gains = np.array(model.height_gains())
    heights = gains[:, np.newaxis] * np.asarray(modal, dtype=np.float64)[:, :2]
    if not model.has(model.container.nonlinear_effect):
        return plane_surface(heights, relative_radius, azimuth)
    numbers = [mode.number for mode in model.mode_constants()]
    return bessel_surface(heights, relative_radius, azimuth, numbers)


def _refuse_computed(model: Model) -> None:
    """Raises SloshModelError if the container's modes have no closed form."""
    if model.container.digest:
        raise SloshModelError(
            f"no closed form of the surface of a {model.container.shape}: "
            "`Container.surface_shape` has that of each mode"
        )


def rectangle_surface(model: Model, modal: ArrayLike, x: ArrayLike, y: ArrayLike = 0.0) -> Array:
    """Returns the height [m] of the surface in a rectangular container.

    With one mode a plane (TM20, section 2.2), with several their standing waves along either axis.

    Args:
        model: a model of a rectangle.
        modal: (…, modes, 4) x, y, vx, vy [m, m/s], as `simulate` gives them.
        x, y: places from the container's axis [m]; shapes that broadcast to S.

    Returns:
        η [m], shape (…) + S.

    Raises:
        SloshModelError: the container is another one.
    """
    _refuse_computed(model)
    if not model.container.cornered:
        raise SloshModelError(f"the surface of a rectangle, of a {model.container.shape}'s model")
    states, modes = np.asarray(modal, dtype=np.float64), model.mode_constants()
    places = np.broadcast_arrays(x, y)
    total = np.zeros((*states.shape[:-2], *places[0].shape))
    for axis, place in enumerate(places):
        for n, gain in enumerate(model.height_gains(modes, axis)):
            relative = place / modes[n].along(axis).reach
            xi = modes[n].xi
            shape = relative if len(modes) == 1 else np.sin(xi * relative) / math.sin(xi)
            total += np.multiply.outer(gain * states[..., n, axis], shape)
    return total


def wall_profile(sh_x: ArrayLike, sh_y: ArrayLike, azimuth: ArrayLike) -> Array:
    """Returns the height on the wall by azimuth, sh_x cos φ + sh_y sin φ [m].

    Args:
        sh_x, sh_y: height at +x and +y [m]; any shape S.
        azimuth: φ from +x [rad]; any shape A.

    Returns:
        height [m], shape S + A.
    """
    angle = np.asarray(azimuth, dtype=np.float64)
    profile: Array = np.multiply.outer(sh_x, np.cos(angle)) + np.multiply.outer(
        sh_y, np.sin(angle)
    )
    return profile


def motion_axis(acceleration: ArrayLike, tolerance: float = 1e-6) -> float | None:
    """Returns the direction of a straight-line motion [rad]; None if not straight (DL22, Fig. 3).

    Along one line the signed height on one side (SH, Table 1) says more than the maximum over the
    wall (MSH, Table 2).

    Args:
        acceleration: (N, 3) [m/s²]; the vertical part may be anything.
        tolerance: how large the part across the line may be, relative to that along it.

    Returns:
        the line's azimuth in (-π/2, π/2] [rad]; π/2 without any horizontal acceleration, as in
        the figure; None where there is no such line: the motion asks for the MSH.
    """
    horizontal = np.asarray(acceleration, dtype=np.float64)[:, :2]
    _, sizes, directions = np.linalg.svd(horizontal, full_matrices=False)
    along = float(sizes[0]) if len(sizes) else 0.0
    across = float(sizes[1]) if len(sizes) > 1 else 0.0
    if along == 0.0:
        return math.pi / 2.0
    if across > tolerance * along:
        return None
    cosine, sine = directions[0]
    # The line's direction to the +x side; along the y axis to +y.
    if cosine < 0.0:
        cosine, sine = -cosine, -sine
    angle = math.atan2(sine, cosine)
    return math.pi / 2.0 if angle <= -math.pi / 2.0 + tolerance else angle


def sloshing_height(response: Response, acceleration: ArrayLike) -> tuple[str, Array]:
    """Returns the height [m] that characterises a motion from rest, SH or MSH (DL22, Fig. 3).

    Args:
        response: the liquid's answer to it.
        acceleration: (N, 3) in the response's axes [m/s²].

    Returns:
        'SH' with the signed height (N,) on the side to which `motion_axis` points, in a rectangle
        along its axes only, or 'MSH' with the maximum over the wall (N,) [m].
    """
    axis = motion_axis(acceleration)
    cornered = response.container is not None and response.container.cornered
    if axis is None or (cornered and axis not in (0.0, math.pi / 2.0)):
        return "MSH", response.msh
    return "SH", math.cos(axis) * response.sh_x + math.sin(axis) * response.sh_y


def _rows(wall_heights: ArrayLike) -> Array:
    heights = np.asarray(wall_heights, dtype=np.float64)
    if heights.ndim != 2 or heights.shape[1] != 2:
        raise SloshModelError(f"wall_heights has the shape {heights.shape}, expected (modes, 2)")
    return heights
