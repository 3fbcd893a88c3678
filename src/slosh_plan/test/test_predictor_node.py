"""Tests the predictor node over DDS: answers, refusals and further requests."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Transform, Twist
from rclpy.executors import SingleThreadedExecutor
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from slosh_estimator.errors import SloshEstimatorError
from slosh_model.model_text import parse_model
from slosh_model.motion_profiles import quintic
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.robot import available
from slosh_msgs.msg import (
    ContainerChange,
    FusedEstimate,
    MotionPrediction,
    PredictionOutcome,
    SloshEstimate,
)
from slosh_msgs.srv import PredictSlosh
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.node.diagnostics import WARN
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_plan import HeightLimits, LiquidState, Trajectory, predict, safe_scales
from slosh_plan.nodes.predict_messages import trajectory_of
from slosh_plan.nodes.predictor_node import PredictorNode
from slosh_plan.robot_file import read_arm
from slosh_testing.hearing_robot import Graph

TEXT = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
damping_ratio: auto
effects: [{name: vertical_acceleration}]
"""
MODEL = parse_model(TEXT, "text")
JOINTS = JointTrajectory(joint_names=["slide"], points=[JointTrajectoryPoint()])


class Cell(Graph):
    """The predictor node with a client."""

    def __init__(self) -> None:
        super().__init__(executor=SingleThreadedExecutor())
        self.probe, self.predictor = self.node, self.add(PredictorNode())
        self.client = self.probe.create_client(PredictSlosh, topics.PREDICT)
        self.until(self.client.service_is_ready)

    def ask(self, **fields: Any) -> PredictSlosh.Response:
        return self.got(self.client.call_async(request(**fields)))


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cell]:
    model = tmp_path_factory.mktemp("model") / "model.yaml"
    model.write_text(TEXT)
    rclpy.init(
        args=["--ros-args", "-p", f"model:={model}", "-p", "scales:=200", "-p", "limit:=0.012"]
    )
    made = Cell()
    yield made
    made.close()
    rclpy.try_shutdown()


def motion() -> Trajectory:
    t = np.linspace(0.0, 1.0, 501)
    position, _, acceleration = quintic(t)
    x = np.array([0.4, 0.0, 0.0])
    return Trajectory(t, np.outer(acceleration, x), position=np.outer(position, x))


def request(**fields: Any) -> PredictSlosh.Request:
    one = motion()
    values: dict[str, Any] = {"time": one.t.tolist(), "limit": math.nan}
    columns = one.acceleration.T.tolist()
    values |= {f"acceleration_{axis}": column for axis, column in zip("xyz", columns, strict=True)}
    message = PredictSlosh.Request()
    for name, value in {**values, **fields}.items():
        setattr(message, name, value)
    return message


def test_it_answers_like_the_core(cell: Cell) -> None:
    limits = HeightLimits(0.015, 0.002)
    answer = cell.ask(limit=0.015, residual_limit=0.002, sigma=0.0005)
    (found,) = predict(MODEL, motion(), limits=limits)
    assert answer.success, answer.message
    assert answer.message == "a limit is exceeded"
    assert answer.peak_linear == found.linear.peak
    assert answer.peak_nonlinear == found.nonlinear.peak
    assert answer.peak_upper == pytest.approx(found.nonlinear.peak + 0.001)
    assert answer.peak_time == found.nonlinear.peak_time
    assert answer.residual_nonlinear == found.nonlinear.residual
    assert answer.settling_time == found.nonlinear.settling_time
    assert answer.excess == pytest.approx(answer.peak_upper - 0.015)
    scales = safe_scales(MODEL, motion(), limits, margin=0.001, count=200)
    assert answer.time_scale == pytest.approx(scales.safe_from)
    both = zip(answer.safe_from, answer.safe_to, strict=True)
    assert [value for pair in both for value in pair] == pytest.approx(sum(scales.intervals, ()))


def points(*, poses: bool) -> list[MultiDOFJointTrajectoryPoint]:
    one = motion()
    made = []
    for t, position, acceleration in zip(one.t, one.position, one.acceleration, strict=True):
        point = MultiDOFJointTrajectoryPoint()
        point.time_from_start.sec = int(t)
        point.time_from_start.nanosec = round((t % 1.0) * 1e9)
        if poses:
            transform = Transform()
            transform.translation.x, transform.rotation.w = float(position[0]), 1.0
            point.transforms = [transform]
        else:
            twist = Twist()
            twist.linear.x = float(acceleration[0])
            point.accelerations = [twist]
        made.append(point)
    return made


@pytest.mark.parametrize("poses", [False, True])
def test_a_planners_trajectory_is_taken(cell: Cell, poses: bool) -> None:
    made = PredictSlosh.Request()
    made.trajectory.points = points(poses=poses)
    answer = cell.ask(time=[], trajectory=made.trajectory)
    assert answer.success, answer.message
    assert answer.peak_nonlinear == pytest.approx(cell.ask().peak_nonlinear, rel=1e-3)


@pytest.mark.parametrize("factor", [0.0, 100.0])
def test_poses_that_move_with_accelerations_of_another_motion_are_refused(
    cell: Cell, factor: float
) -> None:
    made = PredictSlosh.Request()
    made.trajectory.points = points(poses=True)
    for point, other in zip(made.trajectory.points, points(poses=False), strict=True):
        point.accelerations = other.accelerations
        point.velocities = [Twist()]
    both = cell.ask(time=[], trajectory=made.trajectory)
    assert both.success, both.message
    assert both.peak_nonlinear == pytest.approx(cell.ask().peak_nonlinear, rel=1e-3)
    for point in made.trajectory.points:
        point.accelerations[0].linear.x *= factor
    answer = cell.ask(time=[], trajectory=made.trajectory)
    assert not answer.success
    assert math.isnan(answer.peak_nonlinear)
    assert "positions and accelerations contradict each other" in answer.message


def test_a_request_for_too_many_samples_is_refused_with_the_remedy(cell: Cell) -> None:
    t = np.linspace(0.0, 600.0, 60_001)
    fields: dict[str, Any] = {"time": t.tolist(), "acceleration_x": np.sin(t).tolist()}
    fields |= {f"acceleration_{axis}": [0.0] * len(t) for axis in "yz"}
    answer = cell.ask(**fields, limit=0.01)
    assert not answer.success
    assert "above the bound of 10 million: leave the time scales out" in answer.message
    answer = cell.ask(**fields, limit=0.01, no_time_scales=True)
    assert answer.success, answer.message
    assert answer.peak_nonlinear > 0.0


@pytest.mark.parametrize(
    ("fields", "match"),
    [
        ({"time": [1.0] * 501}, "the motion lasts 0 s"),
        ({"time": []}, "give the motion either as time and acceleration or a trajectory"),
        (
            {"time": [], "joint_trajectory": JOINTS},
            "the robot of the joint_trajectory is not known",
        ),
        ({"joint_trajectory": JOINTS}, "give the motion either as"),
        ({"acceleration_y": [0.0]}, "acceleration_y has 1 values, time has 501"),
        ({"acceleration_x": [math.nan] * 501}, "acceleration[0].x = nan is not finite"),
        ({"limit": -1.0}, "height limit = -1.0 m must lie above 0"),
        ({"horizon": 1e9}, "horizon"),
        ({"sigma": -1.0}, "sigma"),
        ({"model_path": "/nowhere/model.yaml"}, "/nowhere/model.yaml"),
        ({"from_estimate": True}, "no estimate has come on /estimate"),
    ],
)
def test_what_cannot_be_answered_is_refused_and_the_node_goes_on(
    cell: Cell, fields: dict[str, Any], match: str
) -> None:
    answer = cell.ask(**fields)
    assert not answer.success
    assert match in answer.message
    assert math.isnan(answer.peak_nonlinear)
    assert cell.predictor.faults.total == 0
    assert cell.ask().success


def published(
    cell: Cell, publisher: Any, message: Any, age: float, limit: float
) -> PredictSlosh.Response:
    """Returns the prediction from a published liquid state of a given age [s]."""
    now = cell.probe.get_clock().now().nanoseconds
    message.header.stamp = to_time(int(now - age * 1e9))
    publisher.publish(message)
    publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=1))
    time.sleep(0.1)
    return cell.ask(from_estimate=True, limit=limit)


def soon(ask: Callable[[], PredictSlosh.Response]) -> PredictSlosh.Response:
    """Returns the first successful response of up to ten requests."""
    for _ in range(10):
        answer = ask()
        if answer.success:
            break
    assert answer.success, answer.message
    return answer


def test_the_liquid_goes_on_from_the_estimate(cell: Cell) -> None:
    publisher = cell.probe.create_publisher(SloshEstimate, topics.ESTIMATE, qos.STREAM_OUT)
    cell.until(lambda: publisher.get_subscription_count() > 0)

    def told(age: float, flags: int = 0) -> PredictSlosh.Response:
        message = SloshEstimate(flags=flags)
        for answer in (message.linear, message.nonlinear):
            answer.modal_position, answer.modal_velocity = [0.002, 0.0], [0.0, 0.01]
        return published(cell, publisher, message, age, 0.02)

    answer = soon(lambda: told(0.0))
    state = LiquidState([[0.002, 0.0, 0.0, 0.01]], [[0.002, 0.0, 0.0, 0.01]])
    (found,) = predict(MODEL, motion(), state=state)
    assert answer.peak_nonlinear == found.nonlinear.peak
    assert answer.peak_nonlinear != cell.ask().peak_nonlinear
    assert "s old" in told(5.0).message
    assert "0x20" in told(0.0, flags=0x20).message
    high = cell.ask(from_estimate=True, limit=0.001)
    assert not high.success
    cell.probe.destroy_publisher(publisher)


def test_the_liquid_goes_on_from_a_trusted_fused_state(cell: Cell) -> None:
    publisher = cell.probe.create_publisher(FusedEstimate, topics.FUSED_ESTIMATE, qos.STREAM_OUT)
    cell.until(lambda: publisher.get_subscription_count() > 0)

    def told(age: float, *, trusted: bool = True) -> PredictSlosh.Response:
        message = FusedEstimate(trusted=trusted)
        message.modal_position, message.modal_velocity = [0.003, 0.0], [0.0, 0.02]
        return published(cell, publisher, message, age, 0.05)

    answer = soon(lambda: told(0.0))
    state = LiquidState([[0.003, 0.0, 0.0, 0.02]], [[0.003, 0.0, 0.0, 0.02]])
    (found,) = predict(MODEL, motion(), state=state)
    assert answer.peak_nonlinear == found.nonlinear.peak
    # There is no usable open-loop estimate to fall back on.
    assert not told(5.0).success
    assert not told(0.0, trusted=False).success
    cell.probe.destroy_publisher(publisher)


@pytest.fixture
def told(cell: Cell) -> Iterator[Callable[..., MotionPrediction]]:
    """Yields a function that publishes a planned trajectory and returns its prediction."""
    heard: list[MotionPrediction] = []
    publisher = cell.probe.create_publisher(
        MultiDOFJointTrajectory, topics.PLANNED_TRAJECTORY, qos.DIAGNOSTICS
    )
    subscription = cell.probe.create_subscription(
        MotionPrediction, topics.PREDICTION, heard.append, qos.EVENT
    )
    cell.until(lambda: publisher.get_subscription_count() > 0)
    cell.until(lambda: subscription.get_publisher_count() > 0)

    def tell(given: list[MultiDOFJointTrajectoryPoint], start_ns: int = 0) -> MotionPrediction:
        message = MultiDOFJointTrajectory(points=given)
        message.header.stamp = to_time(start_ns)
        before = cell.predictor._planned.count
        publisher.publish(message)
        cell.until(lambda: bool(heard) and heard[-1].id == before + 1)
        return heard[-1]

    yield tell
    cell.probe.destroy_publisher(publisher)
    cell.probe.destroy_subscription(subscription)


def test_a_planned_motion_is_predicted_before_it_begins(
    cell: Cell, told: Callable[..., MotionPrediction]
) -> None:
    now = cell.probe.get_clock().now().nanoseconds
    message = told(points(poses=False), now + 2_000_000_000)
    (found,) = predict(MODEL, motion(), limits=HeightLimits(0.012))
    assert message.state == MotionPrediction.EXCEEDED
    assert message.peak == pytest.approx(found.nonlinear.peak, rel=1e-6)
    assert message.excess == pytest.approx(found.excess, rel=1e-5)
    assert message.limit == 0.012
    assert message.residual_limit == math.inf
    assert message.duration == pytest.approx(1.0)
    assert to_nanoseconds(message.start) == now + 2_000_000_000
    assert to_nanoseconds(message.header.stamp) < to_nanoseconds(message.start)
    assert not message.from_estimate
    assert "above the limit of 12 mm" in message.description
    assert "; predicted from rest: " in message.description
    level, sentence = cell.predictor._health()
    assert level == WARN
    assert sentence == f"planned motion {message.id}: {message.description}"


def test_the_cells_record_counts_against_the_limit(
    cell: Cell, told: Callable[..., MotionPrediction]
) -> None:
    publisher = cell.probe.create_publisher(
        PredictionOutcome, topics.PREDICTION_OUTCOME, qos.EVENT
    )
    publisher.publish(PredictionOutcome(count=5, sigma=0.001, epsilon=0.0))
    cell.until(lambda: cell.predictor._planned._record is not None)
    message = told(points(poses=False))
    assert message.peak_upper == pytest.approx(message.peak + 0.002)
    # Whoever publishes nonsense neither stops the predictions nor changes what was known.
    for sigma, epsilon in ((-1.0, 0.0), (math.nan, 0.0), (0.001, math.inf)):
        publisher.publish(PredictionOutcome(count=5, sigma=sigma, epsilon=epsilon))
    message = told(points(poses=False))
    assert message.peak_upper == pytest.approx(message.peak + 0.002)
    cell.probe.destroy_publisher(publisher)


def broken(change: Callable[[list[MultiDOFJointTrajectoryPoint]], Any]) -> list[Any]:
    made = points(poses=False)
    return change(made) or made


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda made: made.clear(), "is empty: a trajectory needs at least two points"),
        (lambda made: made[:1], "1 point: a motion needs at least 2"),
        (lambda made: made[::-1], "comes before"),
        (lambda made: [made[0]] * 5, "the motion lasts 0 s"),
        (lambda made: [*made[:9], *made[8:]], "repeats"),
        (lambda made: [*made[:100], *made[300:]], "a gap"),
        (lambda made: setattr(made[3].accelerations[0].linear, "x", math.nan), "is not finite"),
        (lambda made: setattr(made[3], "accelerations", []), "a transform each"),
    ],
)
def test_a_planned_trajectory_that_is_none_is_refused(
    cell: Cell, told: Callable[..., MotionPrediction], change: Any, match: str
) -> None:
    message = told(broken(change))
    assert message.state == MotionPrediction.REFUSED
    assert match in message.description
    assert math.isnan(message.peak)
    assert cell.predictor.faults.total == 0
    assert told(points(poses=False)).state == MotionPrediction.EXCEEDED


def test_a_motion_that_is_over_is_refused(
    cell: Cell, told: Callable[..., MotionPrediction]
) -> None:
    message = told(points(poses=False), 5_000_000_000)
    assert message.state == MotionPrediction.REFUSED
    assert "by its stamp it has ended" in message.description


URDF = """<robot name="slide">
  <link name="rail"/><link name="cup"/>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="cup"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="9"/></joint>
</robot>"""


def joint_points() -> list[JointTrajectoryPoint]:
    """Returns a motion along x as points of one joint."""
    one = motion()
    made = []
    for t, position in zip(one.t, one.position[:, 0], strict=True):
        point = JointTrajectoryPoint(positions=[float(position)])
        point.time_from_start.nanosec = round((t % 1.0) * 1e9)
        point.time_from_start.sec = int(t)
        made.append(point)
    return made


@pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
def test_a_motion_of_joints_is_that_of_the_cup_that_they_carry(cell: Cell, tmp_path: Path) -> None:
    (tmp_path / "slide.urdf").write_text(URDF)
    arm = read_arm(tmp_path / "slide.urdf", "cup")
    message = PredictSlosh.Request()
    message.joint_trajectory = JointTrajectory(joint_names=["slide"], points=joint_points())
    (found,) = predict(MODEL, trajectory_of(message, arm))
    (same,) = predict(MODEL, motion())
    assert found.nonlinear.peak == pytest.approx(same.nonlinear.peak, rel=1e-3)
    # The node answers the same.
    cell.predictor._arm = arm
    try:
        answer = cell.ask(time=[], joint_trajectory=message.joint_trajectory)
    finally:
        cell.predictor._arm = None
    assert answer.success, answer.message
    assert answer.peak_nonlinear == found.nonlinear.peak
    message.joint_trajectory.points[7].positions = []
    with pytest.raises(SloshEstimatorError, match="point 7 has 0 positions for 1 joints"):
        trajectory_of(message, arm)


def test_a_robot_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SloshEstimatorError, match="give the link"):
        read_arm(tmp_path / "no.urdf", "")
    with pytest.raises(SloshMotionError, match="No such file"):
        read_arm(tmp_path / "no.urdf", "cup")


def test_it_predicts_for_what_the_gripper_holds(cell: Cell) -> None:
    """Tests predictions after changes of the container, including an empty gripper."""
    mug = "container: {shape: cylinder, radius: 0.04, fill_height: 0.05}"
    changes = cell.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
    (own,) = predict(MODEL, motion(), limits=HeightLimits())
    (other,) = predict(parse_model(mug), motion(), limits=HeightLimits())
    held = cell.predictor._container

    def told(present: bool, model: str = "", limit: float = math.nan) -> None:
        changes.publish(filled(ContainerChange, present=present, model=model, limit=limit))
        expected = parse_model(model) if model else MODEL
        cell.until(
            lambda: (held.tray.first.empty, held.tray.first.model) == (not present, expected)
        )

    told(True, mug, 0.004)
    assert cell.ask().peak_nonlinear == other.nonlinear.peak
    assert cell.predictor._limits().height == 0.004
    told(False, mug)
    answer = cell.ask()
    assert not answer.success
    assert "gripper is empty" in answer.message
    told(True)
    assert cell.ask().peak_nonlinear == own.nonlinear.peak
    assert cell.predictor._limits().height == 0.012
