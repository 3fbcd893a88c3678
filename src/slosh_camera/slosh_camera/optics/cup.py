"""Projects a transparent cylinder or cone into an image, and pixels back onto its wall.

Container frame: origin in the centre of the still free surface, z up along the axis, azimuth
counted from +x towards +y. Rays to the inner wall bend where they enter and leave the transparent
wall (refraction.py): the liquid's line on the front wall is seen through the wall alone, the line
on the rear wall through the wall and the air above the liquid.

A cone is a cylinder under the map (x, y, z) -> (x, y, z) / (1 + taper z / radius): straight lines
stay straight, planes stay planes, and azimuths stay as they are. Heights on that upright wall are
called upright: a plane's line on it is a cosine, as on a cylinder.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slosh_base.types import Array, BoolArray
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Measurement
from slosh_camera.optics.camera import PinholeCamera, Pose
from slosh_camera.optics.container import SeenContainer
from slosh_camera.optics.refraction import EXACT, STEPS, GlassWall, WallTrace, find_entries
from slosh_model.containers import Container
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.round_cups import Frustum

_ARRIVED = 1e-9

_AROUND = 73
_FITTED_POINTS = 241
STEEPEST_TAPER = 0.5
"""Of the walls that are measured through; in a flatter one the rear line is hardly seen."""


class Wall(Enum):
    """Front or rear wall: the two intersections of a ray with the container.

    >>> [wall.value for wall in Wall]
    ['front', 'rear']
    """

    FRONT = "front"
    REAR = "rear"


@dataclass(frozen=True, slots=True)
class Cup(SeenContainer):
    """A cylindrical or conical container with a transparent wall.

    >>> Cup(radius=0.04, fill_height=0.06, rim_height=0.11).rim_level  # m above the still level
    0.05

    Attributes:
        radius: inner radius at the still level [m].
        fill_height: depth of the liquid at rest [m].
        wall_thickness: thickness of the wall [m].
        rim_height: inner wall's height above the floor [m]; None: unknown.
        wall_refractive_index: of the wall; acrylic glass has 1.49.
        taper: growth of the inner radius per height, dr/dz; 0: a cylinder.
    """

    radius: float
    fill_height: float
    wall_thickness: float = 0.0
    rim_height: float | None = None
    wall_refractive_index: float = 1.49
    taper: float = field(default=0.0, metadata={"is_length": False})

    def __post_init__(self) -> None:
        """Raises SloshCameraError for physically impossible dimensions."""
        SeenContainer.__post_init__(self)
        if not abs(self.taper) <= STEEPEST_TAPER:
            raise SloshCameraError(
                f"taper: {self.taper:.3g} radius per height, must be within "
                f"{STEEPEST_TAPER:g}: a flatter wall is measured from the side only (--scale)"
            )
        if not self.radius_at(np.array([-self.fill_height, self.rim_level or 0.0])).min() >= 0.0:
            raise SloshCameraError(f"taper: {self.taper:.3g}, the wall crosses its axis")

    @classmethod
    def of(
        cls, container: Container, wall_thickness: float = 0.0, wall_refractive_index: float = 1.49
    ) -> Cup:
        """Creates the container that a camera sees from a container of a model.

        Raises:
            SloshCameraError: its wall is neither a cylinder nor a cone.
        """
        if isinstance(container, Cylinder):
            taper = 0.0
        elif isinstance(container, Frustum):
            taper = (container.top_radius - container.bottom_radius) / container.height
        else:
            raise SloshCameraError(
                f"shape: a {container.shape} is not measured through its wall; possible are "
                "cylinder and frustum, and from the side all bodies of revolution (--scale)"
            )
        return cls(
            container.size, container.fill_height, wall_thickness, container.rim_height,
            wall_refractive_index, taper,
        )  # fmt: skip

    def radius_at(self, level: ArrayLike) -> Array:
        """Returns the inner radius at heights above the still level [m]."""
        return np.asarray(self.radius + self.taper * np.asarray(level, dtype=np.float64))

    def outer_radius_at(self, level: ArrayLike) -> Array:
        """Returns the outer radius at heights above the still level [m]."""
        wall = self.wall_thickness * float(np.hypot(1.0, self.taper))
        return np.asarray(self.radius_at(level) + wall)

    def outer_points(self, azimuth: ArrayLike, level: ArrayLike) -> Array:
        """Returns points (..., 3) of the outer wall [m] by azimuth [rad] and height [m]."""
        angle, height = np.broadcast_arrays(
            np.asarray(azimuth, dtype=np.float64), np.asarray(level, dtype=np.float64)
        )
        outer = self.outer_radius_at(height)
        return np.stack((outer * np.cos(angle), outer * np.sin(angle), height), axis=-1)

    def upright_points(self, points: Array) -> Array:
        """Maps points (..., 3) [m] of an inclined wall to the equivalent vertical cylinder."""
        return (
            points / (1.0 + self.taper / self.radius * points[..., 2:]) if self.taper else points
        )

    def upright(self, height: ArrayLike) -> Array:
        """Converts heights on the inclined wall to an equivalent vertical cylinder, both in m."""
        given = np.asarray(height, dtype=np.float64)
        return np.asarray(given / (1.0 + self.taper / self.radius * given))

    def leaning(self, height: ArrayLike) -> Array:
        """Converts heights on the equivalent vertical cylinder to the inclined wall, in m."""
        given = np.asarray(height, dtype=np.float64)
        return np.asarray(given / (1.0 - self.taper / self.radius * given))


@dataclass(frozen=True, slots=True, eq=False)
class CupView:
    """Projection between a cylindrical container and a camera's image.

    >>> from slosh_camera.optics.camera import look_at
    >>> camera = PinholeCamera(640, 480, fx=800.0, fy=800.0, cx=319.5, cy=239.5)
    >>> view = CupView(camera, look_at([0.0, -0.4, 0.1], [0.0, 0.0, 0.0]), Cup(0.04, 0.06))
    >>> view.project([[0.0, 0.0, 0.0]]).round(1).tolist()  # px
    [[319.5, 239.5]]

    Attributes:
        pose: transform container -> camera.
    """

    camera: PinholeCamera
    pose: Pose
    cup: Cup
    _centre: Array = field(init=False, repr=False)
    _glass: GlassWall = field(init=False, repr=False)
    _half: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Raises SloshCameraError if the container is not in front of the camera."""
        centre = self.pose.camera_centre
        object.__setattr__(self, "_centre", centre)
        cup = self.cup
        glass = GlassWall(
            cup.radius, cup.wall_thickness, cup.wall_refractive_index, cup.rim_level, cup.taper
        )
        object.__setattr__(self, "_glass", glass)
        outer = glass.outer_radius
        if not float(np.hypot(centre[0], centre[1])) > max(outer, outer + cup.taper * centre[2]):
            raise SloshCameraError(
                "pose: the camera is inside the container or straight above it, "
                "it must look at the wall from outside"
            )
        top = self.cup.rim_level if self.cup.rim_level is not None else 0.0
        axis = np.array([[0.0, 0.0, -self.cup.fill_height], [0.0, 0.0, top]])
        depth = (axis @ self.pose.rotation.T + self.pose.translation)[:, 2]
        if np.any(depth <= outer):
            raise SloshCameraError("pose: the container is not in front of the camera")
        half = grazing_half_angle(glass, centre) if cup.taper else 0.0
        if np.isnan(half):
            raise SloshCameraError(
                f"wall_thickness: {cup.wall_thickness} m, too thick to see through at the sides "
                "of an inclined wall"
            )
        object.__setattr__(self, "_half", half)

    @property
    def container(self) -> Cup:
        """The cylindrical container."""
        return self.cup

    @property
    def camera_azimuth(self) -> float:
        """Azimuth of the camera about the container's axis [rad]."""
        return float(np.arctan2(self._centre[1], self._centre[0]))

    def project(self, points: ArrayLike) -> Array:
        """Projects points in the container frame into the image, without refraction.

        Args:
            points: (N, 3) [m].

        Returns:
            (N, 2) pixels; NaN where PinholeCamera.project gives NaN.
        """
        array = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        return self.camera.project(array @ self.pose.rotation.T + self.pose.translation)

    def project_wall(
        self, azimuth: ArrayLike, height: ArrayLike, wall: Wall | None = None
    ) -> Array:
        """Projects inner wall points (azimuth, height) into the image, with refraction.

        Args:
            azimuth: (N,) or scalar [rad].
            height: (N,) or scalar, above the still level [m].
            wall: through the front wall alone, or through the front wall and the air behind it;
                None: the front where the point is on the part of it that faces the camera.

        Returns:
            (N, 2) pixels; NaN where no ray from that side reaches the point.
        """
        points = self.wall_points(azimuth, height)
        if not self._glass.bends:
            return self.project(points)
        rear = None if wall is None else np.full(len(points), wall is Wall.REAR)
        sight = sight_through if self.cup.taper else GlassWall.sight
        return self.project(self._centre + sight(self._glass, self._centre, points, rear))

    def wall_points(self, azimuth: ArrayLike, height: ArrayLike) -> Array:
        """Returns points (N, 3) of the inner wall [m] at given azimuths and heights."""
        angle, level = np.broadcast_arrays(
            np.atleast_1d(np.asarray(azimuth, dtype=np.float64)),
            np.atleast_1d(np.asarray(height, dtype=np.float64)),
        )
        radius = self.cup.radius_at(level)
        return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), level))

    def rays(self, pixels: ArrayLike) -> tuple[Array, Array]:
        """Returns origins and directions of pixels' rays in the container frame.

        Args:
            pixels: (N, 2).

        Returns:
            The common origin (3,) [m] and the directions (N, 3), of unit depth in the camera.
        """
        return self._centre, self.camera.rays(pixels) @ self.pose.rotation

    def trace(self, pixels: ArrayLike) -> WallTrace:
        """Intersects the rays of pixels (N, 2) with the inner wall, in the container frame [m]."""
        origin, direction = self.rays(pixels)
        return self._glass.trace(origin, direction)

    def on_wall(self, pixels: ArrayLike, wall: Wall) -> tuple[Array, Array]:
        """Projects pixels back onto the inner front or rear wall.

        Args:
            pixels: (N, 2).
            wall: the near or the far intersection.

        Returns:
            Azimuth (N,) [rad] in (-pi, pi] and height above the still level (N,) [m]; NaN where
            the ray misses the wall.
        """
        trace = self.trace(pixels)
        points = trace.front if wall is Wall.FRONT else trace.rear
        return np.arctan2(points[:, 1], points[:, 0]), points[:, 2]

    def tangent_azimuths(self) -> tuple[float, float]:
        """Returns the azimuths that limit the visible front wall at the liquid's level.

        Returns:
            Azimuths [rad] in (-pi, pi] of the inner wall's left and right edge in the image.
        """
        half = self._half or self._visible_half_angle()
        ends = self.camera_azimuth + np.array([-half, half])
        u = self.project(self.wall_points(ends, 0.0))[:, 0]
        if u[0] > u[1]:
            ends = ends[::-1]
        wrapped = np.arctan2(np.sin(ends), np.cos(ends))
        return float(wrapped[0]), float(wrapped[1])

    def _visible_half_angle(self) -> float:
        """Returns half the visible arc of a cylinder's front wall [rad]."""
        distance = float(np.hypot(self._centre[0], self._centre[1]))
        outer = self._glass.outer_radius
        to_edge = float(np.sqrt(distance**2 - outer**2))
        elevation = float(np.arctan2(-self._centre[2], to_edge))
        return self._glass.visible_half_angle(distance, elevation)

    @property
    def side_half_angle(self) -> float:
        """Angle about the axis from the camera to the outer wall's silhouette [rad]."""
        return silhouette_half_angle(self._glass, self._centre)

    def levels(self) -> tuple[float, float]:
        """Heights of the container's floor and rim above the liquid's level at rest [m].

        Of an unknown rim a height stands in that leaves room for most waves.
        """
        return -self.cup.fill_height, self.cup.rim_level or self.cup.radius

    def outline(self) -> Array:
        """Image points (N, 2) of floor and rim [px]; NaN if the camera cannot see them."""
        around = np.linspace(-np.pi, np.pi, _AROUND)
        return np.vstack([self.project_wall(around, level) for level in self.levels()])

    def scale_places(self, heights: Array) -> Array:
        """Returns the image points (N, 2) at heights (N,) [m] on the right outer edge."""
        return self.project(self.cup.outer_points(self.tangent_azimuths()[1], heights))

    def fitted_line(self, measurement: Measurement) -> Array:
        """Returns image points (N, 2) of the fitted first mode on the wall; empty without a fit.

        On the upright wall every mode of one azimuthal wave is a cosine.
        """
        height, azimuth = measurement.fitted_msh, measurement.fitted_azimuth
        if not (np.isfinite(height) and np.isfinite(azimuth)):
            return np.empty((0, 2))
        around = self.camera_azimuth + np.linspace(-np.pi, np.pi, _FITTED_POINTS)
        line = self.cup.upright(height) * np.cos(around - azimuth)
        return self.project_wall(around, self.cup.leaning(line))

    def on_front(self, azimuth: Array) -> NDArray[np.bool_]:
        """Returns which wall azimuths (N,) [rad] face the camera."""
        half = abs(_wrapped(np.asarray(self.tangent_azimuths()[0]) - self.camera_azimuth))
        found: NDArray[np.bool_] = np.abs(_wrapped(azimuth - self.camera_azimuth)) <= half + 1e-9
        return found

    def height_per_pixel(self, pixel: ArrayLike, wall: Wall) -> float:
        """Returns the height of one pixel row on the wall [m/px], NaN if the ray misses it."""
        u, v = np.asarray(pixel, dtype=np.float64)
        _, height = self.on_wall([[u, v - 0.5], [u, v + 0.5]], wall)
        return float(abs(height[1] - height[0]))


def _wrapped(angle: Array) -> Array:
    """Returns the equivalent angle in (-π, π] [rad]."""
    return np.asarray(np.arctan2(np.sin(angle), np.cos(angle)), dtype=np.float64)


# Computes the directions in which the camera sees inner points of a transparent cone.
#
# A cone has no plan view as a cylinder has: where the ray meets the outside is found by Newton's
# method, on which its way on depends smoothly up to the silhouette.


def sight_through(
    wall: GlassWall, origin: Array, points: Array, rear: BoolArray | None = None
) -> Array:
    """Returns the directions of rays from outside that reach inner points of a cone.

    Args:
        origin: (3,) camera's centre [m].
        points: (N, 3) on the inner wall [m].
        rear: (N,) whether a point is seen through the front wall and the air behind it; None:
            where it is not on the part of the front wall that the camera sees.

    Returns:
        (N, 3) directions with a horizontal part of length 1; NaN where no ray arrives.
    """
    straight = points - origin
    over, _ = wall.over_the_rim(np.broadcast_to(origin, points.shape), straight)
    directions = np.full(points.shape, np.nan)
    directions[over] = straight[over]
    near = ~over if rear is None else ~over & ~rear
    directions[near] = _solved(wall, origin, points[near], far=False)
    unseen = np.isnan(directions[:, 0])
    beyond = ~over & (unseen if rear is None else rear)
    directions[beyond] = _solved(wall, origin, points[beyond], far=True)
    flat: Array = directions / np.hypot(directions[:, 0], directions[:, 1])[:, np.newaxis]
    return flat


def grazing_half_angle(wall: GlassWall, origin: Array) -> float:
    """Returns half the visible arc of the front wall at z = 0 [rad]; NaN if the wall is too thick.

    The ray that touches the outside has its azimuth there; the level where it arrives is found
    by steps.
    """
    distance = float(np.hypot(origin[0], origin[1]))
    if not wall.bends:
        return float(np.arccos((wall.radius + wall.taper * origin[2]) / distance))
    azimuth = np.array([silhouette_half_angle(wall, origin)])
    viewer, level = np.array([distance, 0.0, origin[2]]), np.zeros(1)
    for _ in range(STEPS):
        place = _outside(wall, azimuth, level)
        arrives = wall.from_outside(place, _unit(place - viewer)).front
        level = level - arrives[:, 2]
        if not abs(arrives[0, 2]) > EXACT:
            break
    return float(np.arctan2(arrives[0, 1], arrives[0, 0]))


def silhouette_half_angle(wall: GlassWall, origin: Array) -> float:
    """Returns the angle about the axis from the camera to the outer wall's silhouette [rad].

    A plane through the camera touches a cone along a line of one azimuth, as it does a cylinder:
    that of a cylinder as wide as the cone at the camera's height. NaN: the camera sees none.
    """
    cosine = (wall.outer_radius + wall.taper * origin[2]) / np.hypot(origin[0], origin[1])
    return float(np.arccos(cosine)) if abs(cosine) < 1.0 else float("nan")


def _solved(wall: GlassWall, origin: Array, points: Array, *, far: bool) -> Array:
    """Returns ray directions (N, 3) to points of the front wall only or of the rear wall only."""
    outside = GlassWall(wall.outer_radius, taper=wall.taper)
    start = outside.trace(origin, points - origin).front
    unknown = np.column_stack((np.arctan2(start[:, 1], start[:, 0]), start[:, 2]))
    error = np.empty_like(unknown)
    find_entries(
        np.ascontiguousarray(origin, dtype=np.float64), np.ascontiguousarray(points), wall.radius,
        wall.outer_radius, wall.taper, wall.index if wall.bends else 1.0, far, unknown, error,
    )  # fmt: skip
    entry = _outside(wall, unknown[:, 0], unknown[:, 1])
    directions = entry - origin
    arrived = np.all(np.abs(error) < _ARRIVED, axis=1)
    arrived &= np.sum(directions * wall.outward(entry), axis=1) <= 1e-12
    directions[~arrived] = np.nan
    return directions


def _outside(wall: GlassWall, azimuth: Array, level: Array) -> Array:
    radius = wall.outer_radius + wall.taper * level
    return np.column_stack((radius * np.cos(azimuth), radius * np.sin(azimuth), level))


def _unit(rays: Array) -> Array:
    unit: Array = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return unit
