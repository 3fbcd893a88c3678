"""ROS node that plans the fastest motion along a path within limits of the sloshing height."""

from __future__ import annotations

import math
import sys
import threading
import time
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup

from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compilation import load_telling
from slosh_base.compiled.compile_cache import sources_digest
from slosh_estimator.errors import SloshEstimatorError
from slosh_model.tray import read_tray
from slosh_msgs import action, srv
from slosh_msgs.action import PlanMotion
from slosh_msgs_py import topics
from slosh_msgs_py.node.diagnostics import OK, Health
from slosh_msgs_py.node.memory import LargeMessages
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.prepared import PreparedNode
from slosh_msgs_py.node.readiness import Progress
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.node.settings import SettingsPublisher
from slosh_msgs_py.point_arrays import action_with_point_arrays, service_with_point_arrays
from slosh_plan.nodes import plan_messages
from slosh_plan.nodes.held_container import ContainerWatch
from slosh_plan.nodes.newest_estimate import NewestEstimate
from slosh_plan.nodes.predict_messages import given
from slosh_plan.nodes.robot_parameters import JOINT_LIMITS, TOOL_AND_GROUP
from slosh_plan.planning.plan import TIME_LIMIT
from slosh_plan.planning.plan_tray import check_plan_from, check_states, plan_container, remarks_of
from slosh_plan.planning.progress import PlanProgress, Watch
from slosh_plan.robot_file import robot_of

SOURCES = ("slosh_plan", "slosh_model")
LONGEST = 600.0
PARAMETERS = (
    ParameterSpec(
        "model", "", "model.yaml of the container and its liquid, or tray.yaml of several"
    ),
    ParameterSpec(
        "time_limit", TIME_LIMIT,
        "longest search of the planning action, if its goal states none [s]",
        (0.1, LONGEST),
    ),
    ParameterSpec(
        "service_time_limit", 5.0,
        "longest time until the planning service replies [s]", (0.1, 60.0)
    ),
    ParameterSpec(
        "robust", False,
        "keep the limits for all likely values (95 %) of the model's parameters",
    ),
    ParameterSpec("urdf", "", "URDF file of the robot, for joint paths; empty if not needed"),
    *TOOL_AND_GROUP,
    JOINT_LIMITS,
)  # fmt: skip
REPLY = 0.2
"""Of the service's time is kept for its reply,"""
MOST_ROWS = 20_000
"""which holds a point each millisecond of the motion: so many are written within a second."""
THREADS = 4
"""The service and the action wait for their plans; diagnostics and cancelling go on."""
CLOSING = 5.0

PERIOD = 0.5
"""Between two reports without news [s]."""


class PlannerNode(PreparedNode):
    """ROS node of the planner: converts messages, plans and answers, one plan at a time.

    Its callbacks take seconds: it needs an executor with THREADS.

    Args:
        later: it gets ready by `run_node`.
    """

    def __init__(self, *, later: bool = False) -> None:
        super().__init__("planner")
        self._values = values = declare(self, PARAMETERS)
        self._tray = read_tray(values["model"])
        self._robot = robot_of(values)
        for remark in self._robot.remarks if self._robot else ():
            self.get_logger().warning(remark)
        self._settings = SettingsPublisher(
            self, sources_digest(*SOURCES), arithmetic_fingerprint(), values, (topics.ESTIMATE,)
        )
        self._refused = 0
        self._busy = threading.Lock()
        self._closing = threading.Event()
        self._watch(self._health, self._facts)
        self._get_ready(later=later)

    def prepare(self, progress: Progress) -> None:
        """Compiles or loads the compiled code for single and for many simulations."""
        for module in ("slosh_model.kernel", "slosh_model.batch_kernel"):
            load_telling(progress, module)

    def begin(self) -> None:
        """Starts the planning service and the planning action."""
        self._container = ContainerWatch(self, self._tray, self._on_container)
        self._settings.publish(self._container.files)
        self._estimate = NewestEstimate(self)
        self._large = LargeMessages(self)
        paths = (("request", "trajectory"), ("request", "joint_trajectory"))
        service = service_with_point_arrays(srv.PlanMotion, paths, plan_messages.MOST_WAYPOINTS)
        self.create_service(
            service, topics.PLAN, self._on_plan,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )  # fmt: skip
        self._action = ActionServer(
            self, action_with_point_arrays(action.PlanMotion, paths, plan_messages.MOST_WAYPOINTS),
            topics.PLAN_MOTION, self._on_goal,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )  # fmt: skip

    def _on_container(self) -> None:
        """Uses a changed container for all later planning requests."""
        now_ns = int(self.get_clock().now().nanoseconds)
        self._settings.publish(self._container.files, now_ns)

    def close(self) -> None:
        """Stops a running plan and closes the planning action."""
        self._closing.set()
        if self._busy.acquire(timeout=CLOSING):
            self._busy.release()
        if hasattr(self, "_action"):
            self._action.destroy()

    def _on_plan(
        self, message: srv.PlanMotion.Request, response: srv.PlanMotion.Response
    ) -> srv.PlanMotion.Response:
        self._report.counts["plan"] += 1
        longest = self._values["service_time_limit"]
        longest *= 1.0 - REPLY
        end = time.monotonic() + longest

        def stopped() -> bool:
            return time.monotonic() > end or self._closing.is_set()

        self._answer(message.request, response, longest, Watch(stopped=stopped), MOST_ROWS)
        return response

    def _on_goal(self, goal: Any) -> action.PlanMotion.Result:
        self._report.counts["plan_motion"] += 1
        result = action.PlanMotion.Result()
        feedback = GoalFeedback(goal)
        watch = Watch(feedback.tell, lambda: feedback.cancelled or self._closing.is_set())
        try:
            self._answer(goal.request.request, result, LONGEST, watch)
        except Exception as error:
            result.success, result.message = False, self.faults.add(topics.PLAN_MOTION, error)
        if goal.is_cancel_requested:
            goal.canceled()
        elif result.success:
            goal.succeed()
        else:
            goal.abort()
        return result

    def _answer(
        self, request: Any, answer: Any, longest: float, watch: Watch, most: int | None = None
    ) -> None:
        """Plans a motion and fills the response; the plan has at most `most` samples."""
        self._large.add(max(map(len, plan_messages.points_of(request))))
        try:
            if not self._busy.acquire(blocking=False):
                raise SloshEstimatorError("another plan is under way: ask again when it is done")
            try:
                answer.plan, answer.message = self._planned(request, longest, watch, most)
                answer.success = True
            finally:
                self._busy.release()
        except ValueError as error:
            if not type(error).__module__.startswith("slosh_"):
                raise
            self._refused += 1
            answer.success, answer.message = False, str(error)

    def _planned(
        self, request: Any, longest: float, watch: Watch, most: int | None
    ) -> tuple[Any, str]:
        """Returns the message of a plan, and a sentence that describes it."""
        tray = self._container.asked(request.model_path, topics.PLAN)
        limits = plan_messages.limits_of(request, self._robot)
        asked = plan_messages.path_of(request, self._robot)
        if request.from_estimate:
            check_states(tray, limits, self._estimate.state_for(tray))
        watch.enter("path")
        longest = min(given(request.time_limit, self._values["time_limit"]), longest)
        planned = plan_container(
            tray, asked.path(tray.turning.model, watch.stopped), limits,
            attitude=asked.attitude, margin=given(request.margin, 0.0), time_limit=longest,
            watch=watch, robust=self._values["robust"],
        )  # fmt: skip
        answer, container = planned.plan, planned.one.name
        motion = answer.found.motion
        self._large.add(len(motion.t))
        if most is not None and len(motion.t) > most:
            raise SloshEstimatorError(
                f"the fastest safe motion that was found lasts {motion.duration:.3g} s; the "
                f"service returns {most} points, one per millisecond: send the goal to the "
                f"action {topics.PLAN_MOTION}, or cut the path"
            )
        if request.from_estimate:
            states = self._estimate.state_for(tray)
            check_plan_from(tray, answer, limits, asked.attitude, states)
        duration = f"{motion.duration:.3f} s"
        words = answer.law + (answer.reason and f": {answer.reason}")
        message = plan_messages.plan_message(answer, request, asked)
        message.container = container
        of = f", for container {container}" if container else ""
        told = remarks_of(planned, limits)
        remarks = f"; remarks: {', '.join(told)}" if told else ""
        return message, f"{duration}, {words}{of}{remarks}"

    def _health(self) -> Health:
        busy = ", a plan is under way" if self._busy.locked() else ""
        there = self._container.tray.present
        if not there:
            return OK, f"no container: the gripper is empty{busy}"
        return OK, f"planning with {there[0].model.nonlinear().name}{busy}"

    def _facts(self) -> dict[str, Any]:
        return {"container": self._container.described, "refused requests": self._refused}


class GoalFeedback:
    """Sends the progress of a plan to the client, at changes and twice a second."""

    def __init__(self, goal: Any) -> None:
        self._goal = goal
        self._told = PlanProgress("", math.inf, -math.inf)

    def tell(self, progress: PlanProgress) -> None:
        """Receives the progress of a plan at any rate and sends it as feedback."""
        told = self._told
        same = (progress.phase, progress.duration) == (told.phase, told.duration)
        if same and progress.elapsed - told.elapsed < PERIOD:
            return
        self._told = progress
        duration = progress.duration if math.isfinite(progress.duration) else math.nan
        self._goal.publish_feedback(
            PlanMotion.Feedback(phase=progress.phase, duration=duration, elapsed=progress.elapsed)
        )

    @property
    def cancelled(self) -> bool:
        """Whether the client has cancelled the action goal."""
        return bool(self._goal.is_cancel_requested)


def main() -> int:
    """Runs the planner node."""
    return run_node(lambda: PlannerNode(later=True), threads=THREADS)


if __name__ == "__main__":
    sys.exit(main())
