"""Detects the contact line in a side view, and parts it from the rear wall's.

A camera above a part of the liquid sees the free surface there, between the line on the face
and, higher in the image, the line on the rear wall. Where the surface is nearly as dark as the
liquid the upper line is the more marked edge; taken for the line on the face it would read too
high. The surface has the same height at the face and at the rear wall, so that the upper line says
where the lower one is; whether the upper one was found is told by the grey level in between.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from slosh_camera.optics.box import BoxView
from slosh_camera.rectangle.appearance import Levels
from slosh_camera.rectangle.region import SideRegion
from slosh_camera.rectangle.tuning import TUNING

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


_SUPPORT = 4
# Sobel's response to a step of one grey level that is blurred with a standard deviation of 1 px.
_SOBEL_STEP = 8.0 / float(np.sqrt(2.0 * np.pi))


@dataclass(frozen=True, slots=True, eq=False)
class ColumnSplit:
    """Row in each image column where background changes to liquid, at half resolution.

    Attributes:
        rows: (columns,) boundary between rows of half the size: the number of rows above it.
        seen: (columns,) whether both are seen at the boundary.
        full: (columns,) whether the column holds liquid up to its upper end.
        agreement: mean evidence beside the boundary in favour of it, over the seen columns.
    """

    rows: IntArray
    seen: BoolArray
    full: BoolArray
    agreement: float


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Sub-pixel row and blur of the detected edge in each image column.

    Attributes:
        rows: (columns,) counted from the region's top; NaN where there is none.
        softness: (columns,) standard deviation of the blurred step [px].
    """

    rows: FloatArray
    softness: FloatArray


def split_columns(speaks: Single, region: SideRegion) -> ColumnSplit:
    """Finds the most likely boundary in each column, with background above liquid.

    Args:
        speaks: (rows, columns) evidence of half the size.
    """
    inside = region.inside[::2, ::2]
    # Neighbours are heard as well: the line goes on from column to column.
    heard = cv2.blur(np.where(inside, speaks, np.float32(0.0)), (3, 1))
    speaks = np.asarray(heard, np.float32)
    sums = np.vstack((np.zeros((1, speaks.shape[1]), np.float32), np.cumsum(speaks, axis=0)))
    rows = np.argmax(sums, axis=0)
    at = np.arange(rows.size)
    above = _beside(sums, rows - TUNING.beside_rows, rows, at)
    below = -_beside(sums, rows, rows + TUNING.beside_rows, at)
    first = np.argmax(inside, axis=0)
    last = inside.shape[0] - np.argmax(inside[::-1], axis=0)
    wide = inside.any(axis=0)
    ends_open = region.open_above[::2][: rows.size]
    to_top = wide & (rows <= first + 1) & (below > 0.0)
    dark_to_top = to_top & ends_open
    seen = wide & ~to_top & (rows < last - 1) & (above > 0.0) & (below > 0.0)
    full = _reached(dark_to_top, seen, rows - first)
    agreement = (
        float(np.mean((above + below)[seen])) / (2.0 * TUNING.beside_rows) if seen.any() else 0.0
    )
    return ColumnSplit(rows, seen, full, agreement)


def canny_edges(channel: Image, limits: tuple[float, float]) -> Image:
    """Detects the channel's Canny edges, with thresholds by contrast and noise.

    Args:
        channel: (rows, columns) of the region, blurred.
        limits: contrast of liquid and background and noise before the blur [grey levels].

    Returns:
        (rows, columns), not 0 on edges.
    """
    contrast, noise = limits
    high = _SOBEL_STEP * abs(contrast) / TUNING.softest
    low = max(TUNING.low_part * high, min(TUNING.noise_response * noise, high))
    return np.asarray(cv2.Canny(channel, low, high), dtype=np.uint8)


def refine_edges(channel: Image, edges: Image, expected: FloatArray, contrast: float) -> Edges:
    """Refines the strongest Canny edge near the expected rows to sub-pixel precision.

    The column's grey steps about a blurred edge are a Gaussian over the rows: its logarithm is a
    parabola.

    Args:
        channel: (rows, columns) of the region, blurred.
        expected: (columns,) rows; NaN where no edge is looked for.
        contrast: background less liquid [grey levels].
    """
    rows, columns = channel.shape
    margin = TUNING.window + _SUPPORT
    wanted = np.isfinite(expected)
    centre = np.clip(np.rint(np.where(wanted, expected, 0.0)), 0, rows - 1).astype(np.intp)
    at = np.arange(columns)
    # Beyond the region its last row goes on: no step, so no edge.
    window = np.clip(centre + np.arange(-margin, margin + 1)[:, np.newaxis], 0, rows - 1)
    values = channel[window, at].astype(np.float64)
    # Half of the steps over two rows, positive from background down to liquid.
    steps = 0.5 * np.sign(contrast) * (values[:-2] - values[2:])
    inner = slice(margin - TUNING.window, margin + TUNING.window + 1)
    marked = edges[window[inner], at] > 0
    found = np.where(marked, steps[margin - TUNING.window - 1 : margin + TUNING.window], 0.0)
    best = np.argmax(found, axis=0)
    wanted &= found[best, at] > 0.0
    place = best + margin - TUNING.window - 1
    offset, softness = _peak(steps, place, at, abs(contrast))
    row = centre + best - TUNING.window + offset
    return Edges(np.where(wanted, row, np.nan), np.where(wanted, softness, np.nan))


def drop_loose_segments(rows: FloatArray, near: BoolArray) -> BoolArray:
    """Returns a mask of the columns whose edge segment belongs to the contact line.

    A segment ends where the row jumps. What a droplet or a sticker adds is a segment of its own,
    most of which is away from the fitted shape; a crest that the shape does not follow hangs
    together with the rest.

    Args:
        rows: (columns,); NaN where there is no edge.
        near: (columns,) whether the edge is near the fitted shape.

    Returns:
        (columns,) whether the edge is kept.
    """
    kept = np.isfinite(rows)
    at = np.flatnonzero(kept)
    if at.size == 0:
        return kept
    far = (np.abs(np.diff(rows[at])) > TUNING.jump * np.sqrt(np.diff(at))).astype(np.intp)
    segment = np.concatenate(([0], np.cumsum(far)))
    share = np.bincount(segment, near[at]) / np.bincount(segment)
    kept[at] = share[segment] >= 0.5
    return _without_ends(kept)


def _without_ends(kept: BoolArray) -> BoolArray:
    """Clears mask columns beside a wide gap, where an occluding object may have the edge."""
    hidden = np.array(~kept, dtype=np.uint8)[np.newaxis]
    wide = cv2.morphologyEx(hidden, cv2.MORPH_OPEN, np.ones((1, TUNING.wide_gap), np.uint8))
    beside = cv2.dilate(wide, np.ones((1, 2 * TUNING.gap_ends + 1), np.uint8))[0] > 0
    return np.asarray(kept & ~beside, dtype=np.bool_)


def _peak(
    steps: FloatArray, place: IntArray, at: IntArray, contrast: float
) -> tuple[FloatArray, FloatArray]:
    """Returns the sub-pixel position of the steepest grey-level step, and its width."""
    around = np.array(
        [steps[np.clip(place + k, 0, len(steps) - 1), at] for k in (-2, -1, 0, 1, 2)]
    )
    # Noise of single rows moves the peak less after this.
    smooth = 0.25 * (around[:-2] + 2.0 * around[1:-1] + around[2:])
    before, middle, after = np.log(np.maximum(smooth, 1e-3))
    bend = before - 2.0 * middle + after
    flat = bend > -1e-6
    offset = np.where(flat, 0.0, 0.5 * (before - after) / np.where(flat, 1.0, bend))
    softness = contrast / (np.sqrt(2.0 * np.pi) * np.maximum(smooth[1], 1e-3))
    return np.clip(offset, -1.0, 1.0), softness


def _reached(to_top: BoolArray, seen: BoolArray, below_top: IntArray) -> BoolArray:
    """Returns a mask of columns that are full of liquid and adjoin the detected contact line.

    A dark thing before the face, such as a sticker, ends in the middle of the line instead.

    Args:
        to_top: (columns,) whether the column is liquid up to its upper end.
        seen: (columns,) whether the line is seen.
        below_top: (columns,) rows of the line below the upper end.

    Returns:
        (columns,).
    """
    reached = np.zeros_like(to_top)
    at_line = np.flatnonzero(seen)
    changes = np.flatnonzero(np.diff(np.concatenate(([False], to_top, [False]))))
    for start, stop in zip(changes[::2], changes[1::2], strict=True):
        after = int(np.searchsorted(at_line, start))
        beside = at_line[max(after - 1, 0) : after + 1]
        gap = np.where(beside < start, start - beside, beside - stop + 1)
        leads = below_top[beside] <= TUNING.top_rows + TUNING.steepest * gap
        reached[start:stop] = beside.size == 0 or bool(np.any(leads))
    return reached


def _beside(sums: Single, start: IntArray, stop: IntArray, at: IntArray) -> Single:
    last = len(sums) - 1
    difference: Single = sums[np.clip(stop, 0, last), at] - sums[np.clip(start, 0, last), at]
    return difference


@dataclass(frozen=True, slots=True, eq=False)
class FrontLine:
    """The contact line on the front face, separated from that on the rear wall.

    Attributes:
        kept: (columns,) where it is seen.
        doubt: (columns,) rows by which it may lie lower, since only one line is seen where there
            may be two [px].
    """

    edges: Edges
    kept: NDArray[np.bool_]
    doubt: FloatArray


def front_line(
    view: BoxView, region: SideRegion, channel: Image, found: FrontLine, levels: Levels
) -> FrontLine:
    """Returns the contact line on the front face, even if the rear one was detected.

    Args:
        view: the container as the camera sees it.
        channel: (rows, columns) of the region, blurred.
        found: the line that was found.

    Returns:
        The line on the face; where nothing speaks for a second line, the line that was found.
    """
    columns = np.flatnonzero(found.kept)
    rows, softness = found.edges.rows[columns], found.edges.softness[columns]
    front, trusted = _in_front(view, region, rows, columns)
    gap = np.maximum(np.nan_to_num(front - rows), 0.0)
    sharp = float(np.percentile(softness, TUNING.sharp_percentile))
    apart = gap >= max(TUNING.apart_rows, TUNING.apart_softness * sharp)
    surface = 0.0
    if np.count_nonzero(apart) >= TUNING.least_rows:
        steps = _at(channel, rows + 0.5 * gap, columns) - _at(channel, rows + 1.5 * gap, columns)
        # A single edge is still on its way down in the middle.
        tail = scipy.special.ndtr(-0.5 * gap / sharp) - scipy.special.ndtr(-1.5 * gap / sharp)
        surface = float(np.median((steps / levels.contrast - tail)[apart]))
    doubt = np.zeros(found.kept.size)
    doubt[columns] = _visible_depth(view, region, rows, columns)
    if surface < TUNING.least_surface:
        return FrontLine(found.edges, found.kept, doubt)
    surface = min(surface, TUNING.most_surface)
    own = (1.0 - surface) * float(np.median(softness[apart]))
    rear = rows - _shift(gap, own, surface)
    front, _ = _in_front(view, region, rear, columns)
    at = found.edges.rows.copy()
    at[columns] = np.where(gap > 0.0, front, rows)
    doubt[columns[trusted | (gap > 0.0)]] = 0.0
    return FrontLine(Edges(at, found.edges.softness), np.isfinite(at) & found.kept, doubt)


def _at(channel: Image, rows: FloatArray, columns: NDArray[np.intp]) -> FloatArray:
    """Interpolates grey levels (N,) at fractional rows (N,) of image columns (N,)."""
    last = len(channel) - 2
    above = np.clip(np.floor(np.nan_to_num(rows)), 0, last).astype(np.intp)
    part = np.clip(np.nan_to_num(rows) - above, 0.0, 1.0)
    levels: FloatArray = (1.0 - part) * channel[above, columns] + part * channel[
        above + 1, columns
    ]
    return levels


def _shift(gap: FloatArray, softness: float, surface: float) -> FloatArray:
    """Returns how far [rows] a blurred edge shifts due to a second edge below it.

    Two blurred steps, 1 - surface and surface high, are two Gaussians over the rows; this is one
    step of Newton's method from the upper one's centre to the sum's maximum.
    """
    ratio = surface / (1.0 - surface)
    square = (gap / softness) ** 2
    overlap = ratio * np.exp(-0.5 * square)
    shift: FloatArray = gap * overlap / (1.0 + overlap * (1.0 - square))
    return shift


def _in_front(
    view: BoxView, region: SideRegion, rows: FloatArray, columns: NDArray[np.intp]
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Converts detected rows of the rear contact line to rows of the front contact line.

    Returns:
        (N,) rows, NaN where the rear wall does not show what stands before it, and (N,) whether
        they come from where the camera looks down on the surface; where it looks up, the liquid
        before it hides the rear wall.
    """
    pixels = np.column_stack((columns + region.left, rows + region.top))
    rear_x, rear_z = view.on_rear(pixels)
    between = np.abs(rear_x) <= 0.5 * view.box.width
    if np.count_nonzero(between) < TUNING.least_rows:
        return np.full(rows.size, np.nan), np.zeros(rows.size, np.bool_)
    order = np.argsort(rear_x[between])
    known, heights = rear_x[between][order], rear_z[between][order]
    x, z = view.on_face(pixels)
    margin = TUNING.margin * view.box.width
    inside = (x >= known[0] - margin) & (x <= known[-1] + margin)
    every = np.zeros(region.inside.shape[1])
    every[columns] = np.interp(x, known, heights)
    front = np.where(inside, region.rows_at(every)[columns], np.nan)
    down = (rear_z <= z)[between][order].astype(np.float64)
    askew = abs(float(np.median(rear_x - x))) > TUNING.askew * view.box.width
    return front, inside & (np.interp(x, known, down) > TUNING.all_down) & (not askew)


def _visible_depth(
    view: BoxView, region: SideRegion, rows: FloatArray, columns: NDArray[np.intp]
) -> FloatArray:
    """Returns how many image rows (N,) a level surface covers from front to rear wall."""
    pixels = np.column_stack((columns + region.left, rows + region.top))
    _, z = view.on_face(pixels)
    _, rear_z = view.on_rear(pixels)
    _, above = view.on_face(pixels - np.array([0.0, 1.0]))
    return np.nan_to_num(np.maximum(z - rear_z, 0.0) / (above - z))
