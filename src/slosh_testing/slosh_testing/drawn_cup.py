"""Draws images of a cup with a known free surface, independent of the camera code."""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import jv

from slosh_camera.optics.calibration import Calibration
from slosh_camera.optics.camera import PinholeCamera, Pose
from slosh_camera.optics.cup import Cup, CupView
from slosh_camera.settings import DetectionSettings, RegionOfInterest

SHIFT = 6
XI = 1.8411837813
# Zeros of the derivatives of J1 (the second), J0 and J2.
XI_SECOND, XI_MEAN, XI_DOUBLE = 5.3314427735, 3.8317059702, 3.0542369282
WATER = 1.33


def fresnel(cosine: np.ndarray) -> np.ndarray:
    """Returns the reflectance of water for unpolarised light, by the incidence angle's cosine."""
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / WATER**2)
    across = ((cosine - WATER * inside) / (cosine + WATER * inside)) ** 2
    along = ((inside - WATER * cosine) / (inside + WATER * cosine)) ** 2
    return 0.5 * (across + along)


@dataclass(frozen=True)
class Wave:
    """A free surface with its crest at an azimuth; wall heights in [m].

    Attributes:
        amplitude: of the first mode.
        azimuth: of its crest [rad].
        level: of the liquid.
        second: of the second mode, in the same direction.
        mean: of the crest all around that the first mode drives.
        double: of the crest with two periods that it drives.
    """

    amplitude: float = 0.0
    azimuth: float = 0.0
    level: float = 0.0
    second: float = 0.0
    mean: float = 0.0
    double: float = 0.0

    def height(self, rho: np.ndarray, angle: np.ndarray) -> np.ndarray:
        turn = angle - self.azimuth
        return (
            self.level
            + self.amplitude * jv(1, XI * rho) / jv(1, XI) * np.cos(turn)
            + self.second * jv(1, XI_SECOND * rho) / jv(1, XI_SECOND) * np.cos(turn)
            + self.mean * jv(0, XI_MEAN * rho) / jv(0, XI_MEAN)
            + self.double * jv(2, XI_DOUBLE * rho) / jv(2, XI_DOUBLE) * np.cos(2.0 * turn)
        )

    @property
    def highest(self) -> tuple[float, float]:
        """Returns the highest wall height [m] and its azimuth [rad]."""
        angle = np.linspace(-np.pi, np.pi, 7201)
        around = self.height(np.ones(angle.size), angle)
        best = int(np.argmax(around))
        return float(around[best]), float(angle[best])


@dataclass(frozen=True)
class Scene:
    """A cup of 50 mm radius and 70 mm fill height, seen by an upright camera 450 mm away."""

    camera_height: float = 0.0
    camera_azimuth: float = -np.pi / 2.0
    roll: float = 0.0
    distance: float = 0.45
    # Height above the still level at which the optical axis crosses the cup's axis.
    aim: float = 0.0
    width: int = 640
    height: int = 480
    focal: float = 1000.0
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    distortion_model: str = "plumb_bob"
    radius: float = 0.05
    fill_height: float = 0.07
    rim_height: float | None = 0.13
    liquid: int = 45
    surface: int = 110
    background: int = 215
    noise: float = 0.0
    seed: int = 1
    oversampling: int = 4

    def extrinsics(self) -> tuple[np.ndarray, np.ndarray]:
        azimuth = self.camera_azimuth
        centre = np.array(
            [self.distance * np.cos(azimuth), self.distance * np.sin(azimuth), self.camera_height]
        )
        forward = np.array([0.0, 0.0, self.aim]) - centre
        forward /= np.linalg.norm(forward)
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        rotation = np.vstack((right, np.cross(forward, right), forward))
        c, s = np.cos(self.roll), np.sin(self.roll)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ rotation
        return rotation, -rotation @ centre

    def calibration(
        self,
        settings: DetectionSettings | None = None,
        region: RegionOfInterest | None = None,
    ) -> Calibration:
        camera = PinholeCamera(
            self.width,
            self.height,
            self.focal,
            self.focal,
            0.5 * (self.width - 1),
            0.5 * (self.height - 1),
            self.distortion,
            self.distortion_model,
        )
        cup = Cup(self.radius, self.fill_height, 0.002, self.rim_height, 1.0)
        view = CupView(camera, Pose(*self.extrinsics()), cup)
        return Calibration(view, region=region, detection=settings or DetectionSettings())

    def project(self, points: np.ndarray) -> np.ndarray:
        rotation, translation = self.extrinsics()
        k = np.array(
            [
                [self.focal, 0.0, 0.5 * (self.width - 1)],
                [0.0, self.focal, 0.5 * (self.height - 1)],
                [0.0, 0.0, 1.0],
            ]
        )
        turn, lens = cv2.Rodrigues(rotation)[0], np.array(self.distortion)
        if self.distortion_model == "equidistant":
            points = np.asarray(points, np.float64).reshape(1, -1, 3)
            pixels, _ = cv2.fisheye.projectPoints(points, turn, translation, k, lens)
        else:
            pixels, _ = cv2.projectPoints(points, turn, translation, k, lens)
        return pixels.reshape(-1, 2)

    def draw(self, amplitude: float = 0.0, azimuth: float = 0.0, level: float = 0.0) -> np.ndarray:
        """Draws a grey image of the first mode with a given wall height and azimuth."""
        return self.draw_wave(Wave(amplitude, azimuth, level))

    def draw_wave(self, wave: Wave) -> np.ndarray:
        """Draws a grey image of the cup with a given free surface."""
        image = np.full(
            (self.oversampling * self.height, self.oversampling * self.width),
            self.background,
            np.uint8,
        )
        if wave != Wave(0.0, wave.azimuth, wave.level):
            self._draw_surface(image, wave)
        elif self.camera_height > wave.level:
            self._fill(
                image,
                self._wall(np.linspace(-np.pi, np.pi, 721), np.full(721, wave.level)),
                self.surface,
            )
        half = np.arccos(self.radius / self.distance)
        front = self.camera_azimuth + np.linspace(-half, half, 361)
        line = self._wall(front, wave.height(np.ones(front.size), front))
        floor = self._wall(front, np.full(front.size, -self.fill_height))
        self._fill(image, np.vstack((line, floor[::-1])), self.liquid)
        small = cv2.resize(image, (self.width, self.height), interpolation=cv2.INTER_AREA)
        return self._exposed(small)

    def _draw_surface(self, image: np.ndarray, wave: Wave) -> None:
        """Draws the free surface in small patches that mirror the background."""
        radial = np.linspace(0.0, 1.0, 91)
        around = np.linspace(-np.pi, np.pi, 241)
        rho, angle = np.meshgrid(radial, around, indexing="ij")
        height = wave.height(rho, angle)
        points = np.stack(
            (self.radius * rho * np.cos(angle), self.radius * rho * np.sin(angle), height), axis=-1
        )
        corners = np.stack(
            (points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]), axis=2
        ).reshape(-1, 4, 3)
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        rotation, translation = self.extrinsics()
        sight = -rotation.T @ translation - corners.mean(axis=1)
        distance = np.linalg.norm(sight, axis=1)
        cosine = np.sum(normal * sight, axis=1) / np.linalg.norm(normal, axis=1) / distance
        mirrored = fresnel(np.clip(cosine, 0.0, 1.0))
        grey = np.rint(self.surface + mirrored * (self.background - self.surface))
        pixels = (self.project(corners.reshape(-1, 3)) + 0.5) * self.oversampling - 0.5
        fixed = np.rint(pixels * (1 << SHIFT)).astype(np.int32).reshape(-1, 4, 2)
        for index in np.argsort(-distance):
            # Only what is seen from above; from below the surface is a mirror of the liquid.
            if cosine[index] > 0.0:
                cv2.fillConvexPoly(image, fixed[index], grey[index], cv2.LINE_8, SHIFT)

    def with_sides(self, image: np.ndarray) -> np.ndarray:
        """Returns the image with the visible sides of a glass container."""
        view, picture = self.calibration().view, image.copy()
        outer = view.cup.radius + view.cup.wall_thickness
        half = np.arccos(outer / np.hypot(*view.pose.camera_centre[:2]))
        for azimuth in (view.camera_azimuth - half, view.camera_azimuth + half):
            ends = np.column_stack(
                (np.full((2, 2), outer) * (np.cos(azimuth), np.sin(azimuth)), (-0.07, 0.06))
            )
            first, last = np.rint(view.project(ends) * 16).astype(int)
            cv2.line(picture, tuple(first), tuple(last), 120, 2, cv2.LINE_AA, 4)
        return picture

    def with_rings(self, image: np.ndarray, heights: Iterable[float], arc=(-76.0, 76.0)):
        """Returns the image with lines printed around the container at given heights [m]."""
        view, picture = self.calibration().view, image.copy()
        azimuth = view.camera_azimuth + np.deg2rad(np.linspace(*arc, 61))
        across = self.radius * np.column_stack((np.cos(azimuth), np.sin(azimuth)))
        for height in heights:
            points = np.column_stack((across, np.full(61, height)))
            line = np.rint(view.project(points) * 16).astype(np.int32)
            cv2.polylines(picture, [line], False, 60, 2, cv2.LINE_AA, 4)
        return picture

    def empty(self) -> np.ndarray:
        """Returns a grey image of the background only."""
        return self._exposed(np.full((self.height, self.width), self.background, np.uint8))

    def _exposed(self, image: np.ndarray) -> np.ndarray:
        if self.noise == 0.0:
            return image
        noise = np.random.default_rng(self.seed).normal(0.0, self.noise, image.shape)
        return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)

    def _wall(self, azimuth: np.ndarray, height: np.ndarray) -> np.ndarray:
        return np.column_stack(
            (self.radius * np.cos(azimuth), self.radius * np.sin(azimuth), height)
        )

    def _fill(self, image: np.ndarray, points: np.ndarray, grey: int) -> None:
        # Pixel centres are whole numbers in the image and in its magnified copy.
        pixels = (self.project(points) + 0.5) * self.oversampling - 0.5
        fixed = np.rint(pixels * (1 << SHIFT)).astype(np.int32)
        cv2.fillPoly(image, [fixed], grey, cv2.LINE_8, SHIFT)
