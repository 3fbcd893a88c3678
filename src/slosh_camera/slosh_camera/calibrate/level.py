"""Whether a line across a container is the liquid's level, or may be another one.

Printed rings, scales and seams lie where a level could. They differ from it: liquid changes what
is below the line, a ring looks the same below and above; a level runs from side to side, a scale
mostly does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.curves import sides_of, view_at
from slosh_camera.calibrate.edges import EdgeImage
from slosh_camera.calibrate.fit import Fit
from slosh_camera.calibrate.pose import CameraPlace
from slosh_camera.optics.cup import Cup, CupView

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Image = NDArray[np.uint8]
FloatOrArray = TypeVar("FloatOrArray", float, FloatArray)

# The numbers below were set on every second of a set of photographs of graduated cylinders.
# The part of the front wall that is looked at, in so many sectors of so many columns each.
_ARC, _SECTORS, _COLUMNS = np.deg2rad(66.0), 5, 5
# How far a line may be off its place [px].
_SLACK = 2
# The colours compared lie so far above and below a line, in radii: the change is at the line, and
# it lasts.
_WINDOWS = ((0.06, 0.2), (0.15, 0.7))
# A lasting change of colour that counts fully [grey levels], and the weight of a line without one.
_FULL_STEP, _LINE_ALONE = 15.0, 0.5
# So does this part of the largest change on the wall, where that is more.
_OF_LARGEST = 0.7
# Another line is a rival where it is at least so strong as a part of the level's, lies farther
# away than so many radii, and the sides show on this part of the liquid's height below it.
_RIVAL, _APART, _LEAST_SIDES = 0.8, 0.15, 0.5
LEAST_LEVEL = 0.25
"""A level that is weaker is no level."""
# One that counts for more than a line that shows on part of its length.
_SHOWS = 0.6
# Nearer than so many radii to the rim or the floor is no other level.
_ENDS = 0.3
# Rows of the thickest line that counts as print.
_THIN = 2
_MOST_ROWS = 3000
# Where a line that goes on beside the container is looked for, in outer radii from the axis: an
# edge of a table behind it. Of its strength so much is taken off.
_BESIDE, _BEHIND = (1.2, 1.3, 1.4, 1.5), 0.6


@dataclass(frozen=True, slots=True)
class Level:
    """A line that may be the level.

    Attributes:
        height: above the level of the pose [m].
        row: v of the middle of its front line [px].
        strength: how much it looks like a level, 0 to 1.
    """

    height: float
    row: float
    strength: float


@dataclass(frozen=True, slots=True, eq=False)
class _Strip:
    """The front wall unrolled: pixels (N, M, 2), colours (N, M, channels), heights (N,) [m]."""

    heights: FloatArray
    pixels: Float32Array
    colours: Float32Array


@dataclass(frozen=True, slots=True)
class Levels:
    """The lines on a container's front wall that may be the level.

    Attributes:
        own: the one of the pose.
        rival: another one that may be it as well; None: there is none.
    """

    own: Level
    rival: Level | None

    @property
    def shows(self) -> bool:
        """The level runs from side to side with another colour below, and has no rival."""
        return self.rival is None and self.own.strength >= _SHOWS


def levels_of(edges: EdgeImage, fit: Fit) -> Levels:
    """The level of a pose as the image shows it, and the strongest line that rivals it.

    Args:
        edges: the image, without distortion.
        fit: a pose in it.
    """
    view = view_at(fit.camera, fit.cup, fit.place)
    strip = _unrolled(edges, view)
    line = _lines(edges, strip) * (1.0 - _BEHIND * _beside(edges, view, strip.heights))
    change = _changes(strip, fit.cup, fit.place)
    here = np.abs(strip.heights) <= _SLACK * (strip.heights[1] - strip.heights[0])
    rear = _rear(fit.cup, fit.place, 0.0)
    apart = _APART * fit.cup.radius
    other = (strip.heights < min(rear, 0.0) - apart) | (strip.heights > max(rear, 0.0) + apart)
    # The rim and the floor's edge are lines, too, and lie where the dimensions put them.
    ends = _ENDS * fit.cup.radius
    other &= strip.heights > strip.heights[0] + ends
    if fit.cup.rim_level is not None:
        other &= strip.heights < fit.cup.rim_level - ends
    walled = _walls(edges, view, strip.heights) >= _LEAST_SIDES
    other &= walled
    # Where one line parts two colours, a ring's small change is none.
    full = max(_FULL_STEP, _OF_LARGEST * float(np.max(change, initial=0.0, where=here | other)))
    strength = line * (_LINE_ALONE + (1.0 - _LINE_ALONE) * np.minimum(change / full, 1.0))
    middle = strip.pixels.shape[1] // 2

    def level(index: int) -> Level:
        row = float(strip.pixels[index, middle, 1])
        return Level(float(strip.heights[index]), row, float(strength[index]))

    own = level(int(np.argmax(np.where(here, strength, -1.0))))
    open_to_doubt = np.where(other, strength, 0.0)
    best = int(np.argmax(open_to_doubt))
    rivals = open_to_doubt[best] > 0.0 and open_to_doubt[best] >= _RIVAL * own.strength
    return Levels(own, level(best) if rivals else None)


def without_thin_lines(image: Image) -> Image:
    """The image without level lines of one or two pixels, as print in an image made smaller is.

    Each pixel becomes the median of five above one another.

    Args:
        image: (height, width) grey or (height, width, 3) colour.
    """
    pad = [(_THIN, _THIN)] + [(0, 0)] * (image.ndim - 1)
    padded, rows = np.pad(image, pad, "edge"), len(image)
    stack = np.stack([padded[start : start + rows] for start in range(2 * _THIN + 1)])
    return np.ascontiguousarray(np.partition(stack, _THIN, axis=0)[_THIN])


def _unrolled(edges: EdgeImage, view: CupView) -> _Strip:
    cup = view.cup
    top = cup.rim_level if cup.rim_level is not None else cup.fill_height
    left, right = sides_of(view)
    step = 2.0 * cup.radius / float(np.hypot(*(right - left)))
    below, above = np.ceil(cup.fill_height / step), np.ceil(top / step)
    heights = step * np.arange(-min(below, _MOST_ROWS), min(above, _MOST_ROWS) + 1.0)
    azimuth = view.camera_azimuth + np.linspace(-_ARC, _ARC, _SECTORS * _COLUMNS)
    shape = (heights.size, azimuth.size)
    points = np.empty((*shape, 3))
    points[..., 0] = cup.radius * np.cos(azimuth)
    points[..., 1] = cup.radius * np.sin(azimuth)
    points[..., 2] = heights[:, np.newaxis]
    pixels = view.project(points.reshape(-1, 3)).reshape(*shape, 2).astype(np.float32)
    rows, columns = edges.shape
    inside = np.all((pixels >= 1.0) & (pixels <= (columns - 2.0, rows - 2.0)), axis=2)
    where = np.where(inside[..., np.newaxis], pixels, 0.0).astype(np.float32)
    # OpenCV's types do not know that one map may hold both coordinates.
    colours = cv2.remap(  # type: ignore[call-overload]
        edges.smooth, where, None, cv2.INTER_LINEAR
    ).reshape(*shape, -1)
    colours[~inside] = np.nan
    return _Strip(heights, pixels, np.asarray(colours, np.float32))


def _lines(edges: EdgeImage, strip: _Strip) -> FloatArray:
    """How much of an edge runs from side to side at each height (N,), 0 to 1."""
    apart = np.hypot(*np.moveaxis(np.gradient(strip.pixels, axis=0), 2, 0))
    slope = np.abs(np.gradient(strip.colours, axis=0)).max(axis=2) / np.maximum(apart, 1e-3)
    support = edges.support(np.nan_to_num(slope)).astype(np.float32)
    support = np.asarray(cv2.dilate(support, np.ones((2 * _SLACK + 1, 1), np.uint8)), np.float32)
    sectors = support.reshape(len(support), _SECTORS, _COLUMNS).mean(axis=2)
    return np.asarray(np.sort(sectors, axis=1)[:, :2].mean(axis=1), np.float64)


def _changes(strip: _Strip, cup: Cup, place: CameraPlace) -> FloatArray:
    """How much the colour changes at each height (N,), and stays changed [grey levels]."""
    step = float(strip.heights[1] - strip.heights[0])
    rear = np.maximum(_rear(cup, place, strip.heights), 0.0) / step
    change = np.full(strip.heights.size, np.inf)
    for window in _WINDOWS:
        near, far = (max(round(share * cup.radius / step), 1) for share in window)
        change = np.minimum(change, _change(strip.colours, rear, near, far))
    return change


def _beside(edges: EdgeImage, view: CupView, heights: FloatArray) -> FloatArray:
    """How much of a line at each height (N,) goes on to both sides of the container, 0 to 1."""
    outer = view.cup.radius + view.cup.wall_thickness
    across = np.array([-np.sin(view.camera_azimuth), np.cos(view.camera_azimuth)])
    tall = np.ones((4 * _SLACK + 1, 1), np.uint8)
    support = np.asarray(cv2.dilate(edges.support(edges.down).astype(np.float32), tall))
    least = np.ones(heights.size)
    for side in (-1.0, 1.0):
        seen = np.zeros(heights.size)
        for away in _BESIDE:
            place = side * away * outer * across
            points = np.column_stack((*np.broadcast_arrays(place[0], place[1], heights),))
            seen += _values(support, view.project(points)) / len(_BESIDE)
        least = np.minimum(least, seen)
    return least


def _values(chart: NDArray[np.generic], pixels: FloatArray) -> FloatArray:
    """Values of the nearest pixels (N, 2); 0 outside."""
    # OpenCV's types do not know that one map may hold both coordinates.
    found = cv2.remap(  # type: ignore[call-overload]
        np.asarray(chart, np.float32), pixels.astype(np.float32)[:, np.newaxis], None,
        cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT,
    )  # fmt: skip
    return np.asarray(found[:, 0], np.float64)


def _change(colours: Float32Array, rear: FloatArray, near: int, far: int) -> FloatArray:
    """Change of colour (N,) from above a level's rear line to below its front line [grey levels].

    Args:
        colours: (N, M, channels) of the strip, from below.
        rear: (N,) rows from the front line to the rear one.
        near: where the rows begin whose median is taken, from either line.
        far: where they end.
    """
    count = far - near + 1
    middles = np.full(colours.shape, np.nan, np.float32)
    if len(colours) >= count:
        rows = np.lib.stride_tricks.sliding_window_view(colours, count, axis=0)
        middles[: len(rows)] = np.median(rows, axis=-1)
    index = np.arange(len(colours))
    above = index + rear.astype(int) + near
    known = (above < len(colours)) & (index >= far)
    step = middles[np.maximum(index - far, 0)] - middles[np.minimum(above, len(colours) - 1)]
    change = np.max(np.abs(np.median(step, axis=1)), axis=1)
    return np.where(known, np.nan_to_num(change), 0.0)


def _rear(cup: Cup, place: CameraPlace, height: FloatOrArray) -> FloatOrArray:
    """How much higher on the front wall the rear line of a level at some height appears [m]."""
    return (place.height - height) * 2.0 * cup.radius / (place.distance + cup.radius)


def _walls(edges: EdgeImage, view: CupView, heights: FloatArray) -> FloatArray:
    """Part of the liquid's height below each level (N,) on which both sides show."""
    outer = view.cup.radius + view.cup.wall_thickness
    half = np.arccos(min(outer / float(np.hypot(*view.pose.camera_centre[:2])), 1.0))
    step = heights[1] - heights[0]
    count = max(round(float(view.cup.fill_height / step)), 1)
    z = np.concatenate((heights[0] - step * np.arange(count, 0, -1.0), heights))
    seen = np.ones(z.size)
    support = edges.support(edges.across).astype(np.float32)
    wide = np.asarray(cv2.dilate(support, np.ones((1, 4 * _SLACK + 1), np.uint8)), np.float32)
    for side in (-half, half):
        azimuth = view.camera_azimuth + side
        flat = np.full(z.size, outer * np.cos(azimuth)), np.full(z.size, outer * np.sin(azimuth))
        seen = np.minimum(seen, _values(wide, view.project(np.column_stack((*flat, z)))) > 0.4)
    total = np.concatenate(([0.0], np.cumsum(seen)))
    return np.asarray((total[count + 1 :] - total[1 : heights.size + 1]) / count)
