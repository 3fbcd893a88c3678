"""Tests that nodes flag and name an input that is not what it claims to be, over DDS."""

from pathlib import Path

import pytest

from slosh_msgs.msg import SloshEstimate
from slosh_msgs_py import topics
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_testing.robot import GRAVITY, RobotNode, nodes_and_robot

WARN, ERROR = 1, 2
DOUBTFUL = SloshEstimate.INPUT_DOUBTFUL
DOWN = (1.0, 0.0, 0.0, 0.0)
pytestmark = pytest.mark.timeout(120)


def flagged(robot: RobotNode) -> bool:
    return bool(robot.estimates and robot.estimates[-1].flags & DOUBTFUL)


def says(robot: RobotNode, level: int, sentence: str) -> bool:
    said = robot.health.get("estimator", (0, ""))
    return said[0] == level and sentence in said[1]


def test_gravity_in_the_acceleration_is_flagged_and_named(tmp_path: Path, domain: int) -> None:
    with nodes_and_robot(tmp_path, domain) as (_, robot):
        assert not flagged(robot)
        robot.lift = GRAVITY
        begin = robot.time_ns()
        robot.until(lambda: flagged(robot), "the flag")
        seconds = (to_nanoseconds(robot.estimates[-1].header.stamp) - begin) * 1e-9
        assert 0.4 < seconds < 1.5
        robot.until(lambda: says(robot, ERROR, "gravity is contained, along +z"), "the reason")
        robot.lift = 0.0
        robot.until(lambda: not flagged(robot), "an end")


@pytest.mark.long
def test_a_tool_that_points_down_is_flagged_and_the_remedy_cures_it(
    tmp_path: Path, domain: int
) -> None:
    with nodes_and_robot(tmp_path, domain, kind=topics.POSE, attitude=DOWN) as (_, robot):
        robot.until(lambda: flagged(robot), "the flag")
        robot.until(lambda: says(robot, ERROR, "z axis at rest points down"), "the reason")
        assert "set sensor_rotation to [3.1416, 0.0000, 0.0000]" in robot.health["estimator"][1]
    (tmp_path / "cured").mkdir()
    remedy = {"estimator": {"sensor_rotation": "[3.1416, 0.0, 0.0]"}}
    cured = nodes_and_robot(tmp_path / "cured", domain, remedy, topics.POSE, attitude=DOWN)
    with cured as (_, robot):
        robot.for_seconds(1.5)
        assert not flagged(robot)
