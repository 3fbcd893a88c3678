"""Edges of an image: maps of their strength, places along curves, and long upright lines."""

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
        points: (N, 2) where edges are expected [px].
        normals: (N, 2) unit vectors along which to look.
        reach: how far to look to both sides [px].
        outermost: take the edge farthest along the normal of those that are not much weaker
            than the strongest (a glass wall has an outer and an inner edge); otherwise the
            strongest, near ones before far ones.
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


_LEAN_STEP = 0.004
_MAX_PIXELS = 30_000


@dataclass(frozen=True, slots=True)
class UprightLine:
    """The nearly vertical line u = column + lean (v - middle row), and its strength.

    Attributes:
        column: u in the image's middle row [px].
        lean: du/dv.
        support: sum of the supports of its pixels, about the number of rows that show it.
        top: v of its first pixel.
        bottom: v of its last pixel.
    """

    column: float
    lean: float
    support: float
    top: float
    bottom: float


def upright_lines(edges: EdgeImage, count: int, least: float) -> list[UprightLine]:
    """Detects the strongest nearly vertical lines of an image by a Hough transform.

    Each line found takes its pixels with it, so that one thick edge gives one line.

    Args:
        count: at most so many lines.
        least: least support of a line [rows].

    Returns:
        Lines, the strongest first.
    """
    rows, columns = edges.shape
    u, v, weight, lean = _edge_pixels(edges)
    leans = np.arange(-TUNING.most_lean, TUNING.most_lean + 0.5 * _LEAN_STEP, _LEAN_STEP)
    margin = int(np.ceil(TUNING.most_lean * rows / 2.0)) + 2
    votes = np.zeros((leans.size, columns + 2 * margin))
    _vote(votes, leans, (u, v, weight, lean), margin)
    lines: list[UprightLine] = []
    for _ in range(4 * count):
        # Two neighbouring columns together: a line between them splits its votes.
        pairs = votes[:, :-1] + votes[:, 1:]
        index = int(np.argmax(pairs))
        row, column = divmod(index, pairs.shape[1])
        if pairs[row, column] < 0.5 * least or len(lines) == count:
            break
        fit = _refine(u, v, weight, (column + 0.5 - margin, float(leans[row])))
        near = np.abs(u - fit[0] - fit[1] * v) < TUNING.vote_reach
        near |= np.abs(u - (column + 0.5 - margin) - leans[row] * v) < TUNING.vote_reach
        taken = (u[near], v[near], -weight[near], lean[near])
        _vote(votes, leans, taken, margin)
        support = float(weight[near].sum())
        if support >= least:
            middle = 0.5 * (rows - 1)
            span = v[near] + middle
            lines.append(UprightLine(fit[0], fit[1], support, span.min(), span.max()))
        keep = ~near
        u, v, weight, lean = u[keep], v[keep], weight[keep], lean[keep]
    return sorted(lines, key=lambda line: -line.support)


def _edge_pixels(edges: EdgeImage) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Returns position, edge strength and inclination of all nearly vertical edge pixels."""
    across = edges.across.astype(np.float64)
    size = np.abs(across)
    steep = np.abs(edges.down) < (TUNING.most_lean + TUNING.lean_error) * size
    ridge = np.zeros(size.shape, dtype=bool)
    ridge[1:-1, 1:-1] = (size[1:-1, 1:-1] >= size[1:-1, :-2]) & (size[1:-1, 1:-1] > size[1:-1, 2:])
    rows, columns = np.nonzero(ridge & steep & (size > 0.5 * edges.reference))
    if rows.size > _MAX_PIXELS:
        strongest = np.argpartition(-size[rows, columns], _MAX_PIXELS)[:_MAX_PIXELS]
        rows, columns = rows[strongest], columns[strongest]
    left, here, right = (size[rows, columns + shift] for shift in (-1, 0, 1))
    shift = 0.5 * (left - right) / np.minimum(left - 2.0 * here + right, -1e-9)
    lean = -edges.down[rows, columns].astype(np.float64) / across[rows, columns]
    middle = 0.5 * (edges.shape[0] - 1)
    u = np.asarray(columns + np.clip(shift, -0.5, 0.5), dtype=np.float64)
    v = np.asarray(rows - middle, dtype=np.float64)
    return u, v, edges.support(here), lean


def _vote(
    votes: FloatArray,
    leans: FloatArray,
    pixels: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    margin: int,
) -> None:
    u, v, weight, own = pixels
    for row, lean in enumerate(leans):
        fits = np.abs(own - lean) < TUNING.lean_error
        bins = np.rint(u[fits] - lean * v[fits]).astype(np.intp) + margin
        bins = np.clip(bins, 0, votes.shape[1] - 1)
        votes[row] += np.bincount(bins, weight[fits], votes.shape[1])


def _refine(
    u: FloatArray, v: FloatArray, weight: FloatArray, start: tuple[float, float]
) -> tuple[float, float]:
    """Refines a line by a weighted fit to nearby edge pixels; returns column and inclination."""
    column, lean = start
    for reach in (2.0, 1.2):
        near = np.abs(u - column - lean * v) < reach
        if np.count_nonzero(near) < 8 or np.ptp(v[near]) < 8.0:
            break
        root = np.sqrt(weight[near])
        matrix = np.column_stack((root, root * v[near]))
        solution = np.linalg.lstsq(matrix, root * u[near], rcond=None)[0]
        if abs(solution[1]) > TUNING.most_lean:
            break
        column, lean = float(solution[0]), float(solution[1])
    return column, lean
