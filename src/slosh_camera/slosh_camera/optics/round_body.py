"""Projects a body of revolution into a side view, and pixels back onto its silhouette.

Container frame: origin in the centre of the still free surface, x to the right in the image, y
away from the camera, z up. Pixels are placed in the plane through the axis that faces the camera:
there its silhouette has the width of the outer wall, seen a little wider from near by. Places
across are given as parts of the silhouette's half width at their height, times that of the still
level: the two walls are at the same place at every height.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from slosh_base.types import Array
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.box import Box, BoxView
from slosh_model.containers import PRISMATIC, Container
from slosh_model.shapes.revolution import RevolvedContainer

_ROUNDS, _LEANING = 4, 12
ELEVATION = np.deg2rad(6.0)
"""From higher above, or lower below, the line before and the line behind are two."""
_STEEPEST = 3.0
"""Slope of a wall, as a change of its radius per height, beyond which its thickness is flat."""


@dataclass(frozen=True, slots=True)
class RoundBody(Box):
    """A body of revolution as seen from the side; `width` is that of its silhouette."""

    body: RevolvedContainer | None = field(default=None, metadata={"is_length": False})

    @classmethod
    def of(
        cls, container: Container, wall_thickness: float = 0.0, wall_refractive_index: float = 1.49
    ) -> RoundBody:
        """Creates the body of revolution from a model's container.

        Raises:
            SloshCameraError: it is no body of revolution.
        """
        if not isinstance(container, RevolvedContainer):
            raise SloshCameraError(
                f"shape: a {container.shape} has no silhouette that tells heights; possible are "
                "cylinder, rectangle and bodies of revolution"
                + f"; along its y it is a rectangle of width {container.size:g} m, as which "
                "`slosh calibrate --scale --model` describes it" * (container.section == PRISMATIC)
            )
        lean = float(np.hypot(1.0, min(abs(container.widening), _STEEPEST)))
        return cls(
            2.0 * (container.size + lean * wall_thickness), container.fill_height, None,
            wall_thickness, wall_refractive_index, container.rim_height, container,
        )  # fmt: skip

    def seen_width(self, distance: float) -> float:
        """Returns the silhouette's width at the liquid's level, in the axis plane [m].

        Args:
            distance: of the camera from the axis [m].
        """
        half = 0.5 * self.width
        return float(self.width * distance / np.sqrt(distance**2 - half**2))


@dataclass(frozen=True, slots=True, eq=False)
class RoundView(BoxView):
    """Projection between a body of revolution and a level camera's side view."""

    _levels: Array = field(init=False, repr=False)
    _halves: Array = field(init=False, repr=False)
    _seen: float = field(init=False, repr=False)
    bore: float = field(init=False)

    def __post_init__(self) -> None:
        """Raises SloshCameraError if the camera is not level or not outside the container."""
        BoxView.__post_init__(self)
        box, centre = self.box, self._centre
        _, levels, radii = self.body.wall_line
        distance = float(np.hypot(centre[0], centre[1]))
        slope = np.gradient(radii, levels)
        lean = np.hypot(1.0, np.clip(slope, -_STEEPEST, _STEEPEST))
        outer = radii + lean * box.wall_thickness
        outer = np.minimum(outer, box.wall_refractive_index * radii)
        if distance <= 1.2 * float(outer.max()):
            raise SloshCameraError("pose: the camera is too near to see both sides of the wall")
        if abs(centre[2]) > np.tan(ELEVATION) * distance:
            raise SloshCameraError(
                f"pose: the camera stands {np.rad2deg(np.arctan2(centre[2], distance)):.0f} deg "
                f"above the still level, must be within {np.rad2deg(ELEVATION):.0f} deg: a body "
                "of revolution is measured from the side only"
            )
        seen = outer * distance / np.sqrt(distance**2 - outer**2)
        object.__setattr__(self, "_levels", levels)
        object.__setattr__(self, "_halves", seen)
        object.__setattr__(self, "_seen", float(np.interp(0.0, levels, seen)))
        object.__setattr__(self, "bore", self.body.size / (0.5 * box.width))

    @property
    def body(self) -> RevolvedContainer:
        """The container as a body of revolution."""
        assert isinstance(self.box, RoundBody)
        assert self.box.body is not None
        return self.box.body

    @property
    def distance(self) -> float:
        """Distance of the camera from the container's axis [m]."""
        return float(np.hypot(self._centre[0], self._centre[1]))

    def half_width(self, z: ArrayLike) -> Array:
        """Returns half the silhouette's width in the axis plane at given heights [m]."""
        return np.asarray(np.interp(np.asarray(z), self._levels, self._halves))

    def project_face(self, x: ArrayLike, z: ArrayLike) -> Array:
        """Projects positions x and heights z [m] in the plane of the axis to pixels (N, 2)."""
        across, level = np.broadcast_arrays(
            np.atleast_1d(np.asarray(x, dtype=np.float64)),
            np.atleast_1d(np.asarray(z, dtype=np.float64)),
        )
        place = across * self.half_width(level) / (0.5 * self.box.width)
        points = np.column_stack((place, np.zeros(place.size), level))
        return self.camera.project(points @ self.pose.rotation.T + self.pose.translation)

    def on_face(self, pixels: ArrayLike) -> tuple[Array, Array]:
        """Converts pixels (N, 2) to positions x and heights z [m] in the plane of the axis."""
        slope_x, slope_z = self._slopes(pixels)
        z = self._centre[2] - slope_z * self._centre[1]
        x = self._centre[0] - slope_x * self._centre[1]
        return x * (0.5 * self.box.width) / self.half_width(z), z

    def around(self, x: Array, z: Array, *, far: bool) -> tuple[Array, Array]:
        """Returns azimuths and heights on the inner wall of points seen in the axis plane.

        Args:
            x: (N,) places across [m].
            z: (N,) heights above the still level in that plane [m].
            far: whether they lie on the half of the wall beyond the axis.

        Returns:
            (N,) azimuths from the camera's direction to the right [rad], and heights [m].
        """
        heights, azimuths = z, np.zeros(x.size)
        # The nearer half is seen larger, and at another height the wall is of another radius.
        for _ in range(_ROUNDS):
            place = x * self.half_width(z) / self.half_width(heights)
            azimuths = self._azimuths(place, far=far)
            inner = self.half_width(heights) * self.bore
            heights = z * (1.0 - inner * np.cos(azimuths) / self.distance)
        return azimuths, heights

    def upright(self, heights: Array) -> Array:
        """Converts heights (N,) [m] on an inclined wall to equivalent heights on a vertical wall.

        A plane meets a leaning wall where its height is the slope times the radius there.
        """
        return heights * self.half_width(0.0) / self.half_width(heights)

    def leaning(self, heights: Array) -> Array:
        """Converts heights [m] on a vertical wall to an inclined wall; inverse of `upright`."""
        found = heights
        for _ in range(_LEANING):
            found = heights * self.half_width(found) / self.half_width(0.0)
        return found

    def _azimuths(self, x: Array, *, far: bool) -> Array:
        """Returns the azimuths (N,) on the inner wall that are seen at lateral positions (N,).

        A ray keeps its distance from the axis, n times less in the wall (Bouguer's law); its
        azimuth changes by the difference of the angles at both ends of each way.
        """
        index, half = self.box.wall_refractive_index, 0.5 * self.box.width
        direction = np.arctan(x * self._seen / half / self.distance)
        passing = self.distance * np.sin(direction) / half
        outside, inside, bore, beyond = (
            np.arcsin(np.clip(passing / part, -1.0, 1.0))
            for part in (1.0, index, index * self.bore, self.bore)
        )
        near = outside - direction - inside + bore
        # Where the inner wall throws the ray back, nothing beyond is seen.
        return near + np.where(beyond >= 0.0, np.pi, -np.pi) - 2.0 * beyond if far else near
