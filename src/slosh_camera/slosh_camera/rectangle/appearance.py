"""Brightness of liquid and background in a side view, and the classification of pixels.

Grey or colour is first turned into one channel in which the two differ most. An image alone shows
them where the face is nearly always wet and nearly always dry; an image of the liquid at rest
shows them everywhere, and which places show neither (stickers, marks).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.rectangle.region import RegionPlaces, SideRegion
from slosh_camera.rectangle.tuning import TUNING

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

# Levels of liquid and background in the channel made of colours; the rest is room for shades.
_LIQUID_LEVEL, _BACKGROUND_LEVEL = 80.0, 176.0
_ROBUST_STEPS = 4
_GROW = np.ones((3, 3), np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """Grey levels and noise of liquid and background in one colour channel.

    Attributes:
        wet: median where the face is nearly always wet.
        dry: median where it is nearly always dry.
        noise: standard deviation of one pixel.
    """

    wet: float
    dry: float
    noise: float

    @property
    def contrast(self) -> float:
        """Grey-level difference of background minus liquid."""
        return self.dry - self.wet


@dataclass(frozen=True, slots=True, eq=False)
class Appearance:
    """Grey levels of liquid and background at each position, at half resolution.

    Attributes:
        weights: (3,) of blue, green and red, and a constant, or None for grey images.
        levels: of the image it was learnt from.
        middle: level half-way between liquid and background; (rows, columns) or (1, columns).
        half: half of their difference; 0 where neither is seen.
        foreign: (rows, columns) of the region where neither is seen, or None.
    """

    weights: FloatArray | None
    levels: Levels
    middle: Single
    half: Single
    foreign: BoolArray | None = None


def brightness(part: Image, region: SideRegion) -> tuple[float, float]:
    """Returns the lower and the higher of the liquid's and the background's grey level.

    Args:
        part: (rows, columns) or (rows, columns, 3) of the region.

    Returns:
        Medians where the face is nearly always wet or dry, mean of the colours.
    """
    wet, dry = _typical(part, region)
    levels = float(np.mean(wet)), float(np.mean(dry))
    return min(levels), max(levels)


def brightest(part: Image, region: SideRegion) -> float:
    """Returns the higher of the liquid's and the background's grey level, over all channels."""
    return float(max(np.max(levels) for levels in _typical(part, region)))


def raw_contrast(part: Image, region: SideRegion) -> float:
    """Returns the largest contrast of liquid and background in any channel [grey levels]."""
    wet, dry = _typical(part, region)
    return float(np.max(np.abs(dry - wet)))


def colour_weights(part: Image, region: SideRegion) -> FloatArray | None:
    """Returns weights (1, 4) of blue, green, red and 1 that best separate liquid and background.

    Args:
        part: (rows, columns) or (rows, columns, 3) of the region.

    Returns:
        Fisher's linear discriminant of the two sets of samples; None for grey images.
    """
    if part.ndim == 2:
        return None
    wet, dry = (_at(part, samples).reshape(-1, 3) for samples in (region.wet, region.dry))
    centre_wet, centre_dry = np.median(wet, axis=0), np.median(dry, axis=0)
    scatter = np.zeros((3, 3))
    for values, centre in ((wet, centre_wet), (dry, centre_dry)):
        away = values - centre
        near = away[np.abs(away).sum(axis=1) <= np.median(np.abs(away).sum(axis=1))]
        scatter += near.T @ near / max(len(near), 1)
    difference = centre_dry - centre_wet
    direction = np.linalg.solve(scatter + TUNING.colour_noise**2 * np.eye(3), difference)
    span = float(direction @ difference)
    if span <= 0.0:
        direction, span = np.full(3, 1.0 / 3.0), _BACKGROUND_LEVEL - _LIQUID_LEVEL
    direction *= (_BACKGROUND_LEVEL - _LIQUID_LEVEL) / span
    constant = _LIQUID_LEVEL - float(direction @ centre_wet)
    return np.append(direction, constant)[np.newaxis]


def one_channel(part: Image, weights: FloatArray | None) -> Image:
    """Combines an image region's colour channels to one channel, (rows, columns)."""
    return part if weights is None else np.asarray(cv2.transform(part, weights), dtype=np.uint8)


def measure_levels(channel: Image, region: SideRegion) -> Levels:
    """Measures the grey levels of image areas that are nearly always wet or dry."""
    wet, dry = (_at(channel, samples) for samples in (region.wet, region.dry))
    # Samples of one column are some rows apart: what they differ by is noise and texture.
    steps = np.concatenate((np.diff(wet, axis=0).ravel(), np.diff(dry, axis=0).ravel()))
    noise = float(np.median(np.abs(steps))) * 1.4826 / np.sqrt(2.0)
    return Levels(float(np.median(wet)), float(np.median(dry)), noise)


def seen_appearance(channel: Image, region: SideRegion, weights: FloatArray | None) -> Appearance:
    """Estimates grey levels of liquid and background per column from a single image.

    Args:
        channel: (rows, columns) of the region.

    Returns:
        The appearance; foreign things are not known.
    """
    levels = measure_levels(channel, region)
    columns = np.arange(0.5, region.inside.shape[1], 2.0)
    wet, dry = (
        _smooth(samples.columns[0], np.median(_at(channel, samples), axis=0), columns)
        for samples in (region.wet, region.dry)
    )
    middle = (0.5 * (wet + dry)).astype(np.float32)[np.newaxis]
    half = (0.5 * (dry - wet)).astype(np.float32)[np.newaxis]
    # A column where the two meet says nothing; its sign must not turn round.
    return Appearance(weights, levels, middle, _same_sign(half, levels.contrast))


def learnt_appearance(
    channel: Image, region: SideRegion, weights: FloatArray | None, line: FloatArray
) -> Appearance:
    """Estimates grey levels of liquid and background from an image of the liquid at rest.

    Args:
        channel: (rows, columns) of the region.
        line: (columns,) rows of the still line.

    Returns:
        The appearance, with the places that show neither liquid nor background.
    """
    levels = measure_levels(channel, region)
    small = half_size(channel).astype(np.float32)
    rows = np.arange(small.shape[0])[:, np.newaxis]
    still = 0.5 * line[np.newaxis, ::2][:, : small.shape[1]]
    inside = region.inside[::2, ::2]
    above = inside & (rows < still - TUNING.mixed_rows)
    below = inside & (rows > still + TUNING.mixed_rows)
    dry, odd_dry = _spread(small, above, abs(levels.contrast))
    wet, odd_wet = _spread(small, below, abs(levels.contrast))
    odd = cv2.dilate((odd_dry | odd_wet).astype(np.uint8), _GROW) > 0
    half = np.where(odd, np.float32(0.0), _same_sign(0.5 * (dry - wet), levels.contrast))
    shape = (region.inside.shape[1], region.inside.shape[0])
    foreign = cv2.resize(odd.astype(np.uint8), shape, interpolation=cv2.INTER_NEAREST) > 0
    return Appearance(weights, levels, 0.5 * (dry + wet), half, foreign)


def evidence(small: Image, appearance: Appearance, levels: Levels) -> Single:
    """Classifies each pixel on a scale from -1 (liquid) to 1 (background).

    Args:
        small: (rows, columns) channel of half the size.
        levels: of this image; light that changed since scales the appearance.

    Returns:
        (rows, columns) in [-1, 1]; 0 where neither is seen.
    """
    gain = levels.contrast / appearance.levels.contrast
    offset = levels.wet - gain * appearance.levels.wet
    middle = np.float32(gain) * appearance.middle + np.float32(offset)
    half = appearance.half
    scale = np.divide(1.0, np.float32(gain) * half, out=np.zeros_like(half), where=half != 0.0)
    result: Single = (small.astype(np.float32) - middle) * scale
    return np.clip(result, -1.0, 1.0, out=result)


def half_size(channel: Image) -> Image:
    """Returns an image channel at half resolution; each pixel is the mean of four."""
    rows, columns = channel.shape
    size = (columns // 2, rows // 2)
    return np.asarray(cv2.resize(channel, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _typical(part: Image, region: SideRegion) -> tuple[FloatArray, FloatArray]:
    """Returns median colours of image areas nearly always wet, and of areas nearly always dry."""
    wet, dry = (
        np.atleast_1d(np.median(_at(part, samples), axis=(0, 1)))
        for samples in (region.wet, region.dry)
    )
    return wet, dry


def _at(image: Image, samples: RegionPlaces) -> FloatArray:
    return image[samples.rows, samples.columns].astype(np.float64)


def _smooth(places: NDArray[np.intp], values: FloatArray, columns: FloatArray) -> FloatArray:
    """Fits a parabola over the columns, robust against outliers."""
    centre, scale = 0.5 * float(places[0] + places[-1]), 0.5 * float(np.ptp(places)) + 1.0
    powers = ((places - centre) / scale)[:, np.newaxis] ** np.arange(3)
    weight = np.ones(values.size)
    coefficients: FloatArray = np.zeros(3)
    residual: FloatArray = np.asarray(values - np.median(values), dtype=np.float64)
    for _ in range(_ROBUST_STEPS):
        width = 3.0 * float(np.median(np.abs(residual))) + 1.0
        weight = 1.0 / (1.0 + (residual / width) ** 2) ** 2
        weighted = powers * weight[:, np.newaxis]
        normal = weighted.T @ powers + 1e-9 * np.eye(3)
        solved = np.linalg.solve(normal, weighted.T @ values)
        coefficients = np.asarray(solved, dtype=np.float64)
        residual = values - np.asarray(powers @ coefficients, dtype=np.float64)
    at = ((columns - centre) / scale)[:, np.newaxis] ** np.arange(3)
    return np.asarray(at @ coefficients, dtype=np.float64)


def _spread(small: Single, where: BoolArray, contrast: float) -> tuple[Single, BoolArray]:
    """Extrapolates grey levels of liquid or background over the image; returns an outlier mask.

    Seen places keep their own level; elsewhere a surface is laid through them, straight in the
    rows and a parabola over the columns.
    """
    rows, columns = small.shape
    y, x = np.linspace(-1.0, 1.0, rows), np.linspace(-1.0, 1.0, columns)
    picked = np.flatnonzero(where)[:: max(1, np.count_nonzero(where) // 4000)]
    py, px = y[picked // columns], x[picked % columns]
    functions = np.column_stack((np.ones(picked.size), px, px * px, py))
    values = small.ravel()[picked].astype(np.float64)
    residual = values - np.median(values)
    coefficients = np.zeros(4)
    for _ in range(2 * _ROBUST_STEPS):
        width = 3.0 * float(np.median(np.abs(residual))) + 1.0
        weighted = functions / (1.0 + (residual / width) ** 2)[:, np.newaxis] ** 2
        normal = weighted.T @ functions + 1e-9 * np.eye(4)
        coefficients = np.linalg.solve(normal, weighted.T @ values)
        residual = values - functions @ coefficients
    low, high = np.percentile(functions @ coefficients, (0.0, 100.0))
    across = coefficients[0] + x * (coefficients[1] + x * coefficients[2])
    surface = np.clip(across[np.newaxis] + coefficients[3] * y[:, np.newaxis], low, high)
    laid = surface.astype(np.float32)
    odd = where & (np.abs(small - laid) > TUNING.foreign * contrast)
    return np.where(where & ~odd, small, laid), odd


def _same_sign(half: Single, contrast: float) -> Single:
    """Sets contrasts to 0 whose sign differs from the overall contrast's."""
    usable = half * np.sign(contrast) > 0.1 * abs(contrast)
    return np.where(usable, half, np.float32(0.0)).astype(np.float32)
