"""Relay node between the sender of joint trajectories and the robot's controller."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from sensor_msgs.msg import JointState

from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compilation import load_telling
from slosh_base.compiled.compile_cache import sources_digest
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.nodes.input_subscription import message_class
from slosh_governor.nodes.relayed_goal import Relayed, RelayRules, WrongJointsError, relayed
from slosh_model.tray import read_tray
from slosh_motion.errors import SloshMotionError
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.diagnostics import OK, WARN, Health
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.prepared import PreparedNode
from slosh_msgs_py.node.readiness import Progress
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.node.settings import SettingsPublisher
from slosh_plan.nodes.held_container import ContainerWatch
from slosh_plan.nodes.newest_estimate import NewestEstimate
from slosh_plan.nodes.robot_parameters import JOINT_LIMITS, TOOL_AND_GROUP
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.progress import Watch
from slosh_plan.robot_file import robot_of
from slosh_plan.start import LiquidStates

SOURCES = ("slosh_governor", "slosh_plan", "slosh_model")
TYPE = next(row.type for row in topics.ACTIONS if row.name == topics.FOLLOW_TRAJECTORY)
PARAMETERS = (
    ParameterSpec(
        "model", "", "model.yaml of the container and its liquid, or tray.yaml of several"
    ),
    ParameterSpec("urdf", "", "URDF file of the robot"),
    *TOOL_AND_GROUP,
    JOINT_LIMITS,
    ParameterSpec(
        "controller", "",
        "action of the robot's controller, such as /arm_controller/follow_joint_trajectory",
    ),
    ParameterSpec("limit", 0.02, "height limit during a motion [m]", (1e-4, 10.0)),
    ParameterSpec(
        "residual_limit", 0.0, "height limit after a motion's end [m]; 0.0: as limit", (0.0, 10.0)
    ),
    ParameterSpec(
        "rim_distance", 0.0, "least distance of the liquid to the rim [m]; 0.0: the rim itself",
        (0.0, 1.0),
    ),
    ParameterSpec(
        "replan", True,
        "true: a motion that exceeds a limit gets new times on its path; false: it is refused",
    ),
    ParameterSpec("time_limit", 5.0, "time limit of the search for new times [s]", (0.1, 60.0)),
)  # fmt: skip
MOST_GOALS = 4
"""Goals under way; each holds a thread."""
THREADS = MOST_GOALS + 3
ANSWER = 5.0
"""Time in which the controller must accept a goal [s]."""
POLL = 0.2


class RelayNode(PreparedNode):
    """Checks goals of FollowJointTrajectory against height limits and passes them on.

    Its callbacks wait for the controller: it needs an executor with THREADS.

    Args:
        later: it gets ready by `run_node`.
    """

    def __init__(self, *, later: bool = False) -> None:
        super().__init__("relay")
        self._kind = message_class(TYPE)
        self._values = values = declare(self, PARAMETERS)
        self._tray = read_tray(values["model"])
        robot = robot_of(values)
        for remark in robot.remarks if robot else ():
            self.get_logger().warning(remark)
        if robot is None:
            raise SloshEstimatorError("urdf: the relay needs the robot's description")
        self._controller = self.resolve_topic_name(values["controller"])
        if not values["controller"]:
            raise SloshEstimatorError("controller: name the controller's action")
        if self._controller == self.resolve_topic_name(topics.FOLLOW_TRAJECTORY):
            raise SloshEstimatorError("controller: this is the relay's own action")
        residual = values["residual_limit"] or values["limit"]
        limits = PlanLimits(values["limit"], residual, rim_distance=values["rim_distance"])
        self._rules = RelayRules(robot, limits, values["replan"], values["time_limit"])
        self._settings = SettingsPublisher(
            self, sources_digest(*SOURCES), arithmetic_fingerprint(), values, (topics.ESTIMATE,)
        )
        self._standing: dict[str, float] = {}
        self._running: dict[bytes, Any] = {}
        self._under_way = 0
        self._lock, self._planning = threading.Lock(), threading.Lock()
        self._closing = threading.Event()
        self._last_refusal = ""
        self._watch(self._health, self._facts)
        self._get_ready(later=later)

    def prepare(self, progress: Progress) -> None:
        """Compiles or loads the compiled code for single and for many simulations."""
        for module in ("slosh_model.kernel", "slosh_model.batch_kernel"):
            load_telling(progress, module)

    def begin(self) -> None:
        """Starts to accept goals of joint trajectories and to relay them."""
        self._container = ContainerWatch(self, self._tray, lambda: None)
        self._settings.publish(self._container.files)
        self._estimate = NewestEstimate(self)
        self.create_subscription(JointState, topics.JOINT_STATES, self._on_joints, qos.NEWEST_IN)
        group = ReentrantCallbackGroup()
        self._client = ActionClient(self, self._kind, self._controller, callback_group=group)
        self._server = ActionServer(
            self, self._kind, topics.FOLLOW_TRAJECTORY, self._on_goal, callback_group=group,
            goal_callback=self._on_request, cancel_callback=self._on_cancel,
        )  # fmt: skip

    def close(self) -> None:
        """Stops waiting for the controller, which continues its present goal."""
        self._closing.set()
        if hasattr(self, "_server"):
            self._server.destroy()
            self._client.destroy()

    def _on_joints(self, message: JointState) -> None:
        self._standing.update(zip(message.name, message.position, strict=False))

    def _on_request(self, request: Any) -> GoalResponse:
        with self._lock:
            if self._under_way >= MOST_GOALS:
                self._last_refusal = f"{MOST_GOALS} goals are under way"
                self.get_logger().error(f"goal rejected: {self._last_refusal}")
                return GoalResponse.REJECT
            self._under_way += 1
        return GoalResponse.ACCEPT

    def _on_cancel(self, goal: Any) -> CancelResponse:
        handle = self._running.get(bytes(goal.goal_id.uuid))
        if handle is not None:
            handle.cancel_goal_async()
        return CancelResponse.ACCEPT

    def _on_goal(self, goal: Any) -> Any:
        self._report.counts["goal"] += 1
        try:
            return self._relay(goal)
        except ValueError as error:
            if not type(error).__module__.startswith("slosh_"):
                raise
            if goal.is_cancel_requested:
                goal.canceled()
                return self._kind.Result(error_string=str(error))
            wrong = isinstance(error, WrongJointsError)
            code = self._kind.Result.INVALID_JOINTS if wrong else self._kind.Result.INVALID_GOAL
            return self._refused(goal, code, str(error))
        finally:
            self._running.pop(bytes(goal.goal_id.uuid), None)
            with self._lock:
                self._under_way -= 1

    def _refused(self, goal: Any, code: int, line: str) -> Any:
        self._report.counts["refused"] += 1
        self._last_refusal = line
        self.get_logger().error(line)
        goal.abort()
        return self._kind.Result(error_code=code, error_string=line)

    def _relay(self, goal: Any) -> Any:
        """Checks a goal, sends it to the controller and waits for its result."""
        if not self._client.server_is_ready():
            raise SloshEstimatorError(f"no controller serves {self._controller}: is it active?")
        sent = self._judged(goal)
        self.get_logger().info(sent.words)
        self._report.counts["new times"] += sent.is_new
        handle = self._awaited(
            self._client.send_goal_async(
                sent.goal, feedback_callback=lambda told: self._pass(goal, told.feedback)
            ),
            ANSWER,
        )
        if handle is None or not handle.accepted:
            raise SloshEstimatorError(f"the controller {self._controller} rejects the goal")
        self._running[bytes(goal.goal_id.uuid)] = handle
        if goal.is_cancel_requested:
            handle.cancel_goal_async()
        done = self._awaited(handle.get_result_async(), math.inf)
        if done is None:
            raise SloshEstimatorError(f"the controller {self._controller} is gone")
        if done.status == GoalStatus.STATUS_SUCCEEDED:
            goal.succeed()
        elif done.status == GoalStatus.STATUS_CANCELED and goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        return done.result

    def _judged(self, goal: Any) -> Relayed:
        watch = Watch(stopped=lambda: goal.is_cancel_requested or self._closing.is_set())
        with self._planning:
            return relayed(
                goal.request, self._container.asked("", topics.FOLLOW_TRAJECTORY), self._rules,
                now_ns=int(self.get_clock().now().nanoseconds), standing=dict(self._standing),
                state=self._state(), watch=watch,
            )  # fmt: skip

    def _state(self) -> LiquidStates | None:
        """Returns the liquid's state, or None if it is unknown, which counts as at rest."""
        try:
            return self._estimate.state_for(self._container.tray)
        except SloshMotionError:
            return None

    def _pass(self, goal: Any, feedback: Any) -> None:
        if goal.is_active:
            goal.publish_feedback(feedback)

    def _awaited(self, future: Any, longest: float) -> Any | None:
        """Returns a future's result; None if the robot's controller is gone or too slow."""
        done, end = threading.Event(), time.monotonic() + longest
        future.add_done_callback(lambda _: done.set())
        gone = self._gone()
        while not done.wait(POLL):
            if self._closing.is_set() or time.monotonic() > end or gone():
                return None
        return future.result()

    def _gone(self) -> Callable[[], bool]:
        """Returns a function that tells whether the controller has been away for too long."""
        seen = [time.monotonic()]

        def look() -> bool:
            if self._client.server_is_ready():
                seen[0] = time.monotonic()
            return time.monotonic() - seen[0] > ANSWER

        return look

    def _health(self) -> Health:
        if not self._client.server_is_ready():
            return WARN, f"no controller serves {self._controller}"
        return OK, f"relaying to {self._controller}, {self._under_way} goals under way"

    def _facts(self) -> dict[str, Any]:
        counts = self._report.counts
        return {
            "container": self._container.described, "goals": counts["goal"],
            "new times": counts["new times"], "refused goals": counts["refused"],
            "last refusal": self._last_refusal,
        }  # fmt: skip


def main() -> int:
    """Runs the relay node."""
    return run_node(lambda: RelayNode(later=True), threads=THREADS)


if __name__ == "__main__":
    sys.exit(main())
