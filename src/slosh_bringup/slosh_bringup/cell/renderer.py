"""Renders the images of the cell's camera: a glass cup of dark liquid on the robot's plate.

A conical cup is drawn as the cylinder to which a projective map turns it (see `optics.cup`).

Every edge is computed by the pinhole projection, column by column, and drawn with the share of
the pixel that it covers: where an edge lies is exact to a few hundredths of a pixel. Refraction is
left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_camera.optics.cup import CupView
from slosh_model.bessel import radial_shape

Layer = NDArray[np.float32]
GrayImage = NDArray[np.uint8]
ColourImage = NDArray[np.uint8]

MARGIN = 8
"""Pixels around the cup that are drawn anew with it, for the lens' blur."""
NOISE_SHIFT = 64
"""One field of noise serves all frames, shifted by up to so many pixels; new noise costs more."""
PLATE_RADIUS, PLATE_THICKNESS = 1.5, 0.2
"""The plate under the cup, as multiples of the cup's radius."""
LUMA = np.array([0.114, 0.587, 0.299])
"""Share of blue, green and red in a grey level (ITU-R BT.601)."""

CHORDS = 121
"""Horizontal rays from the camera that meet the cup."""
PLACES = 41
"""Points along each ray, so many that the crest between two of them is higher by < 0.05 px."""


@dataclass(frozen=True, slots=True)
class GreyLevels:
    """Grey levels of the rendered scene, from 0 (black) to 255 (white).

    Attributes:
        background, liquid, surface: of the background, of the liquid seen through the wall, of its
            free surface seen from above.
        outline: of the cup's edges.
        plate: of the plate on which the cup stands.
        shading: how unevenly liquid and surface are lit, relative.
        glint: brightness that the glass' reflections add.
        tint: blue, green and red of the liquid relative to its grey level, in colour images.
        noise: standard deviation of the camera's noise.
        blur: standard deviation of the lens' blur [px].
        seed: of the noise.
    """

    background: float = 205.0
    liquid: float = 48.0
    surface: float = 118.0
    outline: float = 150.0
    plate: float = 165.0
    shading: float = 0.12
    glint: float = 9.0
    tint: tuple[float, float, float] = (0.55, 0.9, 1.35)
    noise: float = 2.5
    blur: float = 0.7
    seed: int = 1


class CupRenderer:
    """Renders camera images of the cup as a calibrated camera sees it.

    Args:
        view: camera, pose and container; the lens must not distort.
        appearance: grey levels and noise.
    """

    def __init__(self, view: CupView, appearance: GreyLevels | None = None) -> None:
        self._view = view
        self._look = look = appearance or GreyLevels()
        self._top = view.cup.radius if view.cup.rim_level is None else view.cup.rim_level
        backdrop = self._draw_backdrop()
        self._region = self._cup_region()
        rows, columns = self._region
        self._rows = np.arange(rows.start, rows.stop, dtype=np.float32)[:, np.newaxis]
        self._columns = np.arange(columns.start, columns.stop, dtype=np.float64)
        self._lines = SurfaceLines(view, self._columns)
        self._floor = self._lines.floor()
        self._inside = self._inside_cup()
        self._behind = backdrop[self._region].copy()
        across = self._across()
        self._liquid = np.asarray(look.liquid * (1.0 - look.shading * across**2), np.float32)
        self._surface = np.asarray(look.surface * (1.0 + look.shading * across), np.float32)
        self._glint = self._reflections(across)
        self._backdrop = self._blurred(backdrop)
        tint = np.array(look.tint) / (LUMA @ np.array(look.tint))
        self._tint = [np.float32(share - 1.0) for share in tint]
        self._random = np.random.default_rng(look.seed)
        self._noise = self._noise_field()

    def render(self, sh_x: float, sh_y: float) -> GrayImage:
        """Renders an image for liquid heights [m] at the wall at the container's +x and +y.

        Returns:
            (height, width) uint8.
        """
        return self._exposed(self._paint(sh_x, sh_y)[0])

    def render_colour(self, sh_x: float, sh_y: float) -> ColourImage:
        """Renders the same scene as `render`, in colour and with equal grey levels.

        Returns:
            (height, width, 3) uint8, blue, green, red.
        """
        image, wet = self._paint(sh_x, sh_y)
        grey = self._exposed(image)
        colour: ColourImage = np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), np.uint8)
        cup = grey[self._region].astype(np.float32)
        wet *= cup
        channels = [cv2.convertScaleAbs(cup + tint * wet) for tint in self._tint]
        colour[self._region] = cv2.merge(channels)
        return colour

    def _paint(self, sh_x: float, sh_y: float) -> tuple[Layer, Layer]:
        """Returns the noise-free image and the fraction of each cup pixel that liquid covers."""
        edges = self._lines.edges(sh_x, sh_y)
        # The wall hides what lies below its contact line; the surface has the rest of each pixel.
        wet = self._above_floor(edges.top)
        body = self._above_floor(edges.front)
        cup = self._behind + wet * (self._surface - self._behind)
        cup += body * (self._liquid - self._surface)
        cup += self._glint
        image = self._backdrop.copy()
        image[self._region] = self._blurred(cup)
        return image, wet

    def _exposed(self, image: Layer) -> GrayImage:
        """Adds sensor noise to an image and rounds it to whole grey levels."""
        if self._look.noise > 0.0:
            down, right = self._random.integers(0, NOISE_SHIFT, 2)
            height, width = image.shape
            image += self._noise[down : down + height, right : right + width]
        return np.asarray(cv2.convertScaleAbs(np.maximum(image, 0.0)), np.uint8)

    def _above_floor(self, edge: Array) -> Layer:
        """Returns the fraction of each cup pixel between an upper edge and the cup's floor."""
        upper = np.nan_to_num(edge, nan=1e6).astype(np.float32)
        share: Layer = np.clip(self._rows + np.float32(0.5) - upper, 0.0, 1.0)
        share *= self._inside
        return share

    def _cup_region(self) -> tuple[slice, slice]:
        """Returns the image rows and columns that change: the cup, up to the top of the image."""
        camera, cup = self._view.camera, self._view.cup
        circle = np.linspace(-np.pi, np.pi, 73)
        levels = (-cup.fill_height, self._top)
        pixels = np.vstack([self._view.project_wall(circle, level) for level in levels])
        left, right = int(pixels[:, 0].min()) - MARGIN, int(pixels[:, 0].max()) + MARGIN
        bottom = int(pixels[:, 1].max()) + MARGIN
        return slice(0, min(bottom, camera.height)), slice(max(left, 0), min(right, camera.width))

    def _side_lines(self) -> tuple[Array, Array]:
        """Returns the image columns of the cup's left and right edges in each region row."""
        levels = np.array([-self._view.cup.fill_height, self._top])
        rows = self._rows[:, 0].astype(np.float64)
        edges = []
        for azimuth in self._view.tangent_azimuths():
            u, v = self._view.project_wall(np.full(2, azimuth), levels).T
            edges.append(u[0] + (u[1] - u[0]) / (v[1] - v[0]) * (rows - v[0]))
        return edges[0], edges[1]

    def _inside_cup(self) -> Layer:
        """Returns the fraction of each pixel between the cup's side edges and above its floor."""
        left, right = self._side_lines()
        inside = np.clip(self._columns + 0.5 - left[:, np.newaxis], 0.0, 1.0)
        inside *= np.clip(right[:, np.newaxis] + 0.5 - self._columns, 0.0, 1.0)
        inside *= np.clip(self._floor + 0.5 - self._rows, 0.0, 1.0)
        return np.asarray(inside, dtype=np.float32)

    def _across(self) -> Array:
        """Returns each pixel's position across the cup, from -1 (left edge) to 1 (right)."""
        left, right = (edge[:, np.newaxis] for edge in self._side_lines())
        place: Array = np.clip(2.0 * (self._columns - left) / (right - left) - 1.0, -1.0, 1.0)
        return place

    def _reflections(self, across: Array) -> Layer:
        """Draws two soft bright bands on the glass, below its rim."""
        bands = np.exp(-0.5 * ((across + 0.62) / 0.05) ** 2)
        bands += 0.5 * np.exp(-0.5 * ((across - 0.75) / 0.03) ** 2)
        ((_, rim),) = self._view.project_wall(self._view.camera_azimuth, self._top)
        glass = np.clip((self._rows - rim) / 20.0, 0.0, 1.0) * self._inside
        return np.asarray(self._look.glint * bands * glass, np.float32)

    def _blurred(self, image: Layer) -> Layer:
        if self._look.blur == 0.0:
            return image
        return np.asarray(cv2.GaussianBlur(image, (0, 0), self._look.blur), np.float32)

    def _draw_backdrop(self) -> Layer:
        """Draws the static background: an unevenly lit wall, the plate and the cup's outline."""
        look, camera, cup = self._look, self._view.camera, self._view.cup
        across = np.linspace(0.0, 1.0, camera.width)
        down = np.linspace(0.0, 1.0, camera.height)[:, np.newaxis]
        light = 1.0 - 0.08 * (across - 0.4) ** 2 - 0.05 * down**2
        # OpenCV smooths edges in 8 bit images only.
        image = np.round(look.background * light).astype(np.uint8)
        circle = self._view.camera_azimuth + np.linspace(-np.pi, np.pi, 361)
        floor = -cup.fill_height
        plate = self._disc(circle, PLATE_RADIUS * cup.radius, floor)
        lower = self._disc(circle, PLATE_RADIUS * cup.radius, floor - PLATE_THICKNESS * cup.radius)
        both = cv2.convexHull(np.vstack((plate, lower)))
        cv2.fillPoly(image, [both], 0.85 * look.plate, cv2.LINE_AA, 4)
        cv2.fillPoly(image, [plate], look.plate, cv2.LINE_AA, 4)
        ends = np.array([floor, self._top])
        outlines = [self._disc(circle, float(cup.radius_at(level)), level) for level in ends]
        outlines += [
            _fixed_point(self._view.project_wall(np.full(2, azimuth), ends))
            for azimuth in self._view.tangent_azimuths()
        ]
        for outline in outlines:
            cv2.polylines(image, [outline], False, look.outline, 1, cv2.LINE_AA, 4)
        return image.astype(np.float32)

    def _disc(self, azimuth: Array, radius: float, level: float) -> NDArray[np.int32]:
        """Returns the image outline of a horizontal disc centred on the cup's axis, for OpenCV."""
        points = (radius * np.cos(azimuth), radius * np.sin(azimuth), np.full_like(azimuth, level))
        return _fixed_point(self._view.project(np.column_stack(points)))

    def _noise_field(self) -> Layer:
        camera = self._view.camera
        shape = (camera.height + NOISE_SHIFT, camera.width + NOISE_SHIFT)
        return self._look.noise * self._random.standard_normal(shape, dtype=np.float32)


def _fixed_point(pixels: Array) -> NDArray[np.int32]:
    """Returns pixel coordinates as integers with four fractional bits, as OpenCV draws them."""
    return np.round(pixels * 16.0).astype(np.int32)


@dataclass(frozen=True, slots=True)
class SurfaceEdges:
    """Image rows [px] of the free surface in each column; NaN where no surface is visible.

    Attributes:
        front: (C,) line on the wall's half that faces the camera.
        top: (C,) highest row of the whole surface: the contact line, a crest inside, or the rear
            line.
    """

    front: Array
    top: Array


class SurfaceLines:
    """Projects a cup's liquid surface into the image with straight rays, without refraction.

    The surface is the first mode's (DL22, eq. (19)), taken over the whole cross-section: from the
    side, a crest inside the cup hides the wall behind it.

    Args:
        view: camera, pose and container.
        columns: (C,) image columns at which the edges are asked for.
    """

    def __init__(self, view: CupView, columns: Array) -> None:
        self._view = view
        self._columns = columns
        self._x, self._y = _chord_points(view)
        radius = np.hypot(self._x, self._y)
        relative = np.minimum(radius / view.cup.radius, 1.0)
        # Smooth through the axis, where the shape is zero as well.
        slope = radial_shape(1, relative) / np.maximum(radius, 1e-9)
        self._rise_x, self._rise_y = slope * self._x, slope * self._y

    def edges(self, sh_x: float, sh_y: float) -> SurfaceEdges:
        """Returns image rows [px] of the surface's front line and top edge, from heights [m]."""
        cup, height = self._view.cup, float(np.hypot(sh_x, sh_y))
        if cup.taper and height > 0.0:  # as high on the upright wall as its crest is there
            share = float(cup.upright(height)) / height
            sh_x, sh_y = share * sh_x, share * sh_y
        lines = self._rows(self._x, self._y, sh_x * self._rise_x + sh_y * self._rise_y)
        return SurfaceEdges(lines[0], np.fmin.reduce(lines))

    def floor(self) -> Array:
        """Returns the image row [px] of the liquid's lower edge in each image column."""
        level = np.full((1, CHORDS), self._view.cup.upright(-self._view.cup.fill_height))
        (line,) = self._rows(self._x[:1], self._y[:1], level)
        known = np.isfinite(line)
        rows: Array = np.interp(self._columns, self._columns[known], line[known])
        return rows

    def _rows(self, x: Array, y: Array, z: Array) -> Array:
        """Projects curves of points [m]; returns each curve's image row [px] in each column.

        The points are those of the upright cylinder.
        """
        cup = self._view.cup
        points = np.column_stack((x.ravel(), y.ravel(), z.ravel()))
        points /= 1.0 - cup.taper / cup.radius * points[:, 2:]
        pixels = self._view.project(points)
        u, v = pixels[:, 0].reshape(x.shape), pixels[:, 1].reshape(x.shape)
        columns = self._columns
        return np.stack(
            [
                np.interp(columns, across, down, left=np.nan, right=np.nan)
                for across, down in zip(u, v, strict=True)
            ]
        )


def _chord_points(view: CupView) -> tuple[Array, Array]:
    """Returns x and y of points on horizontal rays through the cup, from front to rear wall [m].

    Each row runs from the cup's left edge in the image to its right edge, so that it has one image
    row at every column; the first is the front wall, the last the rear wall.
    """
    centre = view.cup.upright_points(view.pose.camera_centre)
    distance = float(np.hypot(centre[0], centre[1]))
    # Even steps about the cup: close rays at its edges, where the wall turns away.
    aside = view.cup.radius * np.sin(np.linspace(np.pi / 2.0, -np.pi / 2.0, CHORDS))
    off_axis = np.arcsin(aside / distance)
    half = np.sqrt(np.maximum(view.cup.radius**2 - aside**2, 0.0))
    heading = view.camera_azimuth + np.pi + off_axis
    place = np.linspace(-1.0, 1.0, PLACES)[:, np.newaxis] * half
    # The ray's point nearest to the axis, then along the ray.
    x = place * np.cos(heading) - aside * np.sin(heading)
    y = place * np.sin(heading) + aside * np.cos(heading)
    return x, y
