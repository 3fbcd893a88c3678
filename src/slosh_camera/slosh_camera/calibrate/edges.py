"""Edges of an image: maps of edge strength, and sub-pixel edge positions along curves."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.tuning import TUNING

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Image = NDArray[np.uint8]

_STEP = 0.5
# Peak derivative of a unit step after the smoothing.
_STEP_TO_SLOPE = 1.0 / (np.sqrt(2.0 * np.pi) * TUNING.smoothing)


@dataclass(frozen=True, slots=True, eq=False)
class EdgeImage:
    """A smoothed image with its derivatives along rows and columns.

    Attributes:
        smooth: (H, W, channels) smoothed image [grey levels].
        across: (H, W) derivative along a row in the channel where it is largest [levels/px].
        down: (H, W) derivative along a column in the channel where it is largest [levels/px].
        reference: slope at which an edge counts half [levels/px]; above the image's noise.
    """

    smooth: Float32Array
    across: Float32Array
    down: Float32Array
    reference: float

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns of the image."""
        return int(self.smooth.shape[0]), int(self.smooth.shape[1])

    def support(self, slope: NDArray[np.floating]) -> FloatArray:
        """Converts image slopes [grey levels/px] to edge strengths from 0 (no edge) to 1."""
        size = np.abs(np.asarray(slope, dtype=np.float64))
        return size / (size + self.reference)


def edge_image(image: Image) -> EdgeImage:
    """Smooths and differentiates an 8-bit image, grey or blue-green-red."""
    levels = image.astype(np.float32)
    blurred = cv2.GaussianBlur(levels, (0, 0), TUNING.smoothing).reshape(*image.shape[:2], -1)
    smooth = np.asarray(blurred, np.float32)
    across, down = (
        _strongest(
            np.asarray(cv2.Scharr(smooth, cv2.CV_32F, *along, scale=1.0 / 32.0), np.float32)
        )
        for along in ((1, 0), (0, 1))
    )
    noise = float(np.median(np.hypot(across, down)))
    reference = max(TUNING.half_edge * _STEP_TO_SLOPE, 4.0 * noise)
    return EdgeImage(smooth, across, down, reference)


def _strongest(slopes: Float32Array) -> Float32Array:
    """Returns, per pixel, the derivative of the channel where it is largest, with its sign."""
    if slopes.ndim == 2 or slopes.shape[2] == 1:
        return slopes.reshape(slopes.shape[:2])
    index = np.argmax(np.abs(slopes), axis=2)[..., np.newaxis]
    strongest: Float32Array = np.take_along_axis(slopes, index, axis=2)[..., 0]
    return strongest


@dataclass(frozen=True, slots=True, eq=False)
class FoundEdges:
    """Edges detected near the sample points of a curve, one per point.

    Attributes:
        pixels: (N, 2) sub-pixel positions; NaN where no edge stands out.
        slope: (N,) strength [levels/px]; 0 where none.
    """

    pixels: FloatArray
    slope: FloatArray


def find_edges(
    edges: EdgeImage, points: FloatArray, normals: FloatArray, reach: float, *, outermost: bool
) -> FoundEdges:
    """Detects edges with sub-pixel precision along normals of a curve.

    Args:
        edges: the image.
        points: (N, 2) where edges are expected [px].
        normals: (N, 2) unit vectors along which to look.
        reach: how far to look to both sides [px].
        outermost: take the edge farthest along the normal of those that are not much weaker
            than the strongest (a glass wall has an outer and an inner edge); otherwise the
            strongest, near ones before far ones.

    Returns:
        One edge per point.
    """
    if len(points) == 0:
        return FoundEdges(np.empty((0, 2)), np.empty(0))
    offsets = np.arange(-reach - 2.0 * _STEP, reach + 2.5 * _STEP, _STEP)
    along = points[:, np.newaxis, :] + offsets[:, np.newaxis] * normals[:, np.newaxis, :]
    slope = _slopes(edges, along)
    peak = np.zeros(slope.shape, dtype=bool)
    peak[:, 1:-1] = (slope[:, 1:-1] >= slope[:, :-2]) & (slope[:, 1:-1] > slope[:, 2:])
    peak &= slope > 0.5 * edges.reference
    strength = np.where(peak, slope, 0.0)
    if outermost:
        strong = strength >= 0.4 * strength.max(axis=1, keepdims=True)
        strong &= strength > 0.0
        chosen = strong.shape[1] - 1 - np.argmax(strong[:, ::-1], axis=1)
    else:
        chosen = np.argmax(strength * (1.0 - 0.5 * np.abs(offsets) / (reach + 1.0)), axis=1)
    rows = np.arange(len(points))
    found = strength[rows, chosen]
    inner = np.clip(chosen, 1, len(offsets) - 2)
    below, top, above = (slope[rows, inner + shift] for shift in (-1, 0, 1))
    curvature = below - 2.0 * top + above
    shift = np.where(curvature < 0.0, 0.5 * (below - above) / np.minimum(curvature, -1e-9), 0.0)
    place = offsets[inner] + _STEP * np.clip(shift, -1.0, 1.0)
    pixels = points + place[:, np.newaxis] * normals
    pixels[found <= 0.0] = np.nan
    return FoundEdges(pixels, found)


def _slopes(edges: EdgeImage, along: FloatArray) -> FloatArray:
    """Returns the image derivative along point rows (N, M, 2) [levels/px]; 0 outside the image."""
    rows, columns = edges.shape
    inside = np.all(np.isfinite(along), axis=2)
    inside &= (along[..., 0] >= 1.0) & (along[..., 0] <= columns - 2.0)
    inside &= (along[..., 1] >= 1.0) & (along[..., 1] <= rows - 2.0)
    where = np.where(inside[..., np.newaxis], along, -1.0).astype(np.float32)
    # OpenCV's types do not know that one map may hold both coordinates.
    strips = cv2.remap(  # type: ignore[call-overload]
        edges.smooth, where, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    values = strips.reshape(*along.shape[:2], -1).astype(np.float64)
    slope = np.zeros(along.shape[:2])
    change = (values[:, 2:] - values[:, :-2]) / (2.0 * _STEP)
    whole = inside[:, 2:] & inside[:, 1:-1] & inside[:, :-2]
    slope[:, 1:-1] = np.where(whole, np.linalg.norm(change, axis=2), 0.0)
    return slope
