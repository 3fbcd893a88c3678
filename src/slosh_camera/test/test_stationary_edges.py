import cv2
import numpy as np
import pytest

from slosh_camera.cylinder.detector import FreeSurfaceDetector
from slosh_camera.cylinder.edge_search import follow_edge
from slosh_camera.cylinder.front_line import moved_edges, no_edges, stationary_edges

ROWS, LINES = 80, 40
LEVEL, LABEL = 50, 30
NOWHERE = np.full((1, LINES), np.nan)


def steps(*edges):
    """Returns a profile that decreases by a given amount at each given row."""
    picture = np.ones((ROWS, LINES), np.float32)
    for row, size in edges:
        picture[row:] -= size
    return picture


STILL = steps((LABEL, 0.3), (LEVEL, 0.5))


def followed(picture, stationary, guess):
    ends = np.zeros(LINES, np.int64)
    return follow_edge(
        picture, stationary, np.full(LINES, float(guess)), 6, np.full(LINES, 78.0), ends,
        np.full(LINES, 0.3),
    )  # fmt: skip


def test_an_edge_that_stood_there_is_none():
    known = stationary_edges(STILL, NOWHERE, 0.0)
    moved = steps((LABEL, 0.3), (60, 0.5))
    row, slope = followed(moved, known, LABEL + 4)
    assert np.all(slope == 0.0)
    # Without a still image it is one, and so is the level, which has moved.
    row, slope = followed(moved, no_edges(moved.shape), LABEL + 4)
    assert np.all(row == LABEL)
    row, slope = followed(moved, known, 58)
    assert np.all(row == 60)
    assert np.all(slope > 0.4)


@pytest.mark.parametrize("size", [0.8, -0.3])
def test_a_stronger_edge_there_is_another_one_and_so_is_a_reversed_one(size):
    known = stationary_edges(STILL, NOWHERE, 0.0)
    place = np.full(LINES, LABEL - 0.5)
    np.testing.assert_array_equal(moved_edges(steps((LABEL, size)), known, place), place)


def test_the_line_at_rest_is_the_liquid_s_own_where_it_is_seen():
    line = np.full((1, LINES), LEVEL - 0.5)
    line[0, :10] = np.nan
    known = stationary_edges(STILL, line, 3.0)
    place = np.full(LINES, LEVEL - 0.5)
    found = moved_edges(STILL, known, place)
    assert np.all(np.isnan(found[:10]))
    np.testing.assert_array_equal(found[10:], place[10:])


# What it is for: a label over the line, with lines of print.


def labelled(image):
    """Draws a paper label over the left part of the wall, nearly as bright as the background."""
    cv2.rectangle(image, (235, 205), (300, 290), 190, -1)
    cv2.rectangle(image, (235, 205), (300, 290), 90, 2)
    for row in (225, 245, 265):
        cv2.line(image, (242, row), (292, row), 60, 4)
    return image


@pytest.mark.first(1)
@pytest.mark.parametrize("azimuth", [-1.6, -2.2, 1.5])
def test_a_label_is_no_liquid(make_scene, azimuth):
    scene = make_scene(noise=2.0, camera_height=0.1)
    detector = FreeSurfaceDetector(scene.calibration())
    detector.learn_still(labelled(scene.draw()))
    for size in (0.004, 0.008, 0.012, 0.016, 0.02):
        result = detector.measure(0, labelled(scene.draw(size, azimuth)))
        assert abs(result.fitted_msh - size) < 2.0 * result.fitted_msh_stddev
