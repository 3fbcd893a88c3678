"""Liquid and background on one axis: 0 is liquid behind the front wall, 1 is background.

Colour images are reduced to the axis along which the two differ most against their scatter
(Fisher's linear discriminant), so that liquid may be darker, lighter or of another colour. The
axis is found in every image anew: a change of the light's brightness changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# Scatter that is always reckoned with, as a part of the contrast: the axis leaves the straight way
# from liquid to background only for good reason, so that shades of the liquid stay between them.
_SCATTER = 0.12
# Scatter by rounding and compression [grey levels].
_ROUNDING = 2.0
_LEAST_SAMPLES = 30
_ROBUST = 1.4826


@dataclass(frozen=True, slots=True, eq=False)
class Tone:
    """The axis from liquid to background.

    Attributes:
        liquid: (C,) colour of the liquid [grey levels].
        background: (C,) colour of the background [grey levels].
        axis: (C,) such that axis . (background - liquid) is 1.
        noise: standard deviation from sample to sample along the axis within the liquid.
    """

    liquid: FloatArray
    background: FloatArray
    axis: FloatArray
    noise: float

    @property
    def contrast(self) -> float:
        """Difference of background and liquid where it is largest [grey levels]."""
        return float(np.max(np.abs(self.background - self.liquid)))

    def reduce(self, picture: Image) -> FloatArray:
        """Put a picture (J, M) or (J, M, C) on the axis: (J, M)."""
        weights = self.axis.astype(np.float32)
        offset = np.float32(self.axis @ self.liquid)
        if picture.ndim == 2:
            level = picture.astype(np.float32) * weights[0]
        else:
            level = np.asarray(cv2.transform(picture.astype(np.float32), weights[np.newaxis]))
        # Neighbouring lines show the same edge; their mean has less noise.
        return np.asarray(cv2.blur(level - offset, (3, 1)), dtype=np.float64)


def find_tone(picture: Image, inside: BoolArray, body: slice) -> Tone | None:
    """The axis from liquid to background in one picture.

    Args:
        picture: (J, M) or (J, M, C) unrolled wall.
        inside: (J, M) whether the sample lies in the image.
        body: rows most samples of which show liquid.

    Returns:
        The axis; None where nothing differs from the liquid.
    """
    channels = 1 if picture.ndim == 2 else picture.shape[2]
    # Every second line is enough for statistics.
    samples = picture[:, ::2].reshape(len(picture), -1, channels).astype(np.float32)
    seen = inside[:, ::2]
    wet = samples[body][seen[body]]
    rest = samples[: body.stop][seen[: body.stop]]
    if len(wet) < _LEAST_SAMPLES or len(rest) < _LEAST_SAMPLES:
        return None
    liquid = np.median(wet, axis=0)
    distance = np.max(np.abs(rest - liquid), axis=1)
    limit, _ = cv2.threshold(
        distance.astype(np.uint8), 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU
    )
    dry = rest[distance > limit]
    if len(dry) < _LEAST_SAMPLES:
        return None
    background = np.median(dry, axis=0)
    within = _scatter(wet, liquid) + _scatter(dry, background)
    usual = max(_ROUNDING, _SCATTER * float(np.max(np.abs(background - liquid))))
    axis = np.linalg.solve(within + usual**2 * np.eye(channels), background - liquid)
    length = float(axis @ (background - liquid))
    if not length > 0.0:
        return None
    axis = np.asarray(axis / length, dtype=np.float64)
    steps = np.diff(samples[body].astype(np.float64) @ axis, axis=0)
    noise = _ROBUST * float(np.median(np.abs(steps))) / np.sqrt(2.0)
    return Tone(liquid.astype(np.float64), background.astype(np.float64), axis, noise)


def _scatter(samples: NDArray[np.float32], middle: NDArray[np.float32]) -> FloatArray:
    """Covariance (C, C) about the middle, far samples cut off at three median deviations."""
    deviation = samples - middle
    reach = 3.0 * _ROBUST * np.median(np.abs(deviation), axis=0) + _ROUNDING
    cut = np.clip(deviation, -reach, reach).astype(np.float64)
    return np.asarray(cut.T @ cut / len(cut))
