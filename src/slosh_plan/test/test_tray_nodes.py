"""Tests predictor and planner over DDS with a tray: the worst container decides."""

import math
import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Transform
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from slosh_estimator.validity import EstimateFlag
from slosh_model.model_text import format_model
from slosh_model.tray import Tray, TrayContainer, format_tray, parse_tray
from slosh_msgs.msg import ContainerChange, MotionPrediction, PlanRequest, TrayEstimate
from slosh_msgs.srv import PlanMotion, PredictSlosh
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.stamps import to_duration
from slosh_plan import HeightLimits, LiquidState, Trajectory
from slosh_plan.nodes.newest_estimate import NewestEstimate
from slosh_plan.nodes.planner_node import THREADS, PlannerNode
from slosh_plan.nodes.predictor_node import PredictorNode
from slosh_plan.tray import predict_tray, tray_scales
from slosh_testing.hearing_robot import Graph

CUPS = "".join(
    f"- {{name: {name}, place: [{x}, 0.0, 0.0], limit: {limit}, model: {{container: "
    f"{{shape: cylinder, radius: {radius}, fill_height: 0.05}}, effects: "
    "[{name: vertical_acceleration}, {name: surface_nonlinearity}]}}\n"
    for name, x, limit, radius in (("low", 0.0, 0.03, 0.03), ("wide", 0.2, 0.012, 0.05))
)
TEXT = f"containers:\n{CUPS}"
TRAY = parse_tray(TEXT)


class Cell(Graph):
    """Predictor and planner node, with a client."""

    def __init__(self) -> None:
        super().__init__(executor=SingleThreadedExecutor())
        self.predictor, self.planner = self.add(PredictorNode()), PlannerNode()
        self.served = MultiThreadedExecutor(THREADS)
        self.served.add_node(self.planner)
        threading.Thread(target=self.served.spin, daemon=True).start()
        self.changes = self.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
        self.until(lambda: self.changes.get_subscription_count() == 2)

    def tell(self, tray: Tray) -> None:
        """Publishes the estimator's message after a change on its tray."""
        first = tray.first
        change = filled(
            ContainerChange, present=not first.empty, model=format_model(first.model),
            tray=format_tray(tray),
        )  # fmt: skip
        self.changes.publish(change)
        held = (self.predictor._container, self.planner._container)
        self.until(lambda: all(one.tray == tray for one in held), "the change")


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cell]:
    path = tmp_path_factory.mktemp("tray") / "tray.yaml"
    path.write_text(TEXT)
    rclpy.init(args=["--ros-args", "-p", f"model:={path}", "-p", "scales:=200"])
    made = Cell()
    yield made
    made.planner.close()
    made.served.shutdown()
    made.planner.destroy_node()
    made.close()
    rclpy.try_shutdown()


def push() -> Trajectory:
    t = np.linspace(0.0, 0.6, 301)
    return Trajectory(t, np.outer(3.0 * np.sin(2.0 * np.pi * t / 0.6), [1.0, 0.0, 0.0]))


def ask(cell: Cell, **fields: Any) -> PredictSlosh.Response:
    motion = push()
    none = [0.0] * len(motion.t)
    given = {
        "time": motion.t.tolist(), "acceleration_x": motion.acceleration[:, 0].tolist(),
        "acceleration_y": none, "acceleration_z": none, "limit": math.nan,
    }  # fmt: skip
    return cell.call(PredictSlosh, topics.PREDICT, PredictSlosh.Request(**(given | fields)))


def test_the_predictor_answers_for_the_worst_container_and_names_it(cell: Cell) -> None:
    answer = ask(cell)
    (found,) = predict_tray(TRAY, [push()], limits=HeightLimits())
    scales = tray_scales(TRAY, push(), HeightLimits(), found, count=200)
    assert (answer.success, answer.container) == (True, "wide")
    assert answer.message == "worst container wide: a limit is exceeded"
    assert answer.peak_nonlinear == found.containers["wide"].nonlinear.peak
    assert answer.excess == found.containers["wide"].excess > 0.0
    assert answer.time_scale == pytest.approx(scales.safe_from)
    lower = ask(cell, limit=0.001)
    assert lower.success
    assert lower.container == max(
        ("low", "wide"), key=lambda name: found.containers[name].nonlinear.peak
    )


def planned(name: str = "cup", stroke: float = 0.3) -> MultiDOFJointTrajectory:
    made = MultiDOFJointTrajectory(joint_names=[name])
    made.header.frame_id = "world"
    for t in np.linspace(0.0, 0.6, 61):
        point, pose = MultiDOFJointTrajectoryPoint(), Transform()
        share = t / 0.6
        pose.translation.x = stroke * float(share**3 * (10 - 15 * share + 6 * share**2))
        point.time_from_start, point.transforms = to_duration(round(t * 1e9)), [pose]
        made.points.append(point)
    return made


def test_a_planned_trajectory_is_predicted_for_the_worst_container(cell: Cell) -> None:
    told = cell.listen(MotionPrediction, topics.PREDICTION, qos.EVENT)
    cell.publisher(MultiDOFJointTrajectory, topics.PLANNED_TRAJECTORY).publish(planned())
    cell.until(lambda: bool(told), "the prediction")
    assert told[-1].state == MotionPrediction.EXCEEDED
    assert told[-1].container == "wide"
    assert told[-1].limit == 0.012
    assert told[-1].description.startswith("worst container wide: the liquid will rise to")
    assert "predicted from rest" in told[-1].description


def estimate(cell: Cell, **fields: Any) -> TrayEstimate:
    """Returns an estimate of a tray in whose second container the liquid moves."""
    message = TrayEstimate(containers=["low", "wide"], modes=[1, 1], flags=[0, 0])
    message.header.stamp = cell.node.get_clock().now().to_msg()
    message.linear_modal = [0.0] * 4 + [0.001, 0.0, 0.0, 0.02]
    message.modal = [0.0] * 4 + [0.0, 0.002, 0.03, 0.0]
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def newest(read: NewestEstimate) -> Any:
    """Returns the stamp of the newest tray estimate that a node has received."""
    message = read._newest(read._trays, TrayEstimate)
    return None if message is None else message.header.stamp


@pytest.fixture
def tell(cell: Cell) -> Iterator[Callable[..., None]]:
    """Publishes an estimate of the tray, and waits until both nodes have it."""
    publisher = cell.publisher(TrayEstimate, topics.TRAY_ESTIMATE, qos.STREAM_OUT)
    cell.until(lambda: publisher.get_subscription_count() == 2, "two readers")

    def publish(**fields: Any) -> None:
        message = estimate(cell, **fields)
        publisher.publish(message)
        for node in (cell.predictor, cell.planner):
            read = node._estimate
            cell.until(lambda read=read: newest(read) == message.header.stamp, "the state")

    yield publish
    cell.node.destroy_publisher(publisher)


def test_a_trays_liquid_is_predicted_from_its_state_now(
    cell: Cell, tell: Callable[..., None]
) -> None:
    at_rest = ask(cell)
    tell()
    live = ask(cell, from_estimate=True)
    assert live.success, live.message
    states = {
        "low": LiquidState(np.zeros((1, 4)), np.zeros((1, 4))),
        "wide": LiquidState([[0.001, 0.0, 0.0, 0.02]], [[0.0, 0.002, 0.03, 0.0]]),
    }
    (found,) = predict_tray(TRAY, [push()], limits=HeightLimits(), state=states)
    assert live.peak_nonlinear == found.containers["wide"].nonlinear.peak
    assert live.peak_nonlinear > 1.01 * at_rest.peak_nonlinear
    told = cell.listen(MotionPrediction, topics.PREDICTION, qos.EVENT)
    tell()
    cell.publisher(MultiDOFJointTrajectory, topics.PLANNED_TRAJECTORY).publish(planned())
    cell.until(lambda: bool(told) and told[-1].from_estimate, "the prediction")


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"flags": [0, int(EstimateFlag.SETTLING)]}, "container wide: the estimate's flags"),
        ({"containers": ["low", "top"]}, "is of the containers low, top, not of low, wide"),
        ({"modes": [1, 2]}, "has not one state for each container"),
        ({"modes": [2, 0]}, "the liquid's state has 2 modes, the model 1"),
        ({"modal": [0.0] * 7 + [math.nan]}, "must be finite numbers"),
        ({"modal": [0.0] * 4 + [0.05, 0.0, 0.0, 0.0]}, "before the motion begins"),
    ],
)
def test_a_state_that_is_none_of_the_tray_s_is_refused(
    cell: Cell, tell: Callable[..., None], fields: dict[str, Any], why: str
) -> None:
    tell(**fields)
    answer = ask(cell, from_estimate=True)
    assert not answer.success
    assert why in answer.message
    assert "\n" not in answer.message


@pytest.mark.long
def test_a_plan_of_a_tray_is_checked_from_the_liquids_state(
    cell: Cell, tell: Callable[..., None]
) -> None:
    """A still liquid does, one that moves is refused by the container's name."""
    request = PlanRequest(limit=0.03, residual_limit=0.01, time_limit=2.0, from_estimate=True)
    request.trajectory = planned()
    modal = [0.0] * 8
    publisher = cell.publisher(TrayEstimate, topics.TRAY_ESTIMATE, qos.STREAM_OUT)
    timer = cell.node.create_timer(
        0.02, lambda: publisher.publish(estimate(cell, linear_modal=modal, modal=modal))
    )
    tell(linear_modal=modal, modal=modal)
    kept = cell.call(PlanMotion, topics.PLAN, PlanMotion.Request(request=request))
    assert kept.success, kept.message
    modal = [0.0] * 4 + [0.0008, 0.0, 0.0, 0.0]
    tell(linear_modal=modal, modal=modal)
    refused = cell.call(PlanMotion, topics.PLAN, PlanMotion.Request(request=request))
    assert not refused.success
    assert refused.message.startswith("container wide: the liquid moves: from its state now")
    cell.node.destroy_timer(timer)


@pytest.mark.long
def test_the_planner_keeps_the_limit_of_every_container(cell: Cell) -> None:
    request = PlanRequest(limit=0.03, residual_limit=0.01, time_limit=3.0)
    request.trajectory = planned()
    answer = cell.call(PlanMotion, topics.PLAN, PlanMotion.Request(request=request))
    assert answer.success, answer.message
    assert answer.plan.container == "wide"
    assert answer.message.endswith("for container wide")
    points = answer.plan.trajectory.points
    t = [one.time_from_start.sec + 1e-9 * one.time_from_start.nanosec for one in points]
    felt = [[one.accelerations[0].linear.x, 0.0, 0.0] for one in points]
    (found,) = predict_tray(TRAY, [Trajectory(np.array(t), np.array(felt))])
    for one in TRAY.containers:
        assert found.containers[one.name].nonlinear.peak <= one.limit * (1.0 + 1e-4)
    assert answer.plan.peak == pytest.approx(found.containers["wide"].nonlinear.peak, rel=1e-3)


def test_a_change_on_the_tray_is_followed_and_an_empty_tray_refused(cell: Cell) -> None:
    wide = TRAY.containers[1]
    cell.tell(TRAY.with_container(1, TrayContainer("wide", wide.model, wide.place, 0.5)))
    assert ask(cell).container == "low"
    empty = TrayContainer("wide", wide.model, wide.place, wide.limit, empty=True)
    cell.tell(TRAY.with_container(1, empty))
    alone = ask(cell)
    assert alone.container == "low"
    low = TRAY.first
    nothing = TrayContainer("low", low.model, low.place, low.limit, empty=True)
    cell.tell(Tray((nothing, empty)))
    assert "gripper is empty" in ask(cell).message
    request = PlanRequest(limit=0.03)
    request.trajectory = planned()
    answer = cell.call(PlanMotion, topics.PLAN, PlanMotion.Request(request=request))
    assert "gripper is empty" in answer.message
    cell.tell(TRAY)
    assert ask(cell).container == "wide"
