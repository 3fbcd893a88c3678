"""A planned motion as a controller takes it."""

import math

import numpy as np
import pytest

from slosh_plan.planning.execution import execution_of, passing_times
from slosh_plan.planning.known_laws import known_laws
from slosh_plan.planning.path import path_through

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


def test_a_line_is_passed_when_its_law_says():
    times = passing_times(motion_through(LINE), LINE)
    share = 0.25  # of the way, by the quintic 10u³ − 15u⁴ + 6u⁵
    (u,) = (
        root.real
        for root in np.roots([6.0, -15.0, 10.0, 0.0, 0.0, -share])
        if abs(root.imag) < 1e-9 and 0.0 < root.real < 1.0
    )
    assert times[1] == pytest.approx(2.0 * u, abs=1e-5)
