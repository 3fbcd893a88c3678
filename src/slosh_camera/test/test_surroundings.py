"""What is beside the container, and so behind it."""

import numpy as np
import pytest

from slosh_camera.cylinder.appearance import Tone
from slosh_camera.cylinder.surroundings import Backdrop

WIDE, HIGH, EDGE = 300, 240, 120
TONE = Tone(np.array([30.0]), np.array([200.0]), np.array([1.0 / 170.0]), 0.01)


def grid(left=100.0, right=200.0):
    """Scan lines of a container, upright from the image's top to its bottom."""
    rows, lines = np.mgrid[0.0:HIGH, 0:50]
    return np.stack([left + (right - left) * lines / 49.0, rows], axis=-1)


def room(table=47):
    """A light wall above a dark table."""
    image = np.full((HIGH, WIDE), 200, np.uint8)
    image[EDGE:] = table
    return image


def test_a_dark_table_beside_the_container_is_expected_behind_it():
    found = Backdrop(grid(), (WIDE, HIGH)).reduced(room(), TONE)
    assert found.shape == (HIGH, 50)
    assert found[: EDGE - 10] == pytest.approx(1.0)
    assert found[EDGE + 10 :] == pytest.approx(0.1, abs=0.01)


def test_what_is_far_behind_goes_straight_on_where_rows_of_the_wall_are_bent():
    # Seen from above, a height on the front wall is lower in the image in its middle.
    bent = grid()
    sag = 20.0 * np.sin(np.pi * np.arange(50) / 49.0)
    bent[..., 1] += sag
    found = Backdrop(bent, (WIDE, HIGH)).reduced(room(), TONE)
    edge = np.argmax(found < 0.5, axis=0)
    assert np.abs(edge - (EDGE - sag)).max() < 6.0
    assert edge[0] - edge[25] == pytest.approx(20, abs=1)


def test_between_two_sides_it_goes_over_from_one_to_the_other():
    image = room()
    image[:, WIDE // 2 :] = 200
    found = Backdrop(grid(), (WIDE, HIGH)).reduced(image, TONE)[EDGE + 20]
    assert found[0] == pytest.approx(0.1, abs=0.01)
    assert found[-1] == pytest.approx(1.0)
    assert np.all(np.diff(found) > 0.0)
