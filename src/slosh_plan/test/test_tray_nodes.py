"""Predictor and planner over DDS with a tray: each answers for the worst container."""

import math
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Transform
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from slosh_model.model_text import format_model
from slosh_model.tray import Tray, TrayContainer, format_tray, parse_tray
from slosh_msgs.msg import ContainerChange, MotionPrediction, PlanRequest
from slosh_msgs.srv import PlanMotion, PredictSlosh
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.stamps import to_duration
from slosh_plan import HeightLimits, Trajectory
from slosh_plan.nodes.planner_node import THREADS, PlannerNode
from slosh_plan.nodes.predictor_node import PredictorNode
from slosh_plan.tray import predict_tray, tray_scales
from slosh_testing.graph import Graph

CUPS = "".join(
    f"- {{name: {name}, place: [{x}, 0.0, 0.0], limit: {limit}, model: {{container: "
    f"{{shape: cylinder, radius: {radius}, fill_height: 0.05}}, effects: "
    "[{name: vertical_acceleration}, {name: surface_nonlinearity}]}}\n"
    for name, x, limit, radius in (("low", 0.0, 0.03, 0.03), ("wide", 0.2, 0.012, 0.05))
)
TEXT = f"containers:\n{CUPS}"
TRAY = parse_tray(TEXT)


class Cell(Graph):
    """Both nodes, and who asks them."""

    def __init__(self) -> None:
        super().__init__(executor=SingleThreadedExecutor())
        self.predictor, self.planner = self.add(PredictorNode()), PlannerNode()
        self.served = MultiThreadedExecutor(THREADS)
        self.served.add_node(self.planner)
        threading.Thread(target=self.served.spin, daemon=True).start()
        self.changes = self.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
        self.until(lambda: self.changes.get_subscription_count() == 2)

    def tell(self, tray: Tray) -> None:
        """What the estimator says after a change on its tray."""
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


def test_a_tray_s_liquid_is_predicted_from_rest_alone(cell: Cell) -> None:
    refused = ask(cell, from_estimate=True)
    assert not refused.success
    assert "of a tray only heights are published" in refused.message


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
