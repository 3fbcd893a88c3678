"""A drawn cup with a known plane surface, independent of the package's own projection."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from slosh_camera.calibration import Calibration
from slosh_camera.camera import PinholeCamera
from slosh_camera.geometry import Cup, CupView, Pose
from slosh_camera.settings import DetectionSettings, RegionOfInterest

SHIFT = 6


@dataclass(frozen=True)
class Scene:
    """Cup of 50 mm radius and 70 mm fill height seen from 450 mm by an upright camera."""

    camera_height: float = 0.0
    camera_azimuth: float = -np.pi / 2.0
    roll: float = 0.0
    distance: float = 0.45
    # Height above the still level at which the optical axis crosses the cup's axis.
    aim: float = 0.0
    width: int = 640
    height: int = 480
    focal: float = 1000.0
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
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
        pixels, _ = cv2.projectPoints(
            points, cv2.Rodrigues(rotation)[0], translation, k, np.array(self.distortion)
        )
        return pixels.reshape(-1, 2)

    def draw(self, amplitude: float = 0.0, azimuth: float = 0.0, level: float = 0.0) -> np.ndarray:
        """Grey image of the plane z = level + amplitude at the wall in the given azimuth."""
        image = np.full(
            (self.oversampling * self.height, self.oversampling * self.width),
            self.background,
            np.uint8,
        )
        half = np.arccos(self.radius / self.distance)
        front = self.camera_azimuth + np.linspace(-half, half, 361)
        line = self._wall(front, level + amplitude * np.cos(front - azimuth))
        floor = self._wall(front, np.full(front.size, -self.fill_height))
        self._fill(image, np.vstack((line, floor[::-1])), self.liquid)
        slope = amplitude / self.radius * np.cos(self.camera_azimuth - azimuth)
        # A surface seen edge-on has no area.
        if self.camera_height > 1e-9 + level + slope * self.distance:
            around = np.linspace(-np.pi, np.pi, 721)
            loop = self._wall(around, level + amplitude * np.cos(around - azimuth))
            self._fill(image, loop, self.surface)
        small = cv2.resize(image, (self.width, self.height), interpolation=cv2.INTER_AREA)
        return self._exposed(small)

    def empty(self) -> np.ndarray:
        """Grey image of the background alone."""
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


@pytest.fixture(scope="session")
def make_scene() -> type[Scene]:
    return Scene
