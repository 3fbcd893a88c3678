"""Projects colours on an axis in colour space: 0 is liquid at the front wall, 1 background.

Colour images are reduced to the axis along which the two differ most against their scatter
(Fisher's linear discriminant), so that liquid may be darker, lighter or of another colour. The
axis is found in every image anew: a change of the light's brightness changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.medians import ROBUST, median
from slosh_camera.cylinder.tuning import TUNING

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

# Every third line and row is enough for statistics.
_EVERY = 3
_GREY = np.arange(256, dtype=np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Tone:
    """The line in colour space from the liquid's colour to the background's.

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
        """Largest difference of background and liquid colour in any channel [grey levels]."""
        return float(np.max(np.abs(self.background - self.liquid)))

    def reduce(self, picture: Image) -> Single:
        """Projects each pixel of an image, grey or in colour, on the colour axis."""
        # Takes specks and noise away and leaves edges where they are.
        picture = np.asarray(cv2.medianBlur(picture, 3), dtype=np.uint8)
        weights = self.axis.astype(np.float32)
        offset = np.float32(self.axis @ self.liquid)
        if picture.ndim == 2:
            level = cv2.LUT(picture, _GREY * weights[0] - offset)
        else:
            # The offset goes with the sum, as a fourth channel that is 1.
            affine = np.append(weights, -offset)[np.newaxis]
            level = cv2.transform(picture.astype(np.float32), affine)
        return np.asarray(level, dtype=np.float32)


def find_tone(picture: Image, inside: BoolArray, body: slice, above: int) -> Tone | None:
    """Determines the colour axis from liquid to background in one image.

    Args:
        picture: (J, M) or (J, M, C) unrolled wall.
        inside: (J, M) whether the sample lies in the image.
        body: rows most samples of which show liquid.
        above: row above which most samples that are not liquid show background.

    Returns:
        The axis; None where nothing differs from the liquid.
    """
    wet = _samples(picture, inside, body)
    rest = _samples(picture, inside, slice(0, body.stop))
    if len(wet) < TUNING.least_samples or len(rest) < TUNING.least_samples:
        return None
    liquid = percentile(wet, 50.0)
    distance = _farthest(rest, liquid).astype(np.uint8)
    limit, _ = cv2.threshold(distance, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    dry = rest[distance > limit]
    if len(dry) < TUNING.least_samples:
        return None
    # Further down it may be the free surface.
    upper = _samples(picture, inside, slice(0, above))
    clear = upper[_farthest(upper, liquid) > limit]
    background = percentile(clear if len(clear) >= TUNING.least_samples else dry, 50.0)
    axis = _axis(wet, dry, liquid, background)
    if axis is None:
        return None
    part = picture[body, :: 4 * _EVERY].reshape(body.stop - body.start, -1, liquid.size)
    steps = np.diff(part.astype(np.float64) @ axis, axis=0)
    noise = ROBUST * float(median(np.abs(steps).ravel())) / np.sqrt(2.0)
    return Tone(liquid, background, axis, noise)


def _farthest(samples: Image, middle: FloatArray) -> FloatArray:
    """Returns each colour sample's largest deviation from a colour in any channel."""
    away = np.abs(samples - middle)
    return away[:, 0] if middle.size == 1 else np.max(away, axis=1)


def _axis(wet: Image, dry: Image, liquid: FloatArray, background: FloatArray) -> FloatArray | None:
    """Computes the linear discriminant between two sets of colour samples, one per channel."""
    difference = background - liquid
    axis: FloatArray = difference
    if difference.size > 1:
        usual = max(TUNING.rounding, TUNING.scatter * float(np.max(np.abs(difference))))
        within = _scatter(wet, liquid) + _scatter(dry, background)
        spread = within + usual**2 * np.eye(difference.size)
        axis = np.asarray(np.linalg.solve(spread, difference), dtype=np.float64)
    length = float(axis @ difference)
    return np.asarray(axis / length) if length > 0.0 else None


def percentile(samples: NDArray[np.uint8], percent: float) -> FloatArray:
    """Returns a percentile of grey levels for each channel, by counting instead of sorting."""
    counts = [np.bincount(channel, minlength=256) for channel in samples.T]
    rank = 0.01 * percent * len(samples)
    return np.array([np.searchsorted(np.cumsum(count), rank) for count in counts], np.float64)


def _samples(picture: Image, inside: BoolArray, rows: slice) -> Image:
    """Returns a subset of the colour samples in some rows of the unrolled wall, for statistics."""
    part = picture[rows][::_EVERY, ::_EVERY]
    return part[inside[rows][::_EVERY, ::_EVERY]].reshape(
        -1, 1 if picture.ndim == 2 else part.shape[2]
    )


def _scatter(samples: Image, middle: FloatArray) -> FloatArray:
    """Returns the covariance between the channels of colours, with outliers clipped."""
    deviation = samples - middle
    usual = percentile(np.abs(deviation).astype(np.uint8), 50.0)
    reach = 3.0 * ROBUST * usual + TUNING.rounding
    cut = np.clip(deviation, -reach, reach)
    return np.asarray(cut.T @ cut / len(cut))
