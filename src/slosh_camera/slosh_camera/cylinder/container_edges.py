"""Checks whether the container has the same orientation in the image as in the calibration.

Both of its sides are straight lines in the image. A camera that has been pushed sees them turned,
and would read the turn as a tilt of the liquid: 2 degrees are 1.7 mm on a radius of 50 mm. Where
exactly a side is seen, at the outer or the inner face of the wall, does not count.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba.types import float32, float64
from numpy.typing import NDArray

from slosh_base.compiled.compilation import entry_point, given
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.images.colour import Image, to_gray
from slosh_camera.optics.cup import CupView

FloatArray = NDArray[np.float64]

# Heights on each side at which an edge is looked for, and how far beside it [px].
_HEIGHTS = 24
_REACH = 20
# Turns [rad] and shifts [px] that are tried.
_TURNS = np.radians(np.arange(-5.0, 5.25, 0.5))
_SHIFTS = np.arange(-9.0, 10.0, 1.0)
_HALF_EDGE = TUNING.side_half_edge


class ContainerEdges:
    """Detects the left and right side of the container in images."""

    def __init__(self, view: CupView) -> None:
        """Projects the container's sides; disables the check if too little is visible of them."""
        sides = [_side(view, left) for left in (True, False)]
        self._able = all(len(side) >= TUNING.least_samples for side in sides)
        places = np.vstack(sides)
        self._first = len(sides[0])
        middle = float(np.mean(places[:, 1])) if len(places) else 0.0
        self._height = np.ascontiguousarray(middle - places[:, 1])
        across = places[:, :1] + np.arange(-_REACH, _REACH + 1)
        down = np.repeat(places[:, 1:], across.shape[1], axis=1)
        self._map = across.astype(np.float32), down.astype(np.float32)

    def turn(self, image: Image) -> float:
        """Returns the rotation of the sides relative to the calibration [rad]."""
        return (
            float(_TURNS[int(np.argmax(self._scores(image).sum(axis=0)))]) if self._able else 0.0
        )

    def turned(self, image: Image, usual: float) -> bool:
        """Whether both sides are rotated equally, and clearly, from their usual direction."""
        if not self._able:
            return False
        scores = self._scores(image)
        best = int(np.argmax(scores.sum(axis=0)))
        if (
            abs(_TURNS[best] - usual) < TUNING.turned
            or scores[:, best].sum() < TUNING.least_turn_score
        ):
            return False
        near = scores[:, np.abs(_TURNS - usual) < 0.6 * TUNING.turned].max(axis=1)
        gain = scores[:, best] / near
        return bool(np.mean(gain) > TUNING.turn_better and np.min(gain) > TUNING.turn_better_each)

    def _scores(self, image: Image) -> FloatArray:
        """Scores trial rotations of the left and the right side, (2, turns), by edge strength."""
        strips = cv2.remap(image, *self._map, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        levels = to_gray(np.asarray(strips, np.uint8)).astype(np.float32)
        parts = slice(None, self._first), slice(self._first, None)
        return np.array(
            [_agreement(levels[part], self._height[part], _TURNS, _SHIFTS) for part in parts]
        )


def _side(view: CupView, left: bool) -> FloatArray:
    """Returns the visible image points (N, 2) of the outer wall's left or right side."""
    cup, half = view.cup, view.side_half_angle
    top = (
        TUNING.side_unknown_rim * cup.radius
        if cup.rim_level is None
        else TUNING.side_above * cup.rim_level
    )
    level = np.linspace(-TUNING.wall_depth * cup.fill_height, top, _HEIGHTS)
    azimuth = view.camera_azimuth + (half if left else -half)
    pixels = view.project(cup.outer_points(azimuth, level))
    margin = _REACH // 2
    size = np.array([view.camera.width, view.camera.height])
    with np.errstate(invalid="ignore"):
        inside = np.all((pixels > (margin, 2)) & (pixels < size - (margin, 3)), axis=1)
    return np.asarray(pixels[inside])


@entry_point(float64[::1](given(float32, 2), *3 * [given(float64, 1)]))
def _agreement(strips, height, turns, shifts):  # type: ignore[no-untyped-def]
    """Returns the mean edge strength along a side for each trial rotation.

    Args:
        strips: (N, 2 reach + 1) grey levels across the sides.
        height: (N,) above the middle of the sides [px].
        turns: (T,) [rad]. shifts: (S,) [px].

    Returns:
        (T,) of the best shift, between 0 and 1.
    """
    rows, columns = strips.shape
    edges = np.zeros((rows, columns))
    for n in range(rows):
        for k in range(1, columns - 1):
            slope = 0.5 * abs(strips[n, k + 1] - strips[n, k - 1])
            edges[n, k] = slope / (slope + _HALF_EDGE)
    best = np.zeros(turns.size)
    scores = np.empty(shifts.size)
    for t in range(turns.size):
        scores[:] = 0.0
        for n in range(rows):
            for s in range(shifts.size):
                place = columns // 2 + shifts[s] + turns[t] * height[n]
                k = min(max(int(place), 0), columns - 2)
                part = min(max(place - k, 0.0), 1.0)
                scores[s] += edges[n, k] + part * (edges[n, k + 1] - edges[n, k])
        best[t] = np.max(scores) / rows
    return best
