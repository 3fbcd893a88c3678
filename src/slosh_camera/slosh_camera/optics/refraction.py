"""Refraction by the wall of a transparent cylinder or cone, by Snell's law in 3D.

The wall is a tube between two coaxial cylinders, or cones of the same slope. A ray from the camera
meets the outer one, crosses the wall, leaves it at the inner one (the front wall, where the
liquid's line is seen) and, above the liquid, crosses the air in the container to the inner one's
far side (the rear wall). A wall of no thickness or of index 1 leaves the ray straight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba.types import boolean, float64, void

from slosh_base.compiled.compilation import CHANGED_2, GIVEN_1, GIVEN_2, compiled, entry_point
from slosh_base.types import Array, BoolArray

_NEWTON_STEPS = 40
_DIFFERENCE = 1e-7
_CONVERGED = 1e-12
_ARRIVED = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class WallTrace:
    """Points where rays meet the inner wall; NaN where they miss it.

    Attributes:
        front: (N, 3) points on the near side [m].
        rear: (N, 3) points on the far side, seen through the front wall and air [m]; NaN also
            where the front wall reflects all light back.
    """

    front: Array
    rear: Array


@dataclass(frozen=True, slots=True)
class GlassWall:
    """A transparent tube about the z axis, which refracts light.

    >>> wall = GlassWall(radius=0.04, thickness=0.003, index=1.49)
    >>> round(wall.outer_radius, 3), wall.bends
    (0.043, True)

    Attributes:
        radius: inner radius [m].
        thickness: [m].
        index: refractive index of the wall against the air on both sides.
        rim: height of its upper end [m]; rays above it go straight. None: it has none.
        taper: growth of the radius per height, dr/dz; 0: a cylinder. The radii of a cone are
            those at z = 0.
    """

    radius: float
    thickness: float = 0.0
    index: float = 1.0
    rim: float | None = None
    taper: float = 0.0

    @property
    def outer_radius(self) -> float:
        """Outer radius of the tube [m]."""
        return self.radius + self.thickness * float(np.hypot(1.0, self.taper))

    @property
    def bends(self) -> bool:
        """Whether the wall refracts light: thickness above 0 and refractive index other than 1."""
        return self.thickness > 0.0 and self.index != 1.0

    def trace(self, origin: Array, directions: Array) -> WallTrace:
        """Traces rays from outside to the inner wall, with refraction.

        Args:
            origin: (3,) or (N, 3) start outside the container [m].
            directions: (N, 3), of any length.

        Returns:
            The points (N, 3).
        """
        direction = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        start = np.broadcast_to(origin, direction.shape)
        over, straight = self.over_the_rim(start, direction)
        if self.bends:
            start = self._hit(start, direction, self.outer_radius, far=False)
        bent = self.from_outside(start, direction)
        bent.front[over], bent.rear[over] = straight.front[over], straight.rear[over]
        return bent

    def from_outside(self, start: Array, direction: Array) -> WallTrace:
        """Traces rays of unit direction (N, 3) from where they meet the outer face, (N, 3) [m]."""
        if self.bends:
            direction = _refracted(direction, self.outward(start), 1.0 / self.index)
        front = self._hit(start, direction, self.radius, far=False)
        if self.bends:
            direction = _refracted(direction, self.outward(front), self.index)
        return WallTrace(front, self._hit(front, direction, self.radius, far=True))

    def outward(self, points: Array) -> Array:
        """Returns the wall's unit normals (N, 3) at points (N, 3) of its inner or outer face."""
        across = np.hypot(points[:, 0], points[:, 1])
        normal = np.column_stack((points[:, 0], points[:, 1], -self.taper * across))
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        return normal

    def sight(self, origin: Array, points: Array, rear: BoolArray | None = None) -> Array:
        """Returns the directions of rays from outside that reach points of the inner wall.

        For a cylinder; `sight_through` of cone.py serves a cone.

        A vertical wall leaves a ray's vertical component alone, so the path in plan view is that
        of a flat problem with the index of `_plan_index` (Bravais), and its impact parameter b
        about the axis is b/index in the wall. Newton's method on asin(b), in which the azimuth is
        smooth up to the silhouette, while the elevation follows from the path's length.

        Args:
            origin: (3,) camera's centre [m].
            points: (N, 3) on the inner wall [m].
            rear: (N,) whether a point is seen through the front wall and the air behind it;
                None: where it is not on the part of the front wall that the camera sees.

        Returns:
            (N, 3) directions with a horizontal part of length 1; NaN where no ray arrives.
        """
        distance = float(np.hypot(origin[0], origin[1]))
        camera_azimuth = float(np.arctan2(origin[1], origin[0]))
        angle = np.arctan2(points[:, 1], points[:, 0]) - camera_azimuth
        angle = np.arctan2(np.sin(angle), np.cos(angle))
        target, rise = np.abs(angle), points[:, 2] - origin[2]
        slope = rise / np.hypot(points[:, 0] - origin[0], points[:, 1] - origin[1])
        if rear is None:
            rear = target > self._turn(self._widest(slope), slope, distance, None)
        widest = np.where(rear, self.radius, self._widest(slope))
        phase = np.where(rear, 0.25 * np.pi, np.minimum(target, 1.2))
        for _ in range(_NEWTON_STEPS):
            impact = widest * np.sin(phase)
            slope = rise / self._flat_length(impact, slope, distance, rear)
            error = self._turn(impact, slope, distance, rear) - target
            ahead = phase - _DIFFERENCE
            change = self._turn(widest * np.sin(ahead), slope, distance, rear) - target - error
            # Where the turn does not change the step is clipped; what never arrives is NaN below.
            with np.errstate(divide="ignore", invalid="ignore"):
                step = np.clip(error * _DIFFERENCE / change, -0.3, 0.3)
            phase = np.clip(phase + step, 0.0, 0.5 * np.pi)
            if np.nanmax(np.abs(step), initial=0.0) < _CONVERGED:
                break
        impact = widest * np.sin(phase)
        missed = np.abs(self._turn(impact, slope, distance, rear) - target) > _ARRIVED
        heading = camera_azimuth + np.pi - np.sign(angle) * np.arcsin(impact / distance)
        directions = np.column_stack((np.cos(heading), np.sin(heading), slope))
        directions[missed] = np.nan
        straight = points - origin
        over, _ = self.over_the_rim(np.broadcast_to(origin, points.shape), straight)
        flat = np.hypot(straight[over, 0], straight[over, 1])
        directions[over] = straight[over] / flat[:, np.newaxis]
        return directions

    def over_the_rim(self, start: Array, direction: Array) -> tuple[BoolArray, WallTrace]:
        """Returns which unrefracted rays enter over the rim, and where they meet the wall."""
        front = self._hit(start, direction, self.radius, far=False)
        rear = self._hit(start, direction, self.radius, far=True)
        if self.rim is None or not self.bends:
            return np.zeros(len(direction), dtype=np.bool_), WallTrace(front, rear)
        return np.asarray(front[:, 2] > self.rim), WallTrace(front, rear)

    def visible_half_angle(self, distance: float, elevation: float = 0.0) -> float:
        """Returns half the visible arc of the front wall [rad].

        A ray that grazes the outer cylinder enters the wall at the critical angle and reaches the
        inner wall further round than a straight tangent would.

        Args:
            distance: of the camera from the axis [m], larger than the outer radius.
            elevation: of the grazing ray above the horizontal [rad].

        Returns:
            Angle about the axis [rad].
        """
        slope = np.array([np.tan(elevation)])
        return float(self._turn(self._widest(slope), slope, distance, None)[0])

    def _hit(self, start: Array, direction: Array, radius: float, far: bool) -> Array:
        """Returns the first intersections (N, 3) of rays with a wall face; NaN if they miss it.

        A ray steeper than the wall has none.
        """
        here, rise = radius + self.taper * start[:, 2], self.taper * direction[:, 2]
        a = direction[:, 0] ** 2 + direction[:, 1] ** 2 - rise**2
        half_b = direction[:, 0] * start[:, 0] + direction[:, 1] * start[:, 1] - here * rise
        c = start[:, 0] ** 2 + start[:, 1] ** 2 - here**2
        discriminant = half_b**2 - a * c
        with np.errstate(invalid="ignore", divide="ignore"):
            root = np.sqrt(np.where((discriminant >= 0.0) & (a > 0.0), discriminant, np.nan))
            # The stable form of the near root; half_b is negative towards the axis.
            ahead = (-half_b + root) / a
            scale = ahead if far else c / (a * ahead)
            # Beyond the cone's tip is its mirror image.
            scale = np.where((scale >= 0.0) & (here + scale * rise >= 0.0), scale, np.nan)
        return start + scale[:, np.newaxis] * direction

    def _plan_index(self, slope: Array) -> Array:
        """Returns the effective refractive index in plan view for rays of a given slope."""
        if not self.bends:
            return np.ones_like(slope)
        # sin²/cos² of the elevation are slope²/(1 + slope²) and 1/(1 + slope²).
        index: Array = np.sqrt(self.index**2 * (1.0 + slope**2) - slope**2)
        return index

    def _widest(self, slope: Array) -> Array:
        """Returns the largest impact parameter of rays that reach the inner wall [m]."""
        return np.minimum(self.outer_radius, self._plan_index(slope) * self.radius)

    def _turn(self, impact: Array, slope: Array, distance: float, rear: BoolArray | None) -> Array:
        """Returns the angle from the camera to where rays meet front or rear wall [rad]."""
        in_wall = impact / self._plan_index(slope)
        angle: Array = (
            _arcsin(impact / self.outer_radius)
            - _arcsin(impact / distance)
            + _arcsin(in_wall / self.radius)
            - _arcsin(in_wall / self.outer_radius)
        )
        if rear is None:
            return angle
        return np.where(rear, angle + np.pi - 2.0 * _arcsin(impact / self.radius), angle)

    def _flat_length(self, impact: Array, slope: Array, distance: float, rear: BoolArray) -> Array:
        """Returns the plan-view length of a straight ray that rises as much as a refracted ray."""
        index = self._plan_index(slope)
        in_wall = impact / index
        outside = _leg(distance, impact) - _leg(self.outer_radius, impact)
        # In the wall the ray rises more slowly: its slope is that outside over the plan index.
        wall = (_leg(self.outer_radius, in_wall) - _leg(self.radius, in_wall)) / index
        return outside + wall + np.where(rear, 2.0 * _leg(self.radius, impact), 0.0)


def _refracted(direction: Array, normal: Array, ratio: float) -> Array:
    """Returns unit directions (N, 3) after refraction; NaN for total reflection."""
    cosine = -np.sum(direction * normal, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        square = 1.0 - ratio**2 * (1.0 - cosine**2)
        transmitted = np.sqrt(np.where(square >= 0.0, square, np.nan))
    bent: Array = ratio * direction + (ratio * cosine - transmitted) * normal
    return bent


def _arcsin(sine: Array) -> Array:
    angle: Array = np.arcsin(np.clip(sine, -1.0, 1.0))
    return angle


def _leg(hypotenuse: float, leg: Array) -> Array:
    other: Array = np.sqrt(np.maximum(hypotenuse**2 - leg**2, 0.0))
    return other


STEPS, HALVINGS = 30, 6
DIFFERENCE = 1e-7
EXACT = 1e-12  # m, of a ray's place


@compiled
def _hit(x, y, z, dx, dy, dz, radius, taper, far):  # type: ignore[no-untyped-def]
    """Returns the distance along a ray to a wall face; see `GlassWall._hit`."""
    here, rise = radius + taper * z, taper * dz
    a = dx * dx + dy * dy - rise * rise
    half_b = dx * x + dy * y - here * rise
    c = x * x + y * y - here * here
    discriminant = half_b * half_b - a * c
    if not (discriminant >= 0.0 and a > 0.0):
        return math.nan
    ahead = (-half_b + math.sqrt(discriminant)) / a
    scale = ahead if far else c / (a * ahead)
    # Beyond the cone's tip is its mirror image.
    return scale if scale >= 0.0 and here + scale * rise >= 0.0 else math.nan


@compiled
def _bent(x, y, dx, dy, dz, taper, ratio):  # type: ignore[no-untyped-def]
    """Returns a unit direction after refraction at a face; NaN for total reflection."""
    across = math.sqrt(x * x + y * y)
    size = across * math.sqrt(1.0 + taper * taper)
    nx, ny, nz = x / size, y / size, -taper * across / size
    cosine = -(dx * nx + dy * ny + dz * nz)
    square = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
    bend = ratio * cosine - (math.sqrt(square) if square >= 0.0 else math.nan)
    return ratio * dx + bend * nx, ratio * dy + bend * ny, ratio * dz + bend * nz


@compiled
def _error(azimuth, level, origin, point, wall, far):  # type: ignore[no-untyped-def]
    """Returns by how much a ray misses its point, along the circumference and upwards [m].

    Args:
        azimuth, level: where it enters the wall [rad, m].
        origin, point: where it comes from and should arrive, x, y, z [m].
        wall: inner and outer radius [m], taper, refractive index.
        far: whether it should arrive on the rear wall.
    """
    radius, outer, taper, index = wall
    reach = outer + taper * level
    x, y, z = reach * math.cos(azimuth), reach * math.sin(azimuth), level
    dx, dy, dz = x - origin[0], y - origin[1], z - origin[2]
    size = math.sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx / size, dy / size, dz / size
    dx, dy, dz = _bent(x, y, dx, dy, dz, taper, 1.0 / index)
    along = _hit(x, y, z, dx, dy, dz, radius, taper, False)
    x, y, z = x + along * dx, y + along * dy, z + along * dz
    if far:
        dx, dy, dz = _bent(x, y, dx, dy, dz, taper, index)
        along = _hit(x, y, z, dx, dy, dz, radius, taper, True)
        x, y, z = x + along * dx, y + along * dy, z + along * dz
    around = math.atan2(y, x) - math.atan2(point[1], point[0])
    around = math.atan2(math.sin(around), math.cos(around))
    return radius * around, z - point[2]


@entry_point(
    void(GIVEN_1, GIVEN_2, float64, float64, float64, float64, boolean, CHANGED_2, CHANGED_2)
)
def find_entries(  # type: ignore[no-untyped-def]
    origin, points, radius, outer, taper, index, far, entries, errors
):
    """Finds where rays enter a cone by Newton's method.

    A step that leaves the wall, or does not help, is halved; what no step brings nearer stays
    where it is.

    Args:
        origin: (3,) camera's centre [m].
        points: (N, 3) on the inner wall, where the rays should arrive [m].
        radius, outer: of the inner and the outer face at z = 0 [m].
        taper: growth of the radius per height.
        far: whether the points are on the rear wall.
        entries: (N, 2) azimuth and height where to begin [rad, m]; receives where they enter.
        errors: (N, 2) receives by how much they miss their points [m].
    """
    wall, start = (radius, outer, taper, index), (origin[0], origin[1], origin[2])
    for i in range(points.shape[0]):
        point = (points[i, 0], points[i, 1], points[i, 2])
        azimuth, level = entries[i, 0], entries[i, 1]
        e, f = _error(azimuth, level, start, point, wall, far)
        for _ in range(STEPS):
            if not max(abs(e), abs(f)) > EXACT:
                break
            e1, f1 = _error(azimuth - DIFFERENCE, level, start, point, wall, far)
            e2, f2 = _error(azimuth, level - DIFFERENCE, start, point, wall, far)
            a, c = (e - e1) / DIFFERENCE, (f - f1) / DIFFERENCE
            b, d = (e - e2) / DIFFERENCE, (f - f2) / DIFFERENCE
            whole = a * d - b * c
            by, up, share = (d * e - b * f) / whole, (a * f - c * e) / whole, 1.0
            better, g, h = False, e, f
            for _ in range(HALVINGS):
                g, h = _error(azimuth - share * by, level - share * up, start, point, wall, far)
                better = abs(g) + abs(h) < abs(e) + abs(f)
                if better:
                    break
                share *= 0.5
            if not better:
                break
            azimuth, level, e, f = azimuth - share * by, level - share * up, g, h
        entries[i, 0], entries[i, 1] = azimuth, level
        errors[i, 0], errors[i, 1] = e, f
