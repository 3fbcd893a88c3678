"""Tests the estimator node's observer over DDS: heights in, fused states and calm out."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import AccelStamped
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Bool

from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_model import Inputs, State, simulate
from slosh_model.model_text import parse_model
from slosh_msgs.action import WaitUntilCalm
from slosh_msgs.msg import Calm, FreeSurface, FusedEstimate, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.hearing_robot import Graph

MS = 1_000_000
TEXT = (
    "container: {shape: cylinder, radius: 0.05, fill_height: 0.07, rim_height: 0.1}\n"
    "damping_ratio: 0.1\n"
)
LENGTH = 2500
"""Of the run [ms]: the wave decays to a hundredth."""


class Cell(Graph):
    """The estimator node, and a robot whose camera shows a wave that no motion caused."""

    def __init__(self) -> None:
        super().__init__(executor=SingleThreadedExecutor())
        self.add(EstimatorNode())
        self.estimates = self.listen(SloshEstimate, topics.ESTIMATE)
        self.fused = self.listen(FusedEstimate, topics.FUSED_ESTIMATE)
        self.calm = self.listen(Calm, topics.CALM, qos.EVENT)
        self.plain = self.listen(Bool, topics.IS_CALM, qos.EVENT)
        self._robot = self.publisher(AccelStamped, topics.ACCEL)
        self._camera = self.publisher(FreeSurface, topics.FREE_SURFACE)
        self.begin = int(self.node.get_clock().now().nanoseconds)
        t = 0.001 * np.arange(LENGTH + 1)
        state = State(-1e-6, np.array([[0.008, -0.003, 0.0, 0.1]]), np.zeros(4))
        inputs = Inputs(t, np.zeros((len(t), 3)))
        self.wave = simulate(parse_model(TEXT).nonlinear(), inputs, state)[0]

    def play(self, first: int, last: int) -> None:
        """Sends inputs from one time to another [ms after the start]."""
        count = len(self.estimates)
        for k in range(first, last, 2):
            if k % 16 == 0:
                self._show(k)
            message = AccelStamped()
            message.header.stamp = to_time(self.begin + k * MS)
            message.header.frame_id = "world"
            self._robot.publish(message)
            count += 1
            self.until(lambda count=count: len(self.estimates) >= count, "an estimate")

    def _show(self, k: int) -> None:
        x, y = self.wave.sh_x[k], self.wave.sh_y[k]
        message = FreeSurface()
        message.header.stamp = to_time(self.begin + k * MS)
        message.msh, message.azimuth = math.hypot(x, y), math.atan2(y, x)
        message.fitted_msh, message.fitted_azimuth = message.msh, message.azimuth
        message.msh_stddev = message.fitted_msh_stddev = 1e-4
        message.azimuth_left, message.azimuth_right = 0.0, 0.5 * math.pi
        message.sh_left, message.sh_right, message.slope_angle = x, y, math.nan
        self._camera.publish(message)


@pytest.fixture
def cell(tmp_path) -> Iterator[Cell]:
    model = tmp_path / "model.yaml"
    model.write_text(TEXT)
    rclpy.init(args=["--ros-args", "-p", f"model:={model}", "-p", "max_age:=60.0"])
    cell = Cell()
    yield cell
    cell.close()
    rclpy.try_shutdown()


def test_a_wave_that_nothing_made_is_followed_until_it_is_calm(cell):
    client = ActionClient(cell.node, WaitUntilCalm, topics.WAIT_UNTIL_CALM)
    cell.until(client.server_is_ready)
    cell.play(0, 200)
    told = []
    goal = cell.got(client.send_goal_async(WaitUntilCalm.Goal(), told.append))
    assert goal.accepted
    outcome = goal.get_result_async()
    cell.play(200, 600)
    state = cell.fused[-1]
    at = (to_nanoseconds(state.header.stamp) - cell.begin) // MS
    assert abs(state.sh_x - cell.wave.sh_x[at]) < 1e-3
    assert state.trusted
    assert state.distance_to_rim == pytest.approx(0.03 - state.msh, abs=1e-12)
    assert state.heights_used > 20
    assert cell.estimates[-1].nonlinear.msh < 1e-4  # the open-loop estimate knows of no wave
    assert (cell.calm[-1].reason, cell.plain[-1].data) == (Calm.SETTLING, False)
    assert 0.0 < cell.calm[-1].shortest_time < cell.calm[-1].time_until_calm
    assert not outcome.done()
    cell.play(600, LENGTH)
    answer = cell.got(outcome)
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
    assert answer.result.calm
    assert answer.result.state.bound <= 1e-3
    assert {Calm.SETTLING, Calm.CALM} <= {one.feedback.state.reason for one in told}
    calm = next(one for one in cell.calm if one.calm)
    at = (to_nanoseconds(calm.header.stamp) - cell.begin) // MS
    assert cell.wave.msh[at:].max() < 1e-3
    client.destroy()


def test_a_silent_input_is_not_calm_and_a_wait_ends(cell):
    cell.play(0, 400)
    client = ActionClient(cell.node, WaitUntilCalm, topics.WAIT_UNTIL_CALM)
    cell.until(client.server_is_ready)
    request = WaitUntilCalm.Goal(tolerance=1e-6, timeout=0.01)
    goal = cell.got(client.send_goal_async(request))
    answer = cell.got(goal.get_result_async())
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert "not calm after" in answer.result.message
    cell.until(lambda: cell.calm[-1].reason == Calm.STALE)
    assert not cell.plain[-1].data
    assert math.isnan(cell.calm[-1].bound)
    waiting = cell.got(client.send_goal_async(WaitUntilCalm.Goal()))
    cell.got(waiting.cancel_goal_async())
    assert cell.got(waiting.get_result_async()).result.message == "cancelled"
    client.destroy()


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"tolerance": 1.0}, "is it in mm?"),
        ({"tolerance": -1e-3}, "tolerance = -0.001 m must be"),
        ({"tolerance": math.nan}, "tolerance = nan m must be"),
        ({"timeout": -1.0}, "timeout = -1 s must not be negative"),
        ({"timeout": math.nan}, "timeout = nan s"),
    ],
)
def test_a_goal_that_cannot_be_is_refused_in_one_line(cell, asked, says):
    client = ActionClient(cell.node, WaitUntilCalm, topics.WAIT_UNTIL_CALM)
    cell.until(client.server_is_ready)
    goal = cell.got(client.send_goal_async(WaitUntilCalm.Goal(**asked)))
    answer = cell.got(goal.get_result_async())
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert says in answer.result.message
    client.destroy()


def test_a_wait_keeps_its_own_tolerance_over_a_silence_of_the_input(cell):
    client = ActionClient(cell.node, WaitUntilCalm, topics.WAIT_UNTIL_CALM)
    cell.until(client.server_is_ready)
    cell.play(0, 200)
    told = []
    request = WaitUntilCalm.Goal(tolerance=1e-5)
    goal = cell.got(client.send_goal_async(request, told.append))
    outcome = goal.get_result_async()
    cell.until(lambda: told and told[-1].feedback.state.reason == Calm.STALE, "silence")
    cell.play(200, LENGTH)  # the wave decays to a tenth of a millimetre
    assert cell.calm[-1].calm
    assert {one.feedback.state.tolerance for one in told} == {1e-5}
    assert not outcome.done()
    cell.got(goal.cancel_goal_async())
    client.destroy()
