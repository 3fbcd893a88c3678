"""Which pixels of the region are liquid, free surface or background (TM20, Fig. 3).

A column is read from below: liquid behind the front wall up to the front line, then, where the
liquid stands higher behind, the free surface itself up to the rear line, then background. The
grey levels passed in are such that liquid is darker than background.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.region import Region
from slosh_camera.settings import DetectionSettings

GrayImage = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]

# Level between liquid and background up to which a pixel is not background: nearer to the
# background, since the free surface reflects it.
_SURFACE_FRACTION = 0.65
_MIN_COVERED = 0.5
_BODY_PERCENTILE = 70.0


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """Grey levels of one image.

    Attributes:
        liquid: median of the liquid.
        background: median of what is brighter than the threshold.
        line_threshold: level between background and what is not.
        column_liquid: (columns,) level of the liquid by column.
        noise: standard deviation of one pixel in the liquid.
    """

    liquid: float
    background: float
    line_threshold: float
    column_liquid: FloatArray
    noise: float


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Lines of one image, by column; rows are counted from the region's top.

    Attributes:
        found: (columns,) whether the column holds liquid.
        upper: (columns,) first row that is not background.
        front: (columns,) first row of the liquid behind the front wall.
    """

    found: BoolArray
    upper: IntArray
    front: IntArray


def find_levels(gray: GrayImage, region: Region, settings: DetectionSettings) -> Levels | None:
    """Grey levels of liquid and background.

    Args:
        gray: (rows, columns) of the region, blurred.
        region: the region.
        settings: the detector's settings.

    Returns:
        The levels; None where the place that is always wet is not darker than the rest.
    """
    body = np.take_along_axis(gray, region.body_rows, axis=0).astype(np.float64)
    # The container's dark floor shines through low down, a deep trough lets light in high up:
    # between the two is the liquid, nearer to the brighter end.
    column_liquid = np.percentile(body, _BODY_PERCENTILE, axis=0)
    # The darker columns: before a high rear crest half of them show little but free surface.
    liquid = float(np.percentile(column_liquid, 25.0))
    threshold = settings.threshold
    if threshold is None:
        threshold = float(cv2.threshold(gray, 0, 255, cv2.THRESH_OTSU)[0])
    bright = gray[gray > threshold]
    if bright.size == 0 or liquid > threshold:
        return None
    background = float(np.median(bright))
    if background - liquid < settings.min_contrast:
        return None
    line_threshold = threshold
    if settings.threshold is None:
        line_threshold = max(threshold, liquid + _SURFACE_FRACTION * (background - liquid))
    # A deep trough in front of a high rear crest leaves little liquid in the middle columns: there
    # the free surface must not pass for it.
    margin = settings.surface_contrast * (background - liquid)
    column_liquid = np.minimum(column_liquid, liquid + margin)
    noise = float(np.median(np.abs(np.diff(body, axis=1)))) / (0.6745 * np.sqrt(2.0))
    return Levels(liquid, background, line_threshold, column_liquid, noise)


def find_lines(
    gray: GrayImage, region: Region, levels: Levels, settings: DetectionSettings
) -> Lines | None:
    """Upper and front line of the liquid by column.

    Args:
        gray: (rows, columns) of the region, blurred.
        region: the region.
        levels: grey levels of this image.
        settings: the detector's settings.

    Returns:
        The lines; None where no connected liquid stands over the container's floor.
    """
    wet = cv2.threshold(gray, levels.line_threshold, 255, cv2.THRESH_BINARY_INV)[1]
    wet = cv2.morphologyEx(wet, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels = cv2.connectedComponents(wet, connectivity=4)
    column = np.arange(gray.shape[1])
    seeds = labels[region.seed_rows, column]
    counts = np.bincount(seeds)
    counts[0] = 0
    label = int(np.argmax(counts))
    if counts[label] < _MIN_COVERED * seeds.size:
        return None
    liquid = labels == label
    found = seeds == label
    upper = np.argmax(liquid, axis=0)
    margin = settings.surface_contrast * (levels.background - levels.liquid)
    body = gray <= levels.column_liquid + margin
    body |= np.arange(gray.shape[0])[:, np.newaxis] >= region.seed_rows
    front = gray.shape[0] - np.argmin(body[::-1], axis=0)
    front[np.all(body, axis=0)] = 0
    return Lines(found, upper, np.maximum(front, upper))
