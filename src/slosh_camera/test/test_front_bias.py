"""Tests the contact line's bias at rest and the heights at which it is applied."""

from types import SimpleNamespace

import numpy as np
import pytest

from slosh_camera.cylinder.front_line import FrontBias
from slosh_camera.cylinder.surface import SHAPES, WallPoints, wall_shapes

MM, LINES, ROW = 1e-3, 60, 0.4e-3
AZIMUTH = np.linspace(-2.6, -0.5, LINES)
UNEVEN = 0.3 * MM * np.cos(3.0 * AZIMUTH)
ZERO = np.zeros(SHAPES)
ZERO[0] = -0.2 * MM


def line(height, known=True):
    """Returns contact-line points and a fit that agrees with all, or none, of them."""
    points = WallPoints(
        place=np.zeros(LINES),
        azimuth=AZIMUTH,
        height=np.asarray(height),
        shapes=wall_shapes(AZIMUTH),
        bound=np.zeros(LINES, np.bool_),
        width=np.full(LINES, 2.0),
        scale=np.full(LINES, 0.3 * MM),
    )
    return SimpleNamespace(points=points, front_weight=np.full(LINES, float(known)))


BIAS = FrontBias.at_rest(line(ZERO[0] + UNEVEN), ZERO, ROW)


def test_a_line_that_has_risen_by_many_rows_is_seen_through_another_place():
    risen = line(ZERO[0] + 12.0 * ROW + UNEVEN).points
    assert BIAS.removed(risen).height == pytest.approx(risen.height, abs=1e-3 * MM)


def test_it_fades_with_the_rise_on_either_side():
    left = [
        np.max(
            np.abs(
                BIAS.removed(line(ZERO[0] + rows * ROW + UNEVEN).points).height
                - ZERO[0]
                - rows * ROW
            )
        )
        for rows in (0.0, 2.0, 4.0, 8.0)
    ]
    assert left == sorted(left)
    fallen = BIAS.removed(line(ZERO[0] - 2.0 * ROW + UNEVEN).points).height
    assert np.max(np.abs(fallen - ZERO[0] + 2.0 * ROW)) == pytest.approx(left[1], rel=0.01)


def test_single_points_that_err_are_averaged():
    speck = np.zeros(LINES)
    speck[30] = 1.0 * MM
    bias = FrontBias.at_rest(line(ZERO[0] + speck), ZERO, ROW)
    assert np.max(bias.offset) == pytest.approx(0.2 * MM)
