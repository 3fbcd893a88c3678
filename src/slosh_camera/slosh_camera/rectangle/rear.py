"""Separates the rear wall's contact line from the front one if the camera looks down.

A camera above a part of the liquid sees the free surface there, between the line on the face
and, higher in the image, the line on the rear wall. Where the surface is nearly as dark as the
liquid the upper line is the more marked edge; taken for the line on the face it would read too
high. The surface has the same height at the face and at the rear wall, so that the upper line says
where the lower one is; whether the upper one was found is told by the grey level in between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from slosh_camera.optics.box import BoxView
from slosh_camera.rectangle.appearance import Levels
from slosh_camera.rectangle.line import Edges
from slosh_camera.rectangle.region import SideRegion
from slosh_camera.rectangle.tuning import TUNING

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FrontLine:
    """The contact line on the front face, separated from that on the rear wall.

    Attributes:
        edges: the line.
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
        region: the region.
        channel: (rows, columns) of the region, blurred.
        found: the line that was found.
        levels: of liquid and background.

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
