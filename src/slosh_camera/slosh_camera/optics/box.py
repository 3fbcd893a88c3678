"""Projects a rectangular container into a side view, and pixels back onto its front face.

Container frame: origin in the centre of the still free surface, x along the width, y away from
the camera, z up. The liquid's line is seen on the inner side of the face towards the camera.
Between the camera and that line a ray crosses one flat wall, which displaces it in parallel
(Snell's law, exactly); the liquid's own refraction does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slosh_base.types import Array
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Measurement
from slosh_camera.optics.camera import PinholeCamera, Pose
from slosh_camera.optics.container import SeenContainer

# Newton's method on a concave increasing function converges from below in a handful of steps.
_NEWTON_STEPS = 20
_TOLERANCE = 1e-14
_FITTED_POINTS = 80


@dataclass(frozen=True, slots=True)
class Box(SeenContainer):
    """A rectangular container with a transparent wall.

    Attributes:
        width: inner width, along x [m].
        fill_height: depth of the liquid at rest [m].
        depth: inner depth, along y [m]; None: the frame's origin lies on the inner side of the
            face towards the camera, in the middle of the still line.
        wall_thickness: thickness of the face towards the camera [m].
        wall_refractive_index: of that face; acrylic glass has 1.49.
        rim_height: inner wall's height above the floor [m]; None: unknown.
    """

    width: float
    fill_height: float
    depth: float | None = None
    wall_thickness: float = 0.0
    wall_refractive_index: float = 1.49
    rim_height: float | None = None

    @property
    def face(self) -> float:
        """The y coordinate of the inner side of the front wall [m]."""
        return 0.0 if self.depth is None else -0.5 * self.depth


@dataclass(frozen=True, slots=True, eq=False)
class BoxView:
    """Projection between a rectangular container and its side view.

    Attributes:
        pose: transform container -> camera.
    """

    camera: PinholeCamera
    pose: Pose
    box: Box
    _centre: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Raises SloshCameraError if the camera does not see the face from outside."""
        box, centre = self.box, self.pose.camera_centre
        object.__setattr__(self, "_centre", centre)
        if centre[1] >= box.face - box.wall_thickness:
            raise SloshCameraError(
                "pose: the camera is inside the container or behind it, it must look at the face "
                "from outside, with the container's y pointing away from it"
            )
        top = 0.0 if box.rim_level is None else box.rim_level
        half = 0.5 * box.width
        corners = [(x, box.face, z) for x in (-half, half) for z in (-box.fill_height, top)]
        depth = (np.array(corners) @ self.pose.rotation.T + self.pose.translation)[:, 2]
        if np.any(depth <= 0.0):
            raise SloshCameraError("pose: the container is not in front of the camera")
        up = self.pose.rotation[:, 2]
        if -up[1] <= abs(up[0]):
            raise SloshCameraError(
                "pose: the container is rolled by more than 45 degrees in the image, its z must "
                "point up"
            )

    @property
    def container(self) -> Box:
        """The rectangular container."""
        return self.box

    def project_face(self, x: ArrayLike, z: ArrayLike) -> Array:
        """Projects points of the inner front face into the image.

        The direction of a ray leaves it where, with q the tangent of its angle in air,
        a q + t q / sqrt(n^2 + (n^2 - 1) q^2) = r: a the camera's distance from the face's outer
        side, t the wall's thickness, n its index and r the lateral way (Snell's law).

        Args:
            x: (N,) or scalar [m].
            z: (N,) or scalar, above the still level [m].

        Returns:
            (N, 2) pixels; NaN where PinholeCamera.project gives NaN.
        """
        across, level = np.broadcast_arrays(
            np.atleast_1d(np.asarray(x, dtype=np.float64)),
            np.atleast_1d(np.asarray(z, dtype=np.float64)),
        )
        lateral = np.column_stack((across - self._centre[0], level - self._centre[2]))
        radius = np.hypot(lateral[:, 0], lateral[:, 1])
        air = self._air
        scale = np.divide(
            air * self._tangent(radius), radius, out=np.zeros_like(radius), where=radius > 0.0
        )
        # Where the ray meets the outer side, seen from the camera.
        outer = np.column_stack(
            (lateral[:, 0] * scale, np.full(radius.size, air), lateral[:, 1] * scale)
        )
        return self.camera.project(outer @ self.pose.rotation.T)

    def on_face(self, pixels: ArrayLike) -> tuple[Array, Array]:
        """Projects pixels (N, 2) back onto the inner front face, as x and height z [m].

        Args:
            pixels: (N, 2).

        Returns:
            x (N,) and height above the still level z (N,) [m]; NaN where the ray misses the
            face's plane.
        """
        slope_x, slope_z = self._slopes(pixels)
        index = self.box.wall_refractive_index
        inside = np.sqrt(index**2 + (index**2 - 1.0) * (slope_x**2 + slope_z**2))
        way = self._air + self.box.wall_thickness / inside
        return self._centre[0] + slope_x * way, self._centre[2] + slope_z * way

    def on_rear(self, pixels: ArrayLike) -> tuple[Array, Array]:
        """Projects pixels back onto the inner rear wall, through air above the liquid.

        Args:
            pixels: (N, 2).

        Returns:
            x (N,) and height above the still level z (N,) [m]; NaN where the box's depth is
            unknown or the ray misses.
        """
        depth = np.nan if self.box.depth is None else self.box.depth
        x, z = self.on_face(pixels)
        slope_x, slope_z = self._slopes(pixels)
        return x + slope_x * depth, z + slope_z * depth

    def levels(self) -> tuple[float, float]:
        """Heights of the container's floor and rim above the liquid's level at rest [m].

        Of an unknown rim a height stands in that leaves room for most waves.
        """
        return -self.box.fill_height, self.box.rim_level or 0.5 * self.box.width

    def outline(self) -> Array:
        """Image points (N, 2) of floor and rim on the front face [px]."""
        half = 0.5 * self.box.width
        return np.vstack([self.project_face([-half, half], level) for level in self.levels()])

    def scale_places(self, heights: Array) -> Array:
        """Returns the image points (N, 2) at heights (N,) [m] on the front face's right edge."""
        return self.project_face(0.5 * self.box.width, heights)

    def fitted_line(self, measurement: Measurement) -> Array:
        """Returns image points (N, 2) of the fitted straight line; empty without a fit."""
        slope, half = np.tan(measurement.slope_angle), 0.5 * self.box.width
        rest = measurement.profile_height - slope * measurement.profile_x
        if not np.any(np.isfinite(rest)):
            return np.empty((0, 2))
        x = np.linspace(-half, half, _FITTED_POINTS)
        return self.project_face(x, np.nanmean(rest) + slope * x)

    def on_front(self, azimuth: Array) -> NDArray[np.bool_]:
        """Returns True for each azimuth, since a side view shows only the front face."""
        return np.ones(len(azimuth), dtype=np.bool_)

    def height_per_pixel(self, pixel: ArrayLike) -> float:
        """Returns the height of one pixel row on the face [m/px]; NaN off the face."""
        u, v = np.asarray(pixel, dtype=np.float64)
        _, height = self.on_face([[u, v - 0.5], [u, v + 0.5]])
        return float(abs(height[1] - height[0]))

    def _slopes(self, pixels: ArrayLike) -> tuple[Array, Array]:
        """Returns the slopes dx/dy and dz/dy of pixels' rays in air; NaN if pointing away."""
        direction = self.camera.rays(pixels) @ self.pose.rotation
        ahead = np.where(direction[:, 1] > 0.0, direction[:, 1], np.nan)
        return direction[:, 0] / ahead, direction[:, 2] / ahead

    @property
    def _air(self) -> float:
        """Distance of the camera from the outer side of the front face [m]."""
        return float(self.box.face - self.box.wall_thickness - self._centre[1])

    def _tangent(self, radius: Array) -> Array:
        """Returns the tangents of the ray angles in air that reach lateral distances [m]."""
        air, thickness = self._air, self.box.wall_thickness
        index2 = self.box.wall_refractive_index**2
        tangent = radius / (air + thickness / self.box.wall_refractive_index)
        for _ in range(_NEWTON_STEPS):
            inside = index2 + (index2 - 1.0) * tangent**2
            error = air * tangent + thickness * tangent / np.sqrt(inside) - radius
            step = error / (air + thickness * index2 / inside**1.5)
            tangent = tangent - step
            if np.all(np.abs(step) <= _TOLERANCE * (1.0 + tangent)):
                break
        return tangent
