"""Projects colours on an axis in colour space: 0 is liquid at the front wall, 1 background.

Colour images are reduced to the axis along which the two differ most against their scatter
(Fisher's linear discriminant), so that liquid may be darker, lighter or of another colour. The
axis is found in every image anew: a change of the light's brightness changes nothing.

A clear liquid shows what is behind it: the table before which its lower half is seen is also seen
to the left and to the right. A line between the two colours may then be an edge of the background,
wherever the free surface is. Through the empty glass above the liquid the same is seen: what ends
above a surface may be as dark as what is beside the container, and is background all the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba.types import boolean, float32, float64, int64
from numpy.typing import NDArray

from slosh_base.compiled.compilation import GIVEN_3, entry_point, given
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


# Places beside the outermost scan lines, beyond the wall, in widths of the container.
_BESIDE = np.linspace(0.1, 0.25, 12)
# Of these places three tell what is behind the container.
_FEW = 5


def looks_like_surroundings(image: Image, pixels: FloatArray, tone: Tone) -> bool:
    """Whether the liquid has the colour of the surroundings on both sides of the container.

    Args:
        image: (height, width) or (height, width, C).
        pixels: (J, M, 2) places on scan lines that show liquid, from left to right.

    Returns:
        Whether it has; not where too little beside the container is in the image.
    """
    return all(_is_alike(image, side, tone) for side in _sides(pixels))


class Backdrop:
    """Expected background above the liquid, interpolated from both sides of the container."""

    def __init__(self, pixels: FloatArray, size: tuple[int, int]) -> None:
        """Stores the image positions to the left and right of the container.

        What is far behind goes on straight across the container, in pixels; a row of the scan
        lines, which is a height on the front wall, does not.

        Args:
            pixels: (J, M, 2) places on the scan lines, from left to right.
            size: width and height of the images.
        """
        across = np.mean(pixels[:, -1] - pixels[:, 0], axis=0)
        width = float(np.hypot(*across))
        along = across / width
        down = np.array([-along[1], along[0]])
        depth, place = pixels @ down, pixels @ along
        first = int(np.floor(np.min(depth)))
        levels = np.arange(first, int(np.ceil(np.max(depth))) + 1)
        ends = [_place_at(levels, depth[:, line], place[:, line]) for line in (0, -1)]
        out = width * _BESIDE[::_FEW]
        beside = np.stack((ends[0][:, None] - out, ends[1][:, None] + out), axis=1)
        places = np.rint(beside[..., None] * along + levels[:, None, None, None] * down)
        self._columns, self._rows = np.moveaxis(places.astype(np.int64), -1, 0)
        inside = (self._columns >= 0) & (self._columns < size[0])
        inside &= (self._rows >= 0) & (self._rows < size[1])
        self._seen = np.mean(inside, axis=2) >= TUNING.least_beside
        np.clip(self._columns, 0, size[0] - 1, out=self._columns)
        np.clip(self._rows, 0, size[1] - 1, out=self._rows)
        self._level = np.rint(depth).astype(np.int64) - first
        left, right = (end[self._level] for end in ends)
        share = (place - left) / np.maximum(right - left, 1.0)
        self._share = np.clip(share, 0.0, 1.0).astype(np.float32)

    def reduced(self, image: Image, tone: Tone) -> Single:
        """Returns the expected background of the wall on the colour axis; 1 where unknown."""
        seen = image[self._rows, self._columns].reshape(*self._rows.shape, -1)
        level = _middle(seen @ tone.axis, float(tone.axis @ tone.liquid), self._seen)
        level = cv2.erode(level, np.ones((2 * TUNING.bent_rows + 1, 1), np.uint8))
        return np.asarray(_across(level, self._level, self._share))


@entry_point(float32[:, ::1](GIVEN_3, float64, given(boolean, 2)))
def _middle(seen, liquid, known):  # type: ignore[no-untyped-def]
    """Returns the median background levels beside the container, left and right, at most 1.

    1 where nothing is known.
    """
    level = np.ones(known.shape, np.float32)
    for j in range(known.shape[0]):
        for side in range(known.shape[1]):
            a, b, c = seen[j, side, 0], seen[j, side, 1], seen[j, side, 2]
            if known[j, side]:
                level[j, side] = min(max(min(a, b), min(max(a, b), c)) - liquid, 1.0)
    return level


@entry_point(float32[:, ::1](given(float32, 2), given(int64, 2), given(float32, 2)))
def _across(ends, level, share):  # type: ignore[no-untyped-def]
    """Interpolates image values of the unrolled wall between left and right surroundings."""
    rows, lines = level.shape
    values = np.empty((rows, lines), np.float32)
    for j in range(rows):
        for i in range(lines):
            left, right = ends[level[j, i], 0], ends[level[j, i], 1]
            values[j, i] = left + (right - left) * share[j, i]
    return values


def _place_at(levels: NDArray[np.int64], depth: FloatArray, place: FloatArray) -> FloatArray:
    """Interpolates image positions over depth, constant beyond the ends of the table."""
    order = np.argsort(depth)
    return np.interp(levels, depth[order], place[order])


def _sides(pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns image positions to the left and right of the outermost scan lines."""
    across = (pixels[:, -1] - pixels[:, 0])[:, np.newaxis]
    out = _BESIDE[:, np.newaxis] * across
    return pixels[:, :1] - out, pixels[:, -1:] + out


def _is_alike(image: Image, places: FloatArray, tone: Tone) -> bool:
    """Whether most of the image at the given positions has the liquid's colour."""
    columns, rows = np.rint(places[..., 0]).astype(int), np.rint(places[..., 1]).astype(int)
    height, width = image.shape[:2]
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    if np.mean(inside) < TUNING.least_beside:
        return False
    seen = image[rows[inside], columns[inside]]
    colour = percentile(seen.reshape(len(seen), -1), 50.0)
    return float(np.max(np.abs(colour - tone.liquid))) < TUNING.colours_alike * tone.contrast


ROBUST = 1.4826
"""Standard deviation over the median deviation of a normal distribution."""


@entry_point(float64(given(float64, 1, "A")))
def median(values):  # type: ignore[no-untyped-def]
    """Returns the median of (N,) numbers; NaN if any is NaN or there are none."""
    half = values.size // 2
    for value in values:
        if np.isnan(value):
            return np.nan
    if not values.size:
        return np.nan
    ordered = np.partition(values, half)
    if values.size % 2:
        return ordered[half]
    return 0.5 * (np.max(ordered[:half]) + ordered[half])
