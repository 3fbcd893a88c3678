"""The simulated cell's motions."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from slosh_bringup.cell.motions import LEVELS, MOTIONS, VERTICAL_LEVELS, make_motion
from slosh_bringup.errors import SloshBringupError


@pytest.mark.first(8)
@pytest.mark.parametrize("name", MOTIONS)
def test_motions_start_and_end_at_rest_and_move_as_they_accelerate(name):
    motion = make_motion(name)
    velocity = cumulative_simpson(motion.acceleration, x=motion.t, axis=0, initial=0)
    position = cumulative_simpson(velocity, x=motion.t, axis=0, initial=0)
    assert velocity[-1] == pytest.approx(np.zeros(3), abs=1e-4)
    assert position == pytest.approx(motion.position, abs=1e-3)
    assert not motion.acceleration[motion.t < 0.99].any()
    assert not motion.acceleration[motion.t > motion.t[-1] - 2.9].any()


@pytest.mark.parametrize("path", LEVELS)
def test_levels_are_those_of_the_paper(path):
    for level in LEVELS[path]:
        a = make_motion(f"{path}-{level}").acceleration
        assert np.hypot(a[:, 0], a[:, 1]).max() == pytest.approx(level, rel=1e-3)
        assert not a[:, 2].any()
    for vertical in VERTICAL_LEVELS:
        a = make_motion(f"{path}3-{vertical}").acceleration
        assert np.abs(a[:, 2]).max() == pytest.approx(vertical, rel=1e-3)
        assert np.hypot(a[:, 0], a[:, 1]).max() == pytest.approx(LEVELS[path][1], rel=1e-3)


def test_vertical_motion_leaves_the_planar_one_as_it_is():
    """DL22, section 4.1: seen from above, the spatial paths are the planar ones."""
    planar, spatial = make_motion("c-8.9"), make_motion("c3-4.5")
    assert np.array_equal(planar.position[:, :2], spatial.position[:, :2])
    assert np.array_equal(planar.acceleration[:, :2], spatial.acceleration[:, :2])
    assert np.ptp(spatial.position[:, 2]) > 0.1


def test_paths_have_their_shape_and_size():
    line, eight, circle = (make_motion(name).position for name in ("l", "e", "c"))
    assert not line[:, 0].any()
    assert np.ptp(line[:, 1]) == pytest.approx(0.4, abs=1e-4)
    assert np.ptp(eight, axis=0)[:2] == pytest.approx((0.8, 0.38), abs=1e-4)
    centre = np.array([-0.25, 0.0, 0.0])
    assert np.linalg.norm(circle - centre, axis=1) == pytest.approx(0.25)
    turned = np.unwrap(np.arctan2(circle[:, 1], circle[:, 0] + 0.25))
    assert turned[-1] - turned[0] == pytest.approx(4.0 * np.pi)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_a_rate_that_is_none_is_refused(rate):
    with pytest.raises(SloshBringupError, match="must be positive"):
        make_motion("c", rate)


def test_repeats_follow_one_another():
    once = make_motion("c3", 100.0)
    thrice = once.repeated(3)
    assert np.diff(thrice.t) == pytest.approx(0.01)
    assert np.array_equal(thrice.acceleration, np.tile(once.acceleration, (3, 1)))
    assert thrice.attitude is None
