"""The five parameters of a camera's pose relative to a round container.

A turn about the container's own axis cannot be seen; the azimuth of the camera is chosen instead.
What the user gave of lens and container may be off, and is corrected with the pose.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera, Pose
from slosh_camera.optics.cup import Cup

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CameraPlace:
    """Position and orientation of a camera relative to an upright round container.

    Attributes:
        distance: of the camera's centre from the container's axis [m].
        height: of the camera's centre above the still level [m].
        yaw: turn to the left, away from looking at the axis [rad].
        pitch: turn downwards [rad].
        roll: turn of the picture clockwise [rad].
    """

    distance: float
    height: float
    yaw: float
    pitch: float
    roll: float

    @property
    def numbers(self) -> FloatArray:
        """The five pose parameters as an array, in the order of the attributes."""
        return np.array(astuple(self))


def pose_of(place: CameraPlace, azimuth: float) -> Pose:
    """Returns the transform from the container's frame to the camera's frame.

    Args:
        place: the camera's place.
        azimuth: at which the camera stands about the container's axis [rad].
    """
    cy, sy = np.cos(place.yaw), np.sin(place.yaw)
    cp, sp = np.cos(place.pitch), np.sin(place.pitch)
    cr, sr = np.cos(place.roll), np.sin(place.roll)
    yaw = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    pitch = np.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
    roll = np.array([[cr, -sr, 0.0], [sr, cr, 0.0], [0.0, 0.0, 1.0]])
    rotation = roll @ pitch @ yaw @ _upright(azimuth)
    centre = np.array(
        [place.distance * np.cos(azimuth), place.distance * np.sin(azimuth), place.height]
    )
    return Pose(rotation, -rotation @ centre)


def place_of(pose: Pose) -> tuple[CameraPlace, float]:
    """Computes pose parameters and camera azimuth [rad] from a transform; inverse of pose_of.

    Raises:
        SloshCameraError: the camera stands on the container's axis.
    """
    centre = pose.camera_centre
    distance = float(np.hypot(centre[0], centre[1]))
    if distance < 1e-9:
        raise SloshCameraError("pose: the camera is straight above the container")
    azimuth = float(np.arctan2(centre[1], centre[0]))
    turn = pose.rotation @ _upright(azimuth).T
    # turn = roll pitch yaw; its middle column is (-sr cp, cr cp, sp), its last row
    # (-cp sy, sp, cp cy).
    place = CameraPlace(
        distance,
        float(centre[2]),
        float(np.arctan2(-turn[2, 0], turn[2, 2])),
        float(np.arcsin(np.clip(turn[2, 1], -1.0, 1.0))),
        float(np.arctan2(-turn[0, 1], turn[1, 1])),
    )
    return place, azimuth


def _upright(azimuth: float) -> FloatArray:
    """Returns the rotation from the container to a level camera that looks at its axis."""
    c, s = np.cos(azimuth), np.sin(azimuth)
    return np.array([[-s, c, 0.0], [0.0, 0.0, -1.0], [-c, -s, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """A container's axis in the camera frame, as an infinite line.

    Attributes:
        up: (3,) unit vector along the axis.
        forward: (3,) unit vector from the camera's centre to the axis, at right angles to it.
        distance: of the axis from the camera's centre [m].
    """

    up: FloatArray
    forward: FloatArray
    distance: float

    @property
    def rotation(self) -> FloatArray:
        """Rotation matrix from the container to the camera, at a camera azimuth of -90 deg."""
        return np.column_stack((np.cross(self.forward, self.up), self.forward, self.up))

    def pitched(self, angle: float) -> Axis:
        """Returns the axis after pitching the camera down by an angle [rad]."""
        c, s = np.cos(angle), np.sin(angle)
        return Axis(c * self.up + s * self.forward, c * self.forward - s * self.up, self.distance)

    def place(self, height: float) -> CameraPlace:
        """Returns the camera's pose parameters for its height above the liquid level [m]."""
        translation = self.distance * self.forward - height * self.up
        return place_of(Pose(self.rotation, translation))[0]


def axis_from_sides(left: FloatArray, right: FloatArray, radius: float) -> Axis | None:
    """Computes the axis of a cylinder from the two image lines of its sides.

    Args:
        left: (2, 3) two rays of the left side, in the camera frame.
        right: (2, 3) two rays of the right side.
        radius: outer radius [m].

    Returns:
        The axis; None where the two sides cannot be those of one cylinder.
    """
    normals = [np.cross(side[0], side[1]) for side in (left, right)]
    if min(np.linalg.norm(normal) for normal in normals) < 1e-12:
        return None
    up = np.cross(normals[0], normals[1])
    length = float(np.linalg.norm(up))
    if length < 1e-12:
        return None
    up = up / length * (-1.0 if up[1] > 0.0 else 1.0)
    flat = []
    for side in (left, right):
        ray = side.sum(axis=0)
        ray = ray - (ray @ up) * up
        flat.append(ray / np.linalg.norm(ray))
    forward = flat[0] + flat[1]
    forward /= np.linalg.norm(forward)
    sine = float(np.linalg.norm(np.cross(flat[0], forward)))
    if sine < 1e-4:
        return None
    return Axis(up, forward, radius / sine)


@dataclass(frozen=True, slots=True, eq=False)
class ConeAxis:
    """Axis of a cone in the camera frame, found from its two sides, without its distance.

    Attributes:
        up: (3,) unit vector along the axis.
        tip: (3,) unit vector from the camera's centre towards the cone's tip.
    """

    up: FloatArray
    tip: FloatArray

    @property
    def forward(self) -> FloatArray:
        """Unit vector (3,) from the camera's centre to the axis, perpendicular to the axis."""
        across = self.tip - (self.tip @ self.up) * self.up
        return np.asarray(across / np.linalg.norm(across))

    def at(self, away: float, above: float) -> tuple[Axis, float]:
        """Returns the axis at a distance, and the camera's height above the still level [m].

        Args:
            away: of the tip from the camera's centre [m].
            above: height of the still level above the tip [m]; negative: below.
        """
        distance = away * float(self.tip @ self.forward)
        return Axis(self.up, self.forward, distance), -away * float(self.tip @ self.up) - above


def cone_from_sides(left: FloatArray, right: FloatArray, taper: float) -> ConeAxis | None:
    """Computes a cone's axis from the planes through the camera that touch its two sides.

    Each plane's outward normal n is inclined to the axis u by the wall: n·u = -sin(atan(taper)).
    The planes meet in the line through the camera and the tip.

    Args:
        left: (2, 3) two rays of the left side, in the camera frame.
        right: (2, 3) two rays of the right side.
        taper: growth of the radius per height, dr/dz; not 0.

    Returns:
        The axis; None where the two sides cannot be those of such a cone.
    """
    normals = []
    for side, outwards in ((left, -1.0), (right, 1.0)):
        normal = np.cross(side[0], side[1])
        length = float(np.linalg.norm(normal))
        if length < 1e-12:
            return None
        normals.append(normal / length * np.copysign(1.0, outwards * normal[0]))
    middle, tip = normals[0] + normals[1], np.cross(normals[0], normals[1])
    if np.linalg.norm(middle) < 1e-9 or np.linalg.norm(tip) < 1e-9:
        return None
    middle /= np.linalg.norm(middle)
    # Below the container where it is wider above.
    tip *= np.copysign(1.0 / np.linalg.norm(tip), taper * tip[1])
    along = -taper / np.hypot(1.0, taper) / float(middle @ normals[0])
    if not abs(along) < 1.0:
        return None
    up = along * middle - np.copysign(np.sqrt(1.0 - along**2), taper) * tip
    return ConeAxis(up, tip) if up[1] < 0.0 else None


QUANTITIES = 3


@dataclass(frozen=True, slots=True)
class GivenDeviations:
    """Standard deviations of the user's focal length and container dimensions; 0: exact.

    Attributes:
        focal_length: relative.
        wall_thickness: [m].
        fill_height: [m].
    """

    focal_length: float = 0.0
    wall_thickness: float = 0.0
    fill_height: float = 0.0

    @property
    def stddev(self) -> FloatArray:
        """Returns the standard deviations as an array (QUANTITIES,)."""
        return np.array([self.focal_length, self.wall_thickness, self.fill_height])

    @property
    def open(self) -> NDArray[np.bool_]:
        """Mask (QUANTITIES,) of the user's values that are uncertain and so are estimated."""
        return self.stddev > 0.0


KNOWN = GivenDeviations()


@dataclass(frozen=True, slots=True, eq=False)
class GivenView:
    """The camera and container that the user gave, with their uncertainties.

    Attributes:
        doubt: how far both may be off.
    """

    camera: PinholeCamera
    cup: Cup
    doubt: GivenDeviations = KNOWN

    def off_by(self, change: FloatArray) -> tuple[PinholeCamera, Cup]:
        """Returns camera and container with corrections added to the values that the user gave.

        Args:
            change: (QUANTITIES,) of the focal length's logarithm, the wall's thickness [m] and
                the fill height [m].
        """
        if not np.any(change):
            return self.camera, self.cup
        zoom = float(np.exp(np.clip(change[0], -3.0, 3.0)))
        camera = replace(self.camera, fx=zoom * self.camera.fx, fy=zoom * self.camera.fy)
        wall = max(self.cup.wall_thickness + float(change[1]), 0.0)
        fill = max(
            self.cup.fill_height + float(change[2]), TUNING.least_told * self.cup.fill_height
        )
        rim = self.cup.rim_height
        cup = replace(
            self.cup,
            radius=float(self.cup.radius_at(fill - self.cup.fill_height)),
            wall_thickness=wall,
            fill_height=fill,
            rim_height=rim if rim is None or rim > fill else None,
        )
        return camera, cup
