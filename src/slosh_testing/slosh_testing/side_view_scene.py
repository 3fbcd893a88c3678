"""Renders side views of a rectangular container by ray tracing, with exact heights.

The rays, their bending in the container's wall and the lens' distortion are computed here by
other means than in slosh_camera, so that an error there does not hide itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.optics.box import Box, BoxView
from slosh_camera.optics.calibration import SideCalibration
from slosh_camera.optics.camera import PinholeCamera, Pose
from slosh_camera.settings import RegionOfInterest

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
Grey = float | tuple[float, float, float]

SUPERSAMPLES = 2


@dataclass(frozen=True)
class Setup:
    """Dimensions and pose of container and camera; lengths in metres, angles in radians."""

    width: float = 0.08
    depth: float = 0.04
    fill_height: float = 0.06
    rim_height: float | None = 0.11
    wall_thickness: float = 0.002
    wall_refractive_index: float = 1.49
    distance: float = 0.4
    yaw: float = 0.0
    elevation: float = 0.0
    roll: float = 0.0
    aim: float = 0.0
    columns: int = 480
    rows: int = 400
    focal: float = 1600.0
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def pose(self) -> tuple[FloatArray, FloatArray]:
        """Returns rotation and translation from the container's frame to the camera's."""
        away = np.array(
            [
                np.sin(self.yaw) * np.cos(self.elevation),
                -np.cos(self.yaw) * np.cos(self.elevation),
                np.sin(self.elevation),
            ]
        )
        target = np.array([0.0, -0.5 * self.depth, self.aim])
        centre = target + self.distance * away
        right = np.array([np.cos(self.yaw), np.sin(self.yaw), 0.0])
        rotation = np.vstack((right, np.cross(-away, right), -away))
        c, s = np.cos(self.roll), np.sin(self.roll)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ rotation
        return rotation, -rotation @ centre

    def matrix(self) -> FloatArray:
        """Returns the camera matrix K, (3, 3) [px]."""
        u, v = 0.5 * (self.columns - 1), 0.5 * (self.rows - 1)
        return np.array([[self.focal, 0.0, u], [0.0, self.focal, v], [0.0, 0.0, 1.0]])

    def calibration(self, region: RegionOfInterest | None = None) -> SideCalibration:
        """Returns the calibration of the side view that matches the images."""
        k = self.matrix()
        camera = PinholeCamera(
            self.columns, self.rows, k[0, 0], k[1, 1], k[0, 2], k[1, 2], self.distortion
        )
        box = Box(
            self.width,
            self.fill_height,
            self.depth,
            self.wall_thickness,
            self.wall_refractive_index,
            self.rim_height,
        )
        return SideCalibration(BoxView(camera, Pose(*self.pose()), box), region=region)


@dataclass(frozen=True)
class Liquid:
    """Free surface z = level + slope x + modes; modal amplitudes are heights at the left wall."""

    level: float = 0.0
    slope: float = 0.0
    modes: tuple[float, ...] = ()

    def at(self, x: FloatArray, width: float) -> FloatArray:
        """Returns the surface heights [m] at positions x [m]."""
        z = self.level + self.slope * x
        for number, amplitude in enumerate(self.modes, start=1):
            z = z + amplitude * np.cos(number * np.pi * (x / width + 0.5))
        return np.asarray(z, dtype=np.float64)

    def angle(self, width: float) -> float:
        """Returns the angle of the surface's least-squares line over the width [rad]."""
        x = np.linspace(-0.5 * width, 0.5 * width, 2001)
        return float(np.arctan(np.polyfit(x, self.at(x, width), 1)[0]))

    def highest(self, width: float) -> float:
        """Returns the height of the surface's highest point [m]."""
        return float(np.max(self.at(np.linspace(-0.5 * width, 0.5 * width, 2001), width)))


@dataclass(frozen=True)
class Patch:
    """A coloured rectangle or ellipse on the front face, between two corners (x, z) [m]."""

    low: tuple[float, float]
    high: tuple[float, float]
    grey: Grey
    round: bool = False

    def covers(self, x: FloatArray, z: FloatArray) -> NDArray[np.bool_]:
        """Returns which positions (x, z) on the front face the patch covers."""
        u = (2.0 * x - self.low[0] - self.high[0]) / (self.high[0] - self.low[0])
        v = (2.0 * z - self.low[1] - self.high[1]) / (self.high[1] - self.low[1])
        inside = u**2 + v**2 <= 1.0 if self.round else (np.abs(u) <= 1.0) & (np.abs(v) <= 1.0)
        return np.asarray(inside)


@dataclass(frozen=True)
class Look:
    """Grey levels or colours, illumination and camera noise of a rendered side view."""

    liquid: Grey = 60.0
    background: Grey = 190.0
    surface: Grey = 90.0
    outside: Grey = 120.0
    # The light at the right edge of the image is stronger than at the left one by this part.
    gradient: float = 0.0
    brightness: float = 1.0
    blur: float = 0.6
    motion: int = 0
    noise: float = 0.0
    jpeg: int | None = None
    patches: tuple[Patch, ...] = field(default=())


def draw(setup: Setup, liquid: Liquid, look: Look = Look(), seed: int = 1) -> Image:
    """Renders the side view: (rows, columns), or (rows, columns, 3) for colours."""
    x, z, way = _places(setup)
    inside = (np.abs(x) <= 0.5 * setup.width) & (z >= -setup.fill_height)
    if setup.rim_height is not None:
        inside &= z <= setup.rim_height - setup.fill_height
    # Parts of a sub-pixel, so that a level line may lie anywhere between two rows of them.
    size = np.abs(np.gradient(z, axis=0))
    wet = inside * _part(liquid.at(x, setup.width) - z, size)
    # Behind the face the ray goes on through air until it meets the surface, a side or the rear.
    side = np.copysign(0.5 * setup.width, way[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.fmin((side - x) / way[0], setup.depth)
    rear_x, rear_z = x + way[0] * depth, z + way[1] * depth
    top = inside * _part(liquid.at(rear_x, setup.width) - rear_z, size)
    colours = [np.atleast_1d(np.asarray(value, dtype=np.float64)) for value in _greys(look)]
    channels = max(colour.size for colour in colours)
    picture = np.empty((*x.shape, channels))
    picture[:] = colours[3]
    for part, colour in ((inside, colours[1]), (top, colours[2]), (wet, colours[0])):
        picture += part[..., np.newaxis] * (colour - picture)
    for patch in look.patches:
        picture[patch.covers(x, z)] = np.atleast_1d(patch.grey)
    small = picture.reshape(setup.rows, SUPERSAMPLES, setup.columns, SUPERSAMPLES, channels)
    return _exposed(small.mean(axis=(1, 3)), look, seed)


def still(setup: Setup, look: Look = Look()) -> Image:
    """Renders the same side view with the liquid at rest and different noise."""
    return draw(setup, Liquid(), replace(look, motion=0), seed=999)


def _part(above: FloatArray, size: FloatArray) -> FloatArray:
    """Returns what fraction of a sub-pixel is below a line, by the line's height at its centre."""
    return np.clip(above / size + 0.5, 0.0, 1.0)


def _greys(look: Look) -> tuple[Grey, ...]:
    return look.liquid, look.background, look.surface, look.outside


@lru_cache(maxsize=8)
def _places(setup: Setup) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Returns where sub-pixels' rays meet the inner front face (x, z), and the rays' slopes."""
    at = (np.arange(SUPERSAMPLES * setup.columns) + 0.5) / SUPERSAMPLES - 0.5
    down = (np.arange(SUPERSAMPLES * setup.rows) + 0.5) / SUPERSAMPLES - 0.5
    u, v = np.meshgrid(at, down)
    pixels = np.column_stack((u.ravel(), v.ravel()))
    flat = _undistorted((pixels - setup.matrix()[:2, 2]) / setup.focal, setup.distortion)
    rotation, translation = setup.pose()
    centre = -rotation.T @ translation
    ray = np.column_stack((flat, np.ones(len(flat)))) @ rotation
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    # Vector form of Snell's law at a face whose outward normal is -y.
    cosine = ray[:, 1]
    ratio = 1.0 / setup.wall_refractive_index
    inner_cosine = np.sqrt(1.0 - ratio**2 * (1.0 - cosine**2))
    glass = ratio * ray + np.outer(inner_cosine - ratio * cosine, [0.0, 1.0, 0.0])
    outer = -0.5 * setup.depth - setup.wall_thickness
    hit = centre + ray * ((outer - centre[1]) / cosine)[:, np.newaxis]
    hit = hit + glass * (setup.wall_thickness / glass[:, 1])[:, np.newaxis]
    shape = u.shape
    slopes = np.stack(((ray[:, 0] / cosine).reshape(shape), (ray[:, 2] / cosine).reshape(shape)))
    return hit[:, 0].reshape(shape), hit[:, 2].reshape(shape), slopes


def _undistorted(seen: FloatArray, distortion: tuple[float, ...]) -> FloatArray:
    """Removes lens distortion from ray tangents (N, 2) by OpenCV's fixed-point iteration."""
    k1, k2, p1, p2, k3 = distortion
    flat = seen.copy()
    for _ in range(60 if any(distortion) else 0):
        x, y = flat.T
        square = x * x + y * y
        radial = 1.0 + square * (k1 + square * (k2 + square * k3))
        shift_x = 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x)
        shift_y = p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y
        flat = (seen - np.column_stack((shift_x, shift_y))) / radial[:, np.newaxis]
    return flat


def _exposed(picture: FloatArray, look: Look, seed: int) -> Image:
    ramp = np.linspace(-0.5, 0.5, picture.shape[1])[:, np.newaxis]
    picture = picture * look.brightness * (1.0 + look.gradient * ramp)
    if look.blur > 0.0:
        blurred = cv2.GaussianBlur(picture, (0, 0), look.blur)
        picture = np.asarray(blurred, np.float64).reshape(picture.shape)
    if look.motion > 1:
        kernel = np.full((1, look.motion), 1.0 / look.motion)
        smeared = cv2.filter2D(picture, -1, kernel)
        picture = np.asarray(smeared, np.float64).reshape(picture.shape)
    if look.noise > 0.0:
        picture = picture + np.random.default_rng(seed).normal(0.0, look.noise, picture.shape)
    image = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    image = image[..., 0] if image.shape[2] == 1 else image
    if look.jpeg is not None:
        data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, look.jpeg])[1]
        image = np.asarray(cv2.imdecode(data, cv2.IMREAD_UNCHANGED), dtype=np.uint8)
    return image
