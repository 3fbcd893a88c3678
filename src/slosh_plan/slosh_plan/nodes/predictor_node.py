"""ROS node that predicts how high the liquid will rise before the robot moves."""

from __future__ import annotations

import math
import sys
from typing import Any

from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compilation import load_telling
from slosh_base.compiled.compile_cache import sources_digest
from slosh_model.least_wave import growth_text
from slosh_model.tilt import added_text, attitude_of
from slosh_model.tray import read_tray
from slosh_msgs.srv import PredictSlosh
from slosh_msgs_py import topics
from slosh_msgs_py.node.diagnostics import OK, Health
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.prepared import PreparedNode
from slosh_msgs_py.node.readiness import READY, Progress
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.node.settings import SettingsPublisher
from slosh_msgs_py.point_arrays import service_with_point_arrays
from slosh_plan import HeightLimits
from slosh_plan.doubts import trajectory_doubts
from slosh_plan.nodes import predict_messages
from slosh_plan.nodes.held_container import ContainerWatch
from slosh_plan.nodes.newest_estimate import NewestEstimate
from slosh_plan.nodes.planned_motions import PlannedMotions
from slosh_plan.nodes.robot_parameters import TOOL_AND_GROUP
from slosh_plan.robot_file import robot_of
from slosh_plan.scaling import COUNT
from slosh_plan.trajectory import MOST_POINTS
from slosh_plan.tray import limits_of, predict_tray, tray_scales

SOURCES = ("slosh_plan", "slosh_model")
MOST_SAMPLES = 10_000_000
"""Of all time scales of a request: about a second, in which nothing else is answered."""
PARAMETERS = (
    ParameterSpec(
        "model", "", "model.yaml of the container and its liquid, or tray.yaml of several"
    ),
    ParameterSpec("scales", COUNT, "number of time scales tested per request", (10, 10_000)),
    ParameterSpec(
        "limit", 0.02, "height limit during planned motions [m]; 0 for no limit", (0.0, 10.0),
        read_only=False,
    ),
    ParameterSpec(
        "residual_limit", 0.0, "height limit after a planned motion's end [m]; 0 for no limit",
        (0.0, 10.0), read_only=False,
    ),
    ParameterSpec(
        "rim_distance", 0.0,
        "least distance of the liquid to the rim [m]; 0: the rim itself", (0.0, 1.0),
        read_only=False,
    ),
    ParameterSpec("urdf", "", "URDF file of the robot, for joint motions; empty if not needed"),
    *TOOL_AND_GROUP,
    ParameterSpec("container_frame", "container", "container's frame in all published messages"),
)  # fmt: skip
LIMITS = ("limit", "residual_limit")


class PredictorNode(PreparedNode):
    """ROS node of the predictor: converts messages, predicts and answers.

    Args:
        later: it gets ready by `run_node`.
    """

    def __init__(self, *, later: bool = False) -> None:
        super().__init__("predictor")
        self._values = values = declare(self, PARAMETERS, apply=self._on_change)
        self._tray = read_tray(values["model"])
        robot = robot_of(values)
        self._arm = robot.arm if robot is not None else None
        self._settings = SettingsPublisher(
            self, sources_digest(*SOURCES), arithmetic_fingerprint(), values,
            (topics.ESTIMATE, topics.PLANNED_TRAJECTORY, topics.PREDICTION),
        )  # fmt: skip
        self._refused = 0
        self._watch(self._health, self._facts)
        self._get_ready(later=later)

    def prepare(self, progress: Progress) -> None:
        """Compiles or loads the compiled code for single and for many simulations."""
        for module in ("slosh_model.kernel", "slosh_model.batch_kernel"):
            load_telling(progress, module)

    def begin(self) -> None:
        """Starts the service and the predictions of planned motions."""
        self._estimate = NewestEstimate(self)
        self._container = ContainerWatch(self, self._tray, self._on_container)
        self._settings.publish(self._container.files)
        self._planned = PlannedMotions(
            self, self._container, self._limits(), self._estimate,
            self._values["container_frame"],
        )  # fmt: skip
        service = service_with_point_arrays(
            PredictSlosh, (("trajectory",), ("joint_trajectory",)), MOST_POINTS
        )
        self.create_service(service, topics.PREDICT, self._on_predict)

    def _limits(self) -> HeightLimits:
        height, residual = (self._values[name] or math.inf for name in LIMITS)
        own = self._container.limit
        height = height if math.isnan(own) else own
        return HeightLimits(height, residual, rim_distance=self._values["rim_distance"])

    def _on_container(self) -> None:
        self._planned.limits = self._limits()
        self._settings.publish(self._container.files, self._now())

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _on_change(self, changed: tuple[str, ...]) -> None:
        if self.readiness.state == READY:
            self._planned.limits = self._limits()
            self._settings.publish_change(changed, self._now())

    def _on_predict(
        self, request: PredictSlosh.Request, response: PredictSlosh.Response
    ) -> PredictSlosh.Response:
        self._report.counts["request"] += 1
        points = (request.time, request.trajectory.points, request.joint_trajectory.points)
        self._planned.large.add(max(map(len, points)))
        predict_messages.fill_unknown(response)
        try:
            response.message = self._answer(request, response)
            response.success = True
        except ValueError as error:
            if not type(error).__module__.startswith("slosh_"):
                raise
            self._refused += 1
            predict_messages.fill_unknown(response)
            response.success, response.message = False, str(error)
        return response

    def _answer(self, request: PredictSlosh.Request, response: PredictSlosh.Response) -> str:
        """Writes the prediction into the response; returns a sentence that describes it."""
        tray = self._container.asked(request.model_path, topics.PREDICT)
        model = tray.first.placed
        motion = predict_messages.trajectory_of(request, self._arm)
        limits = predict_messages.limits_of(request)
        horizon = predict_messages.horizon_of(request)
        error = predict_messages.error_of(request)
        state = self._estimate.state_for(tray) if request.from_estimate else None
        (found,) = predict_tray(
            tray, [motion], limits=limits, state=state, horizon=horizon, error=error
        )
        prediction = found.of_worst
        predict_messages.fill(response, prediction)
        response.container = found.worst
        given = any(limits_of(one, limits).given for one in tray.present)
        if given and not request.no_time_scales:
            scales = tray_scales(
                tray, motion, limits, found, state=state, horizon=horizon,
                count=self._values["scales"], most=MOST_SAMPLES,
            )  # fmt: skip
            predict_messages.fill_scales(response, scales)
        answer = "the limits are kept" if prediction.kept else "a limit is exceeded"
        answer = f"worst container {found.worst}: {answer}" if found.worst else answer
        answer = "; ".join(filter(None, (answer, found.falling)))
        added = added_text(model, attitude_of(motion))
        answer += f"; it {added}" if added else ""
        grown = filter(None, [growth_text(prediction.growth)])
        return "; but ".join([answer, *grown, *trajectory_doubts(motion, model)])

    def _health(self) -> Health:
        there = self._container.tray.present
        doing = "no container: the gripper is empty"
        if there:
            doing = f"predicting with {there[0].model.nonlinear().name}"
        return self._planned.health() or (OK, doing)

    def _facts(self) -> dict[str, Any]:
        return {
            **{name: self._values[name] for name in LIMITS},
            "container": self._container.described,
            "refused requests": self._refused,
            "planned motions": self._planned.count,
        }


def main() -> int:
    """Runs the predictor node."""
    return run_node(lambda: PredictorNode(later=True))


if __name__ == "__main__":
    sys.exit(main())
