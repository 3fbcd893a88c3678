"""Draws a calibration's predicted edges over the image, for visual inspection."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.board import BoardFit
from slosh_camera.calibrate.curves import SIDES, Curve, curve_points
from slosh_camera.calibrate.still_fit import StillFit
from slosh_camera.images.colour import to_colour
from slosh_camera.images.lettering import letter_size, put_text
from slosh_camera.optics.cup import CupView, Wall

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]

# Blue, green, red.
_FRONT, _REAR, _SIDE, _BASE = (70, 220, 70), (255, 170, 40), (60, 220, 255), (200, 80, 200)
_AXES = ((0, 0, 255), (0, 255, 0), (255, 0, 0))  # x, y, z
_SMALL_WIDTH = 1000
_SHIFT = 4
_COUNT = 181


def draw_calibration(image: Image, fit: StillFit, board: BoardFit | None = None) -> Image:
    """Draws the container's predicted edges and liquid level over the image.

    Green is the still level on the front wall, blue on the rear wall, yellow the outer sides and
    the rim, violet the floor; where they lie on what they name, the pose is right.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red; not changed.
        fit: the pose.
        board: the board found, whose axes are drawn.

    Returns:
        (height, width, 3) blue-green-red picture, of double size where the image is small.
    """
    zoom = 2 if image.shape[1] < _SMALL_WIDTH else 1
    size = (zoom * image.shape[1], zoom * image.shape[0])
    picture = np.array(
        cv2.resize(to_colour(image), size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8
    )
    for curve in Curve:
        _draw(picture, curve_points(fit.view, curve, _COUNT), zoom, _colour(curve))
    _draw_rim(picture, fit.view, zoom)
    if board is not None:
        _draw_axes(picture, fit, board, zoom)
    letters = letter_size(picture)
    place = (round(8 * letters), picture.shape[0] - round(12 * letters))
    put_text(picture, _caption(fit), place, letters)
    return picture


def _colour(curve: Curve) -> tuple[int, int, int]:
    if curve in SIDES:
        return _SIDE
    return {Curve.FRONT: _FRONT, Curve.REAR: _REAR}.get(curve, _BASE)


def _draw_rim(picture: Image, view: CupView, zoom: int) -> None:
    rim = view.cup.rim_level
    if rim is None:
        return
    arc = view.camera_azimuth + np.deg2rad(np.linspace(-76.0, 76.0, _COUNT))
    _draw(picture, view.project_wall(arc, rim, Wall.FRONT), zoom, _SIDE)
    # From above the rim its far side is seen over it, not through the front wall.
    if view.pose.camera_centre[2] < rim:
        _draw(picture, view.project_wall(arc + np.pi, rim, Wall.REAR), zoom, _SIDE)


def _draw(picture: Image, points: FloatArray, zoom: int, colour: tuple[int, int, int]) -> None:
    known = points[np.all(np.isfinite(points), axis=1)]
    if len(known) < 2:
        return
    place = np.clip((known + 0.5) * zoom - 0.5, -1e4, 1e4)
    fixed = np.round(place * (1 << _SHIFT)).astype(np.int32)
    cv2.polylines(picture, [fixed], False, colour, 1, cv2.LINE_AA, _SHIFT)


def _draw_axes(picture: Image, fit: StillFit, board: BoardFit, zoom: int) -> None:
    camera, pose = fit.view.camera, board.pose
    corners = np.vstack((np.zeros(3), 0.4 * fit.view.cup.radius * np.eye(3)))
    origin, *ends = camera.project(corners @ pose.rotation.T + pose.translation)
    for end, colour in zip(ends, _AXES, strict=True):
        _draw(picture, np.array([origin, end]), zoom, colour)


def _caption(fit: StillFit) -> str:
    worst = 1e3 * max(fit.height_stddev.values())
    return f"residual {fit.residual:.2f} px, heights to {worst:.2f} mm (1 sigma)"
