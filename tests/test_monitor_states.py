"""Tests the monitor's states: silence, a stopped clock, and disagreement."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import rclpy
from std_srvs.srv import Trigger

from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_msgs.msg import SloshComparison
from slosh_msgs_py import topics
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_testing.robot import MODEL, RobotNode, nodes_and_robot

OK, WARN, ERROR = SloshComparison.STATE_OK, SloshComparison.STATE_WARN, SloshComparison.STATE_ERROR
STALE, BLIND = SloshComparison.STATE_STALE, SloshComparison.STATE_BLIND
pytestmark = pytest.mark.timeout(200)


@contextmanager
def monitor_alone(
    folder: Path, domain: int, namespace: str, **nodes: dict[str, str]
) -> Iterator[tuple[NodeGroup, RobotNode]]:
    """Starts nodes with given parameters, and a robot that has not published yet."""
    (folder / "model.yaml").write_text(MODEL)
    with ExitStack() as stack:
        if not rclpy.ok():
            rclpy.init()
            stack.callback(rclpy.shutdown)
        environment = node_environment(domain)
        group = stack.enter_context(NodeGroup(namespace, folder / "logs", environment))
        robot = RobotNode("robot", topics.ACCEL, namespace)
        stack.callback(robot.close)
        robot.listen()
        for name, values in nodes.items():
            group.start(NodeProcess(name, (), values))
        robot.until(lambda: "monitor" in robot.health, "the monitor", speak=False)
        yield group, robot
        assert group.failed() is None


def by_report(robot: RobotNode, reports: int) -> list[list[SloshComparison]]:
    """Returns the comparisons between successive reports of the monitor, one per second."""
    found = []
    for _ in range(reports):
        robot.health.pop("monitor", None)
        count = len(robot.comparisons)
        robot.until(lambda: "monitor" in robot.health, "a report", speak=False)
        found.append(robot.comparisons[count:])
    return found[1:]  # the first may have begun anywhere in its second


@pytest.mark.long
def test_a_monitor_that_hears_nothing_says_so_at_least_twice_a_second(
    tmp_path: Path, domain: int
) -> None:
    with monitor_alone(tmp_path, domain, "/silent", monitor={}) as (_, robot):
        robot.until(lambda: robot.comparisons, "a heartbeat", speak=False)
        seconds = by_report(robot, 4)
        assert [len(second) >= 2 for second in seconds] == [True] * 3
        for one in robot.comparisons:
            assert one.state == STALE
            assert one.measured_stale
            assert one.estimate_stale
            assert math.isnan(one.measured)
            assert math.isnan(one.estimated_nonlinear)
            assert to_nanoseconds(one.header.stamp) == 0  # nothing has ever come


@pytest.mark.first(1)
@pytest.mark.parametrize("constant", [0.0, 0.7])
def test_a_dead_accelerometer_under_a_wave(tmp_path: Path, domain: int, constant: float) -> None:
    with nodes_and_robot(tmp_path, domain, namespace="/dead") as (_, robot):
        robot.push = lambda t: constant
        robot.until(lambda: robot.estimates[-1].acceleration[0] == constant, "the constant")
        robot.for_seconds(2.0)  # the liquid of the model comes to rest

        def sees(condition: Callable[[], bool]) -> Callable[[], bool]:
            def look() -> bool:
                robot.surface.msh = 8.9e-3 * abs(math.sin(15.0 * time.time()))
                return condition()

            return look

        robot.until(sees(lambda: robot.comparisons[-1].sides_disagree), "the disagreement")
        robot.until(sees(lambda: robot.comparisons[-1].state == WARN), "the state WARN")
        robot.until(sees(lambda: robot.health["monitor"][0] == WARN), "the diagnostics")
        said = robot.health["monitor"][1]
        if constant == 0.0:
            assert said.startswith("the camera sees a wave of 8.")
            assert said.endswith("shows no motion: check the accelerometer")
        robot.surface.msh = 1e-4
        count = len(robot.comparisons)
        robot.until(lambda: len(robot.comparisons) > count + 20, "rest")
        assert robot.comparisons[-1].sides_disagree  # until a motion agrees, or a reset
        assert robot.call(Trigger, "monitor/reset").success
        robot.until(lambda: robot.comparisons[-1].state == OK, "the state OK")
