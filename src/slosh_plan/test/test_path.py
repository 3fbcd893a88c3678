import math

import numpy as np
import pytest

from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.execution import execution_of
from slosh_plan.planning.known_laws import known_laws
from slosh_plan.planning.path import MOST_POINTS, path_through
from slosh_plan.planning.progress import StoppedError


def circle(count, turns=1.0):
    angle = np.linspace(0.0, 2.0 * np.pi * turns, count)
    return 0.25 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])


def test_a_path_is_by_its_length_and_smooth():
    path = path_through(circle(2000))
    (leg,) = path.legs
    assert leg.length == pytest.approx(0.5 * np.pi, rel=1e-4)
    _, tangent, bend, change = leg.at(np.linspace(0.0, leg.length, 5001))
    assert np.linalg.norm(tangent, axis=1) == pytest.approx(1.0, abs=2e-3)
    assert np.linalg.norm(bend, axis=1) == pytest.approx(4.0, rel=0.05)
    assert np.abs(change).max() < 25.0


@pytest.mark.parametrize("count", [9, 60, 3000])
def test_every_waypoint_is_kept(count):
    points = circle(count, 2.0 if count > 20 else 1.0)
    (leg,) = path_through(points).legs
    curve = leg.at(np.linspace(0.0, leg.length, 200_001))[0]
    for point in points[:: max(1, count // 20)]:
        assert np.linalg.norm(curve - point, axis=1).min() < 1e-4


@pytest.mark.parametrize("count", [3, 4, 5, 6])
def test_few_points_at_uneven_distances(count):
    shares = np.array([0.0, 0.07, 0.3, 0.36, 0.8, 1.0])[[*range(count - 1), 5]]
    points = np.column_stack([0.6 * shares, 0.1 * np.sin(3.0 * shares), 0.05 * shares**2])
    (leg,) = path_through(points).legs
    curve = leg.at(np.linspace(0.0, leg.length, 100_001))[0]
    assert max(np.linalg.norm(curve - point, axis=1).min() for point in points) < 1e-4


def test_a_corner_is_a_stop():
    path = path_through(np.array([[0.0, 0, 0], [0.2, 0, 0], [0.2, 0.3, 0]]))
    assert [leg.length for leg in path.legs] == pytest.approx([0.2, 0.3])
    assert path.reversals == (False,)


@pytest.mark.parametrize(
    ("points", "text"),
    [
        (np.zeros((1, 3)), "no length"),
        (np.zeros((5, 3)), "no length"),
        (np.array([[0.0, 0, 0], [1e-4, 0, 0]]), "less than 1 mm"),
        (np.array([[0.0, 0, 0], [np.nan, 0, 0]]), "waypoint 1 has x = nan"),
        (np.zeros((MOST_POINTS + 1, 3)), "take fewer"),
        (np.zeros((4, 2)), "shape"),
    ],
)
def test_what_is_no_path(points, text):
    with pytest.raises(SloshPlanError, match=text):
        path_through(points)


def test_a_path_with_too_many_corners_is_refused_and_one_is_stopped():
    zigzag = np.array([[0.01 * k, 0.05 * (k % 2), 0.0] for k in range(100)])
    with pytest.raises(SloshPlanError, match="at 98 waypoints, where the container stops"):
        path_through(zigzag)
    with pytest.raises(StoppedError, match="take fewer waypoints"):
        path_through(zigzag[:20], stopped=lambda: True)


# A planned motion as a controller takes it.


LINE = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.4, 0.0, 0.0]])
CORNER = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.2, 0.0]])
BACK = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.1, 0.0, 0.0]])
EIGHT = np.array(
    [[math.sin(a), math.sin(2 * a), 0.0] for a in np.linspace(0.0, 2.0 * math.pi, 41)]
) * [0.4, 0.2, 0.0]  # fmt: skip


def motion_through(points):
    return known_laws(path_through(points))["quintic"].motion(2.0)


@pytest.mark.parametrize(
    "points", [LINE, CORNER, BACK, EIGHT], ids=["line", "corner", "back", "8"]
)
def test_each_waypoint_is_passed_in_its_turn(points):
    motion = motion_through(points)
    run = execution_of(motion, points)
    assert np.abs(run.position[run.waypoints] - points).max() < 1e-4
    assert (np.diff(run.waypoints) > 0).all()
    assert run.waypoints[0] == 0
    assert run.waypoints[-1] == len(run.t) - 1
    assert np.diff(run.t).min() > 1e-5


def test_the_rows_between_follow_from_their_neighbours():
    motion = motion_through(EIGHT)
    run = execution_of(motion, EIGHT)
    assert len(run.t) > len(motion.t)
    step = np.diff(run.t)[:, None]
    gained = 0.5 * (run.acceleration[1:] + run.acceleration[:-1]) * step
    assert np.abs(np.diff(run.velocity, axis=0) - gained).max() < 2e-5
    moved = 0.5 * (run.velocity[1:] + run.velocity[:-1]) * step
    assert np.abs(np.diff(run.position, axis=0) - moved).max() < 1e-6
    kept = np.isin(run.t, motion.t)
    assert np.array_equal(run.acceleration[kept], motion.acceleration)
    assert not run.velocity[[0, -1]].any()
