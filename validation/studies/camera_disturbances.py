"""Disturbances of rendered images, such as noise, blur or a covered wall, for robustness tests.

Every disturbance is the same in each run: its random numbers come from its name and the frame.
Where a disturbance is there from the start (noise, blur, a tilted camera, uneven light, JPEG), the
image of the liquid at rest is disturbed as well; what comes later or passes (the light changes,
something stands before the line, motion blur, highlights) is in the frames alone.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import with_tools  # noqa: F401
from camera_sequences import FrameTruth, Image, RenderedSequence
from numpy.typing import NDArray

from slosh_camera.optics.calibration import Calibration
from slosh_camera.optics.camera import PinholeCamera, Pose
from slosh_camera.optics.cup import CupView

FloatArray = NDArray[np.float64]

ROLL = math.radians(2.0)
# Half the height of an opaque patch beyond the line that it hides [px].
_BEYOND_LINE = 12.0
_LABEL_HALF_WIDTH = math.radians(20.0)
_LABEL_HALF_HEIGHT = 0.012


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Camera view and exact heights of an image; `truth` is None for an image at rest."""

    view: CupView
    truth: FrameTruth | None

    def line(self, azimuth: FloatArray) -> FloatArray:
        """Returns the pixels (N, 2) of the exact wall line at azimuths [rad], where known."""
        level = np.zeros_like(azimuth) if self.truth is None else self.truth.height(azimuth)
        pixels = self.view.project_wall(azimuth, level)
        return np.asarray(pixels[np.all(np.isfinite(pixels), axis=1)])


Operation = Callable[[Image, Scene, np.random.Generator], Image]


@dataclass(frozen=True, slots=True, eq=False)
class Disturbance:
    """One way to disturb images, such as noise or a sticker on the wall.

    Attributes:
        name: as printed; the seed of its random numbers too.
        operation: changes an image.
        on_still: the image of the liquid at rest is disturbed as well.
        told_roll: roll of the camera that the calibration is told [rad].
    """

    name: str
    operation: Operation
    on_still: bool
    told_roll: float = 0.0

    def __call__(
        self, image: Image, sequence: RenderedSequence, truth: FrameTruth | None
    ) -> Image:
        """Returns the disturbed image."""
        if truth is None and not self.on_still:
            return image
        index = 0 if truth is None else truth.index + 1
        random = np.random.default_rng([zlib.crc32(self.name.encode()), index])
        return self.operation(image, Scene(sequence.calibration.view, truth), random)

    def calibration(self, calibration: Calibration) -> Calibration:
        """Returns the calibration that the detector gets for the disturbed images."""
        if not self.told_roll:
            return calibration
        view = calibration.view
        turn = np.eye(3)
        turn[:2, :2] = _rotation(self.told_roll)
        pose = Pose(turn @ view.pose.rotation, turn @ view.pose.translation)
        turned = CupView(view.camera, pose, view.cup)
        return Calibration(
            turned,
            calibration.camera_name,
            calibration.region,
            calibration.detection,
            calibration.still_image,
        )


def _same(image: Image, scene: Scene, random: np.random.Generator) -> Image:
    return image


UNDISTURBED = Disturbance("undisturbed", _same, on_still=False)


def all_disturbances() -> list[Disturbance]:
    """Returns all disturbances of the robustness table, in its order."""
    light = [Disturbance(f"brightness x{f:g}", _brightness(f), False) for f in (0.4, 0.7, 1.4, 2)]
    noise = [Disturbance(f"noise, sigma {s}", _noise(s), True) for s in (5, 10)]
    blur = [Disturbance(f"blur, sigma {s:g} px", _blur(s), True) for s in (1.5, 3)]
    motion = [Disturbance(f"motion blur, {n} px", _motion_blur(n), False) for n in (7, 15)]
    patch = [Disturbance(f"{p} % of the line hidden", _patch(p / 100), False) for p in (10, 20)]
    jpeg = [Disturbance(f"JPEG {q}", _jpeg(q), True) for q in (40, 20)]
    return [
        *light,
        *noise,
        *blur,
        *motion,
        *patch,
        Disturbance("label over the still line", _label, True),
        Disturbance("roll 2°, calibrated", _roll(ROLL), True, ROLL),
        Disturbance("roll 2°, not calibrated", _roll(ROLL), True),
        Disturbance("roll 2° after the still image", _roll(ROLL), False),
        *jpeg,
        Disturbance("uneven light, 0.6 to 1.2", _uneven, True),
        Disturbance("salt and pepper, 1 %", _salt_and_pepper, True),
        Disturbance("grey", _grey, True),
        Disturbance("highlights", _highlights, False),
    ]


def _brightness(factor: float) -> Operation:
    def operation(image: Image, scene: Scene, random: np.random.Generator) -> Image:
        return _clipped(factor * image.astype(np.float64))

    return operation


def _noise(sigma: float) -> Operation:
    def operation(image: Image, scene: Scene, random: np.random.Generator) -> Image:
        return _clipped(image + random.normal(0.0, sigma, image.shape))

    return operation


def _blur(sigma: float) -> Operation:
    def operation(image: Image, scene: Scene, random: np.random.Generator) -> Image:
        return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), dtype=np.uint8)

    return operation


def _motion_blur(length: int) -> Operation:
    """Returns a disturbance that blurs the image horizontally over a length [px]."""
    kernel = np.full((1, length), 1.0 / length)

    def operation(image: Image, scene: Scene, random: np.random.Generator) -> Image:
        blurred = cv2.filter2D(image, -1, kernel, borderType=cv2.BORDER_REPLICATE)
        return np.asarray(blurred, dtype=np.uint8)

    return operation


def _patch(share: float) -> Operation:
    """Returns a disturbance that covers a share of the visible wall line's columns."""

    def operation(image: Image, scene: Scene, random: np.random.Generator) -> Image:
        line = scene.line(np.linspace(-np.pi, np.pi, 1441))
        left, right = line[:, 0].min(), line[:, 0].max()
        width = share * (right - left)
        start = left + random.uniform() * (right - left - width)
        hidden = line[(line[:, 0] >= start) & (line[:, 0] <= start + width), 1]
        corners = np.array(
            [
                [start, hidden.min() - _BEYOND_LINE],
                [start + width, hidden.max() + _BEYOND_LINE],
            ]
        )
        colour = [int(value) for value in random.integers(0, 256, 3)]
        return _filled(image, _rectangle(corners), colour)

    return operation


def _label(image: Image, scene: Scene, random: np.random.Generator) -> Image:
    """Draws a white sticker on the wall, a third of the way to its right edge."""
    middle = scene.view.camera_azimuth + math.radians(25.0)
    width, height = _LABEL_HALF_WIDTH, _LABEL_HALF_HEIGHT
    across = np.linspace(middle - width, middle + width, 41)
    azimuth = np.concatenate((across, across[::-1]))
    level = np.concatenate((np.full(41, height), np.full(41, -height)))
    return _filled(image, scene.view.project_wall(azimuth, level), [225, 228, 230])


def _roll(angle: float) -> Operation:
    """Returns a disturbance that rolls the camera about its optical axis by an angle."""

    def operation(image: Image, scene: Scene, random: np.random.Generator) -> Image:
        size = image.shape[1], image.shape[0]
        turned = cv2.warpAffine(
            image,
            roll_matrix(scene.view.camera, angle),
            size,
            flags=cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REPLICATE,
        )
        return np.asarray(turned, dtype=np.uint8)

    return operation


def roll_matrix(camera: PinholeCamera, angle: float) -> FloatArray:
    """Returns the matrix (2, 3) that maps pixels when the camera rolls, K Rz K⁻¹."""
    matrix = camera.matrix
    turn = np.eye(3)
    turn[:2, :2] = _rotation(angle)
    return np.asarray((matrix @ turn @ np.linalg.inv(matrix))[:2])


def _jpeg(quality: int) -> Operation:
    def operation(image: Image, scene: Scene, random: np.random.Generator) -> Image:
        _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
        return np.asarray(cv2.imdecode(coded, cv2.IMREAD_UNCHANGED), dtype=np.uint8)

    return operation


def _uneven(image: Image, scene: Scene, random: np.random.Generator) -> Image:
    """Changes the brightness across the container from 0.6 to 1.2 times."""
    line = scene.line(np.linspace(-np.pi, np.pi, 181))
    ends = [line[:, 0].min(), line[:, 0].max()]
    gain = np.interp(np.arange(image.shape[1]), ends, [0.6, 1.2])
    return _clipped(image * gain.reshape(1, -1, *[1] * (image.ndim - 2)))


def _salt_and_pepper(image: Image, scene: Scene, random: np.random.Generator) -> Image:
    changed = image.copy()
    places = random.uniform(size=image.shape[:2])
    changed[places < 0.005] = 0
    changed[places > 0.995] = 255
    return changed


def _grey(image: Image, scene: Scene, random: np.random.Generator) -> Image:
    """Removes the colour of an image; three equal channels remain."""
    if image.ndim == 2:
        return image
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), dtype=np.uint8)


def _highlights(image: Image, scene: Scene, random: np.random.Generator) -> Image:
    """Draws three soft white spots on or near the wall line."""
    line = scene.line(np.linspace(-np.pi, np.pi, 361))
    v, u = np.mgrid[: image.shape[0], : image.shape[1]]
    light = np.zeros(image.shape[:2])
    for centre in line[random.integers(0, len(line), 3)] + random.normal(0.0, 10.0, (3, 2)):
        width, height = random.uniform(3.0, 7.0, 2)
        light += 300.0 * np.exp(
            -0.5 * ((u - centre[0]) / width) ** 2 - 0.5 * ((v - centre[1]) / height) ** 2
        )
    return _clipped(image + light.reshape(*light.shape, *[1] * (image.ndim - 2)))


def _rotation(angle: float) -> FloatArray:
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]])


def _rectangle(corners: FloatArray) -> FloatArray:
    (left, top), (right, bottom) = corners
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])


def _filled(image: Image, outline: FloatArray, colour: list[int]) -> Image:
    changed = image.copy()
    fill = colour if image.ndim == 3 else colour[:1]
    cv2.fillPoly(changed, [np.rint(outline).astype(np.int32)], fill)
    return changed


def _clipped(values: FloatArray) -> Image:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)
