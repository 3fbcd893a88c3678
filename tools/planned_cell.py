"""Compares predicted, estimated and measured peaks of planned motions in the simulated cell.

    tools/run python tools/planned_cell.py [--motions l3 e3 c3 p2p] [--docs]

Each motion is planned as `slosh plan` does, announced on `planned_trajectory` while the cell still
rests, and played over DDS with camera, estimator, monitor and predictor as processes. The cell's
liquid is damped otherwise than the model says, and its sensors are noisy. `--docs` fills the table
in docs/plan.md.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from result_tables import fill
from trajectory_msgs.msg import MultiDOFJointTrajectory

from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.cell.motions import make_motion
from slosh_bringup.processes import NodeGroup, NodeProcess, config_folder, node_environment
from slosh_model.model_text import read_model
from slosh_msgs.msg import (
    FreeSurface,
    MotionPrediction,
    PlanRequest,
    PredictionOutcome,
    SloshEstimate,
)
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.domain import own_domain
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_plan.nodes.plan_messages import RequestedPath, plan_message
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import TIME_LIMIT, Plan, plan
from slosh_plan.planning.time_law import STEP
from slosh_plan.planning.waypoints import Waypoints

Array = NDArray[np.float64]

PAGE = Path(__file__).resolve().parents[1] / "docs" / "plan.md"
NAMES = ("l3", "e3", "c3", "p2p")
LIMITS = PlanLimits(0.015, 0.002, 9.5, 74.0)
NAMESPACE = "/slosh"
REST_BEFORE, REST_AFTER = 2.0, 4.0
"""Around the motion [s]; the monitor judges it two seconds after its end."""
SETTLED = 0.5
"""After so long it is announced [s]."""
PATIENCE = 120.0
WATCHING = ("estimator", "camera", "monitor", "predictor")


@dataclass(frozen=True, slots=True)
class Played:
    """A motion that was planned and then played in the simulated cell, with its heights.

    Attributes:
        name: of the path.
        plan: the plan.
        prediction: told before it began.
        outcome: told after it had ended.
        truth: highest height of the simulated liquid [m].
        ahead: from the prediction to the motion's beginning [s].
    """

    name: str
    plan: Plan
    prediction: MotionPrediction
    outcome: PredictionOutcome
    truth: float
    ahead: float


def waypoints(name: str) -> Array:
    """Returns the waypoints (N, 3) of a named path [m]."""
    if name == "p2p":
        return np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
    return make_motion(name).position


def planned(name: str, time_limit: float = TIME_LIMIT) -> Plan:
    """Plans the fastest motion along a named path, with the shipped model."""
    model = read_model(str(config_folder() / "model.yaml"))
    return plan(model, path_through(waypoints(name)), LIMITS, time_limit=time_limit)


def write_motion(path: Path, answer: Plan) -> None:
    """Writes a planned motion as a motion table, with rest before and after it."""
    before, after = (np.zeros((round(rest / STEP), 3)) for rest in (REST_BEFORE, REST_AFTER))
    acceleration = np.concatenate((before, answer.found.motion.acceleration, after))
    rows = np.column_stack((STEP * np.arange(len(acceleration)), acceleration))
    np.savetxt(path, rows, "%.9g", ",", header="t,ax,ay,az", comments="")


class Watcher:
    """Announces a motion when the simulated cell is ready, and stores messages about it."""

    def __init__(self, trajectory: MultiDOFJointTrajectory) -> None:
        self._trajectory = trajectory
        self._announced, self._began = False, 0
        self.prediction: MotionPrediction | None = None
        self.outcome: PredictionOutcome | None = None
        self.truth = 0.0
        self.node = Node("planning", namespace=NAMESPACE)
        self._planned = self.node.create_publisher(
            MultiDOFJointTrajectory, topics.PLANNED_TRAJECTORY, qos.PLANNED_IN
        )
        hear = self.node.create_subscription
        hear(SloshEstimate, topics.ESTIMATE, self._on_estimate, qos.NEWEST_IN)
        hear(FreeSurface, topics.TRUTH, self._on_truth, qos.STREAM_IN)
        hear(MotionPrediction, topics.PREDICTION, self._on_prediction, qos.EVENT)
        hear(PredictionOutcome, topics.PREDICTION_OUTCOME, self._on_outcome, qos.EVENT)

    def _on_estimate(self, message: SloshEstimate) -> None:
        stamp = to_nanoseconds(message.header.stamp)
        self._began = self._began or stamp
        # By then all nodes have heard what the cell says.
        if self._announced or stamp - self._began < SETTLED * SECOND:
            return
        self._announced = True
        self._trajectory.header.stamp = to_time(self._began + round(REST_BEFORE * SECOND))
        self._planned.publish(self._trajectory)

    def _on_truth(self, message: FreeSurface) -> None:
        self.truth = max(self.truth, message.msh)

    def _on_prediction(self, message: MotionPrediction) -> None:
        self.prediction = message

    def _on_outcome(self, message: PredictionOutcome) -> None:
        self.outcome = message


def nodes_of(motion: Path, folder: Path, *, record: bool) -> Iterator[NodeProcess]:
    """Yields the processes of the simulated cell; the last one plays the motion."""
    config = config_folder()
    model, camera = str(config / "model.yaml"), str(config / "camera.yaml")
    limits = {"limit": str(LIMITS.height), "residual_limit": str(LIMITS.residual)}
    own: dict[str, dict[str, str]] = {
        "recorder": {"output": str(folder / "bag")},
        "estimator": {"model": model},
        "camera": {"calibration": camera},
        "monitor": {},
        "predictor": {"model": model, **limits},
    }
    names = (*(["recorder"] if record else []), *WATCHING)
    for name in names:
        yield NodeProcess(name, [config / "cell.yaml"], own[name])
    playing = {
        "motion": str(motion), "calibration": camera, "wait_for": ",".join(names),
        "readers": "2" if record else "1",
    }  # fmt: skip
    yield NodeProcess("cell", [config / "cell.yaml"], playing)


def play(name: str, answer: Plan, folder: Path, domain: int, *, record: bool = False) -> Played:
    """Plays a planned motion in the simulated cell and returns its heights.

    Args:
        name: of the path.
        answer: the plan.
        folder: for the motion table, the logs and, with `record`, the bag.
        domain: of DDS; this process speaks in it already.
        record: whether there is a recorder, too.
    """
    motion = folder / f"{name}.csv"
    write_motion(motion, answer)
    times = np.array([0.0, answer.found.motion.duration])
    ends = Waypoints(times, waypoints(name)[[0, -1]], None)
    came = plan_message(answer, PlanRequest(), RequestedPath(ends)).trajectory
    with ExitStack() as stack:
        if not rclpy.ok():
            rclpy.init()
            stack.callback(rclpy.try_shutdown)
        watcher = Watcher(came)
        executor = SingleThreadedExecutor()
        executor.add_node(watcher.node)
        stack.callback(watcher.node.destroy_node)
        group = stack.enter_context(
            NodeGroup(NAMESPACE, folder / "logs", node_environment(domain))
        )
        for process in nodes_of(motion, folder, record=record):
            group.start(process)
        end = time.monotonic() + PATIENCE
        while watcher.outcome is None and time.monotonic() < end and "cell" not in group.ended():
            executor.spin_once(timeout_sec=0.05)
            group.check()
        prediction, outcome = watcher.prediction, watcher.outcome
    if prediction is None or outcome is None:
        raise SystemExit(f"{name}: no prediction, or nothing was made of it: {folder / 'logs'}")
    told, began = prediction.header.stamp, prediction.start
    ahead = (to_nanoseconds(began) - to_nanoseconds(told)) / SECOND
    return Played(name, answer, prediction, outcome, watcher.truth, ahead)


def line(one: Played) -> str:
    """Formats one played motion as a Markdown table row."""
    prediction, outcome = one.prediction, one.outcome
    heights = (prediction.peak, outcome.estimated, outcome.measured, one.truth)
    cells = " | ".join(f"{1e3 * height:.1f}" for height in heights)
    found = one.plan.found.motion.duration
    return (
        f"| {one.name} | {found:.3f} | {one.plan.method} | {one.ahead:.1f} | {cells} "
        f"| {1e3 * outcome.error:+.1f} |"
    )


def table(rows: list[Played]) -> str:
    """Formats all played motions as a Markdown table."""
    lines = [
        "| path | planned [s] | law | announced before [s] | predicted [mm] | estimated [mm] | "
        "measured [mm] | truth [mm] | measured - predicted [mm] |",
        "|---|--:|---|--:|--:|--:|--:|--:|--:|",
    ]
    return "\n".join([*lines, *map(line, rows)]) + "\n"


@contextmanager
def speaking() -> Iterator[int]:
    """Reserves a DDS domain for this process and the cell's nodes only."""
    with own_domain() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        os.environ.update(node_environment(domain))
        yield domain


def main() -> int:
    """Plans and plays motions, prints a table; returns 1 if a prediction exceeds its limits."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--motions", nargs="+", default=NAMES, choices=NAMES)
    parser.add_argument("--docs", action="store_true", help="write docs/plan.md")
    arguments = parser.parse_args()
    rows: list[Played] = []
    with speaking() as domain, tempfile.TemporaryDirectory() as folder:
        for name in arguments.motions:
            own = Path(folder) / name
            own.mkdir()
            rows.append(play(name, planned(name), own, domain))
            print(line(rows[-1]), flush=True)
    print(table(rows))
    if arguments.docs:
        fill(PAGE, "cell", table(rows))
    return int(any(one.prediction.state != MotionPrediction.KEPT for one in rows))


if __name__ == "__main__":
    sys.exit(main())
