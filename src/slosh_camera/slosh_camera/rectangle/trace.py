"""Detects the contact line on the front face in one image of a side view."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.measurement import Flag
from slosh_camera.optics.box import BoxView
from slosh_camera.rectangle.appearance import (
    Appearance,
    Levels,
    brightest,
    brightness,
    colour_weights,
    evidence,
    half_size,
    measure_levels,
    one_channel,
    raw_contrast,
    seen_appearance,
)
from slosh_camera.rectangle.fit import (
    FittedLine,
    first_shape,
    refined_shape,
    sample_draws,
    waves_of,
)
from slosh_camera.rectangle.line import (
    ColumnSplit,
    Edges,
    FrontLine,
    canny_edges,
    drop_loose_segments,
    front_line,
    refine_edges,
    split_columns,
)
from slosh_camera.rectangle.region import SideRegion
from slosh_camera.rectangle.tuning import TUNING
from slosh_camera.settings import DetectionSettings

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_DRAWS = sample_draws()
_NO_BOUNDS = (np.empty(0), np.empty(0))


@dataclass(frozen=True, slots=True, eq=False)
class Knowledge:
    """Reference data from an image of the liquid at rest.

    Attributes:
        level: of the still line at x = 0 [m].
        slope: of the still line [-].
        appearance: liquid and background; None: each image shows them itself.
        bow: of the still line on a round wall, which has one where the camera is not quite level.
    """

    level: float = 0.0
    slope: float = 0.0
    appearance: Appearance | None = None
    bow: FittedLine | None = None

    def zero(self, x: FloatArray) -> FloatArray:
        """Returns the contact line's height with liquid at rest, at positions x (N,) [m]."""
        if self.bow is not None:
            return self.bow.at(x)
        return self.level + self.slope * x


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """The container's region of one side-view image, reduced to one channel.

    Attributes:
        channel: (rows, columns), blurred.
        clipped: whether the camera clips the brighter one of the two.
    """

    channel: Image
    levels: Levels
    appearance: Appearance
    clipped: bool


@dataclass(frozen=True, slots=True, eq=False)
class TracedLine:
    """The contact line in one image, visible in N columns.

    Attributes:
        x: (N,) places on the face [m], from left to right.
        z: (N,) heights above the still line [m].
        pixels: (N, 2) [px].
        softness: (N,) standard deviations of the edges [px].
        doubt: (N,) by which the line may be lower, since the surface behind may be seen [px].
        pixel_height: footprint of one pixel row [m].
        full_x: (M,) places of the columns that are full of liquid [m].
        full_z: (M,) heights up to which they are seen to be full [m].
        hidden: part of the columns without an edge, not counting the full ones.
        clipped: whether the camera clips the brighter of liquid and background.
        knowledge: that places the still line.
    """

    x: FloatArray
    z: FloatArray
    pixels: FloatArray
    softness: FloatArray
    doubt: FloatArray
    shape: FittedLine
    pixel_height: float
    full_x: FloatArray
    full_z: FloatArray
    hidden: float
    clipped: bool
    knowledge: Knowledge


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """Result of detecting the contact line: flags, image channel and line; None if not found."""

    flags: Flag
    light: Light | None = None
    line: TracedLine | None = None


def trace_line(
    view: BoxView,
    region: SideRegion,
    settings: DetectionSettings,
    knowledge: Knowledge,
    image: Image,
) -> Trace:
    """Detects the contact line in one image of a side view.

    Args:
        view: the container as the camera sees it.
        knowledge: what the liquid at rest has taught.
        image: (height, width) or (height, width, 3) of the calibrated camera.
    """
    part = image[region.window]
    dark, bright = brightness(part, region)
    if bright < settings.max_dark:
        return Trace(Flag.TOO_DARK | Flag.NOT_FOUND)
    if dark > settings.min_bright:
        return Trace(Flag.TOO_BRIGHT | Flag.NOT_FOUND)
    if raw_contrast(part, region) < settings.min_contrast:
        return Trace(Flag.NOT_FOUND)
    light = _light(part, region, settings.blur, knowledge.appearance)
    if light.levels.contrast * light.appearance.levels.contrast <= 0.0:
        return Trace(Flag.NOT_FOUND)
    speaks = evidence(half_size(light.channel), light.appearance, light.levels)
    split = split_columns(speaks, region)
    flags = Flag.NONE
    if np.count_nonzero(split.full) >= TUNING.full_columns:
        flags = Flag.SATURATED
    enough = np.count_nonzero(split.seen) >= max(
        TUNING.least_points, TUNING.least_seen * split.seen.size
    )
    if not enough or split.agreement < TUNING.least_agreement:
        return Trace(flags | Flag.NOT_FOUND, light)
    line = _Tracer(view, region, knowledge, light).line(split)
    return Trace(flags | (Flag.NOT_FOUND if line is None else Flag.NONE), light, line)


def _light(part: Image, region: SideRegion, blur: float, learnt: Appearance | None) -> Light:
    if learnt is not None and (learnt.weights is None) != (part.ndim == 2):
        learnt = None
    weights = colour_weights(part, region) if learnt is None else learnt.weights
    channel = one_channel(part, weights)
    levels = measure_levels(channel, region)
    if blur > 0.0:
        channel = np.asarray(cv2.GaussianBlur(channel, (0, 0), blur), dtype=np.uint8)
    appearance = learnt or seen_appearance(channel, region, weights)
    clipped = brightest(part, region) >= TUNING.clipped
    return Light(channel, levels, appearance, clipped)


class _Tracer:
    """Converts detected columns of one image to positions on the front face."""

    def __init__(
        self, view: BoxView, region: SideRegion, knowledge: Knowledge, light: Light
    ) -> None:
        self._view = view
        self._region = region
        self._knowledge = knowledge
        self._light = light
        self._waves = waves_of(view)
        self._columns = np.arange(region.inside.shape[1])
        self._still = region.rows_at(np.zeros(self._columns.size))
        self._upper = np.argmax(region.inside, axis=0).astype(np.float64)
        rows = np.clip(np.rint(self._still), 0, len(region.inside) - 1).astype(np.intp)
        self._could = region.inside[rows, self._columns]
        middle = self._columns.size // 2
        pixel = (region.left + middle, region.top + self._still[middle])
        self._pixel_height = view.height_per_pixel(pixel)

    def line(self, split: ColumnSplit) -> TracedLine | None:
        """Refines the contact line from each column's boundary, or returns None if not found."""
        at_split = np.repeat(2.0 * split.rows.astype(np.float64) - 0.5, 2)
        seen, full = np.repeat(split.seen, 2), np.repeat(split.full, 2)
        first = self._first(at_split, seen)
        predicted = self._rows_of(first)
        # So near to the region's end the line and that end are one edge.
        full |= seen & (at_split < self._upper + TUNING.end_rows)
        reach = TUNING.own_split * self._view.box.width / self._pixel_height
        own = seen & (np.abs(at_split - predicted) < reach)
        expected = np.where(full, np.nan, np.where(own, at_split, predicted))
        edges = self._canny()
        found = self._refine(edges, expected)
        kept = self._kept(found, first)
        if self._hidden(kept, full) > TUNING.look_again:
            again = self._refine(edges, np.where(kept | full, np.nan, predicted))
            found = Edges(
                np.where(kept, found.rows, again.rows),
                np.where(kept, found.softness, again.softness),
            )
            kept = self._kept(found, first)
        if np.count_nonzero(kept) < max(
            TUNING.least_points, TUNING.least_seen * np.count_nonzero(~full)
        ):
            return None
        light = self._light
        line = FrontLine(found, kept, np.zeros(kept.size))
        line = front_line(self._view, self._region, light.channel, line, light.levels)
        return self._placed(line, full & ~seen, full)

    def _first(self, at_split: FloatArray, seen: BoolArray) -> FittedLine:
        """Fits the contact-line shape that agrees with most column boundaries."""
        columns = self._columns[seen][::2]
        x, z = self._place(at_split[columns], columns)
        return first_shape(x, z, self._waves, _DRAWS)

    def _rows_of(self, shape: FittedLine) -> FloatArray:
        """Returns the image rows (columns,) of a contact-line shape."""
        rows = self._still
        # Only where the camera is rolled or looks askew does a column's place depend on the row.
        for _ in range(2):
            x, _ = self._on_face(rows, self._columns)
            rows = self._region.rows_at(shape.at(x) + self._knowledge.zero(x))
        return rows

    def _canny(self) -> Image:
        light = self._light
        edges = canny_edges(light.channel, (light.levels.contrast, light.levels.noise))
        edges[~self._region.inside] = 0
        if light.appearance.foreign is not None:
            edges[light.appearance.foreign] = 0
        return edges

    def _refine(self, edges: Image, expected: FloatArray) -> Edges:
        return refine_edges(self._light.channel, edges, expected, self._light.levels.contrast)

    def _kept(self, found: Edges, first: FittedLine) -> BoolArray:
        """Returns a mask of the image columns whose edge belongs to the contact line."""
        rows = np.where(found.rows >= self._upper + TUNING.end_rows, found.rows, np.nan)
        columns = np.flatnonzero(np.isfinite(rows))
        kept = np.zeros(self._columns.size, np.bool_)
        if columns.size < TUNING.least_points:
            return kept
        x, z = self._place(rows[columns], columns)
        shape = refined_shape(x, z, first, self._floor, _NO_BOUNDS)
        gate = max(TUNING.tukey * shape.scatter, TUNING.gate_rows * self._pixel_height)
        near = kept.copy()
        near[columns] = np.abs(z - shape.at(x)) < gate
        return drop_loose_segments(rows, near)

    def _hidden(self, kept: BoolArray, full: BoolArray) -> float:
        """Returns the fraction of usable image columns in which the contact line is hidden."""
        could = self._could & ~full
        return float(np.count_nonzero(could & ~kept)) / max(int(np.count_nonzero(could)), 1)

    def _placed(self, line: FrontLine, over_top: BoolArray, full: BoolArray) -> TracedLine:
        columns, over = np.flatnonzero(line.kept), np.flatnonzero(over_top)
        rows, softness = line.edges.rows[columns], line.edges.softness[columns]
        x, z = self._place(rows, columns)
        order = np.argsort(x)
        x, z = x[order], z[order]
        full_x, full_z = self._place(self._upper[over] + TUNING.end_rows, over)
        start = first_shape(x, z, self._waves, _DRAWS)
        pixels = np.column_stack((columns.astype(np.float64), rows)) + self._corner
        return TracedLine(
            x=x,
            z=z,
            pixels=pixels[order],
            softness=softness[order],
            doubt=line.doubt[columns][order],
            shape=refined_shape(x, z, start, self._floor, (full_x, full_z)),
            pixel_height=self._pixel_height,
            full_x=full_x,
            full_z=full_z,
            hidden=self._hidden(line.kept, full),
            clipped=self._light.clipped,
            knowledge=self._knowledge,
        )

    def _place(self, rows: FloatArray, columns: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        """Converts pixels to positions on the face and heights above the level at rest [m]."""
        x, z = self._on_face(rows, columns)
        return x, z - self._knowledge.zero(x)

    def _on_face(
        self, rows: FloatArray, columns: NDArray[np.intp]
    ) -> tuple[FloatArray, FloatArray]:
        return self._view.on_face(np.column_stack((columns, rows)) + self._corner)

    @property
    def _corner(self) -> FloatArray:
        return np.array([self._region.left, self._region.top], dtype=np.float64)

    @property
    def _floor(self) -> float:
        return TUNING.scatter_floor * self._pixel_height
