"""Governor node: executes as much of a commanded motion as the liquid allows."""

from __future__ import annotations

import copy
import math
import sys
import time
from collections import deque
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from std_srvs.srv import Trigger
from trajectory_msgs.msg import MultiDOFJointTrajectory

from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compilation import load_telling
from slosh_base.compiled.compile_cache import sources_digest
from slosh_estimator.errors import SloshEstimatorError
from slosh_model.tray import read_tray
from slosh_msgs.msg import FusedEstimate, GovernedMotion
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.diagnostics import ERROR, OK, WARN, Health
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.prepared import PreparedNode
from slosh_msgs_py.node.readiness import Progress
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.node.settings import SettingsPublisher
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_plan.governor import Governed, GovernorState, ModelDoubt, SeenLiquid
from slosh_plan.governor.parameters import POSE, TWIST, governor_of
from slosh_plan.nodes.governor_messages import (
    governed_message,
    pose_command,
    safe_twist,
    stop_message,
    twist_command,
)
from slosh_plan.nodes.held_container import ContainerWatch
from slosh_plan.nodes.newest_estimate import modal_of
from slosh_plan.planning.limits import ACCELERATION, JERK
from slosh_plan.tuning import TUNING

SOURCES = ("slosh_plan", "slosh_model")
PARAMETERS = (
    ParameterSpec("model", "", "model file of the container and its liquid (model.yaml)"),
    ParameterSpec("limit", 0.02, "limit of the height [m]; 0: the rim alone", (0.0, 1.0)),
    ParameterSpec(
        "rim_distance", 0.0,
        "least distance of the liquid to the rim [m]; 0: the rim itself", (0.0, 1.0),
    ),
    ParameterSpec(
        "max_acceleration", ACCELERATION, "limit of the acceleration [m/s²]", (0.01, 100.0)
    ),
    ParameterSpec("max_jerk", JERK, "limit of the jerk [m/s³]", (0.1, 10_000.0)),
    ParameterSpec("rate", 100.0, "steps and messages per second", (20.0, 1000.0)),
    ParameterSpec(
        "timeout", TUNING.governor_timeout, "time for which a command holds [s]", (0.01, 10.0)
    ),
    ParameterSpec(
        "frequency_error", ModelDoubt().frequency,
        "largest relative error of the model's natural frequency", (0.0, 0.3),
    ),
    ParameterSpec(
        "damping_factor", ModelDoubt().damping,
        "factor by which the damping may be larger or smaller", (1.0, 10.0),
    ),
    ParameterSpec(
        "command", TWIST, "what commands are: velocities or targets", choices=(TWIST, POSE)
    ),
    ParameterSpec("world_frame", "world", "frame of the commands, on all output"),
)  # fmt: skip


ONE_CONTAINER = "the governor keeps the liquid of one container, not of a tray"


class GovernorNode(PreparedNode):
    """ROS node that runs the governor at a fixed rate and publishes its motion.

    Args:
        later: it gets ready by `run_node`.
    """

    def __init__(self, *, later: bool = False) -> None:
        super().__init__("governor")
        self._values = values = dict(declare(self, PARAMETERS))
        self._limit = values["limit"]
        self._tray = read_tray(values["model"])
        if self._tray.is_tray:
            raise SloshEstimatorError(
                f"{values['model']}: {ONE_CONTAINER}: give the model of a container"
            )
        names = (topics.FUSED_ESTIMATE, topics.DESIRED_TWIST, topics.DESIRED_POSE,
                 topics.SAFE_TWIST, topics.GOVERNED_MOTION)  # fmt: skip
        self._settings = SettingsPublisher(
            self, sources_digest(*SOURCES), arithmetic_fingerprint(), values, names
        )
        self._moved: Governed | None = None
        self._waits = False
        self._seconds: deque[float] = deque(maxlen=1000)
        self._watch(self._health, self._facts)
        self._get_ready(later=later)

    def prepare(self, progress: Progress) -> None:
        """Compiles or loads the compiled code, and creates the governor."""
        for module in ("slosh_model.kernel", "slosh_plan.governor"):
            load_telling(progress, module)
        self._core = governor_of(self._tray.first.model, self._values)

    def begin(self) -> None:
        """Starts the steps of the governor."""
        self._container = ContainerWatch(self, self._tray, self._on_container)
        self._settings.publish(self._container.files)
        self._safe = self.create_publisher(TwistStamped, topics.SAFE_TWIST, qos.STREAM_OUT)
        self._told = self.create_publisher(GovernedMotion, topics.GOVERNED_MOTION, qos.STREAM_OUT)
        self._stops = self.create_publisher(
            MultiDOFJointTrajectory, topics.STOP_TRAJECTORY, qos.EVENT
        )
        kinds = {
            TWIST: (TwistStamped, topics.DESIRED_TWIST),
            POSE: (PoseStamped, topics.DESIRED_POSE),
        }
        kind, topic = kinds[self._values["command"]]
        self.create_subscription(kind, topic, self._on_command, qos.STREAM_IN)
        self.create_subscription(
            FusedEstimate, topics.FUSED_ESTIMATE, self._on_fused, qos.STREAM_IN
        )
        self.create_service(Trigger, topics.EMERGENCY_STOP, self._on_stop)
        self.create_service(Trigger, topics.RELEASE_STOP, self._on_release)
        self.create_timer(1.0 / self._values["rate"], self._step)

    def _on_command(self, message: Any) -> None:
        self._report.counts["command"] += 1
        twist = isinstance(message, TwistStamped)
        self._core.take(twist_command(message) if twist else pose_command(message))

    def _on_fused(self, message: FusedEstimate) -> None:
        if message.trusted:
            stamp_ns = to_nanoseconds(message.header.stamp)
            self._core.see(
                SeenLiquid(
                    stamp_ns, modal_of(message), message.msh_stddev, message.frequency_factor
                )
            )

    def _step(self) -> None:
        now_ns = int(self.get_clock().now().nanoseconds)
        if self._waits and self._core.rests and not self._container.tray.is_tray:
            self._change(now_ns)
        started = time.perf_counter()
        self._moved = moved = self._core.step(now_ns)
        self._seconds.append(time.perf_counter() - started)
        frame = self._values["world_frame"]
        self._safe.publish(safe_twist(moved, frame))
        self._told.publish(governed_message(moved, frame))

    def _on_container(self) -> None:
        """Stops the motion; the governor for the next container starts at rest."""
        self._waits = True
        self._core.stop()
        if self._container.tray.is_tray:
            self.get_logger().error(f"{ONE_CONTAINER}: at rest until the tray is gone")

    def _change(self, now_ns: int) -> None:
        """Starts the governor for another container."""
        self._waits = False
        own = self._container.limit
        self._values["limit"] = self._limit if math.isnan(own) else own
        self._core = governor_of(self._container.tray.first.model, self._values)
        self._settings.publish(self._container.files, now_ns)

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._report.counts["emergency_stop"] += 1
        told = copy.deepcopy(self._core).stopped() if self._moved else []
        self._core.stop()
        response.success, response.message = True, "at rest"
        if told and self._moved and not self._core.rests:
            moving = [self._moved, *told]
            frame = self._values["world_frame"]
            self._stops.publish(stop_message(moving, self._core.period, frame))
            gone = math.dist(told[-1].position, self._moved.position)
            highest = max(one.peak for one in told)
            response.message = (
                f"at rest in {self._core.period * len(told):.2f} s, {1e3 * gone:.0f} mm from "
                f"here; the liquid rises to {1e3 * highest:.1f} mm at most"
            )
        return response

    def _on_release(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = not self._waits and self._core.release()
        response.message = "commands are followed" if response.success else "not at rest yet"
        return response

    def _health(self) -> Health:
        moved = self._moved
        if moved is None:
            return OK, "no step yet"
        if not moved.safe:
            return ERROR, (
                f"no stop keeps {1e3 * moved.limit:.3g} mm: the lowest found reaches "
                f"{1e3 * moved.peak:.3g} mm"
            )
        doing = moved.state.name.lower()
        if moved.state is GovernorState.STOPPING or moved.reason:
            return WARN, f"{doing}: {moved.reason.name.lower()}"
        return OK, doing

    def _facts(self) -> dict[str, Any]:
        times = np.array(self._seconds or [0.0])
        facts: dict[str, Any] = {
            "container": self._container.described,
            "step, 99th percentile [ms]": round(1e3 * float(np.percentile(times, 99)), 3),
            "latency, at most [ms]": round(1e3 / self._values["rate"] + 1e3 * times.max(), 3),
        }
        if self._moved is not None:
            facts |= {
                "share": round(self._moved.share, 3),
                "margin [mm]": round(1e3 * self._moved.margin, 2),
            }
        return facts


def main() -> int:
    """Runs the governor node."""
    return run_node(lambda: GovernorNode(later=True))


if __name__ == "__main__":
    sys.exit(main())
