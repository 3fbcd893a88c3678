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
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compilation import load_telling
from slosh_base.compiled.compile_cache import sources_digest
from slosh_governor.core import (
    Command,
    Governed,
    Governor,
    GovernorState,
    SeenLiquid,
    StopReason,
)
from slosh_governor.core.parameters import arm_of, governor_of
from slosh_governor.nodes.governor_messages import (
    Heading,
    governed_message,
    motion_command,
    not_safe,
    safe_twist,
    stop_message,
    why,
)
from slosh_governor.nodes.governor_parameters import PARAMETERS
from slosh_governor.nodes.joint_commands import (
    JOINT_TOPICS,
    JointPlaces,
    files_of_robot,
    joint_trajectory,
    robot_of,
)
from slosh_governor.tuning import TUNING
from slosh_model.tray import read_tray
from slosh_msgs.msg import FusedEstimate, GovernedMotion
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.diagnostics import ERROR, OK, WARN, Health
from slosh_msgs_py.node.parameters import declare
from slosh_msgs_py.node.prepared import PreparedNode
from slosh_msgs_py.node.readiness import Progress
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.node.settings import SettingsPublisher
from slosh_msgs_py.node.silence import SilentTopic
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_plan.errors import SloshPlanError
from slosh_plan.nodes.held_container import ContainerWatch
from slosh_plan.nodes.newest_estimate import modal_of

SOURCES = ("slosh_governor", "slosh_plan", "slosh_model")
NAMES = (
    topics.FUSED_ESTIMATE, topics.JOINT_STATES, topics.SAFE_TWIST, topics.GOVERNED_MOTION,
    *(row.name for row in topics.COMMANDING.values()),
    *(one.safe for one in JOINT_TOPICS.values()),
)  # fmt: skip


class GovernorNode(PreparedNode):
    """ROS node that runs the governor at a fixed rate and publishes its motion.

    Args:
        later: it gets ready by `run_node`.
    """

    def __init__(self, *, later: bool = False) -> None:
        super().__init__("governor", journaled=True)
        self._values = values = dict(declare(self, PARAMETERS))
        self._limit = values["limit"]
        self._tray = read_tray(values["model"])
        self._robot = robot_of(values)
        for remark in self._robot.remarks if self._robot else ():
            self.get_logger().warning(remark)
        self._names = self._robot.arm.carrying if self._robot else ()
        self._joints = JointPlaces(self._names, self.now_ns)
        self._lost, self._refused_at = "", list[float]()
        self._settings = SettingsPublisher(
            self, sources_digest(*SOURCES), arithmetic_fingerprint(), values, NAMES
        )
        self._core: Governor | None = None
        self._moved: Governed | None = None
        self._waits, self._refused = False, ""
        self._at_rest = bool(values["starts_at_rest"])
        self._held: tuple[object, ...] = ()
        self._unseen = ""
        self._seconds: deque[float] = deque(maxlen=1000)
        self._watch(self._health, self._facts)
        self._get_ready(later=later)

    def prepare(self, progress: Progress) -> None:
        """Compiles or loads the compiled code, and checks that the container can be governed."""
        for module in ("slosh_model.kernel", "slosh_governor.core"):
            load_telling(progress, module)
        governor_of(self._tray, self._values)

    def begin(self) -> None:
        """Starts the timer that advances the governor at its fixed rate."""
        self._container = ContainerWatch(self, self._tray, self._on_container)
        self._renew()
        values, stream = self._values, qos.STREAM_OUT
        self._told = self.create_publisher(GovernedMotion, topics.GOVERNED_MOTION, stream)
        self._stops = self.create_publisher(
            MultiDOFJointTrajectory, topics.STOP_TRAJECTORY, qos.EVENT
        )
        self._of_joints = JOINT_TOPICS.get(values["command"])
        if self._of_joints is None:
            self._safe = self.create_publisher(TwistStamped, topics.SAFE_TWIST, stream)
            kind: Any = PoseStamped if values["command"] == "pose" else TwistStamped
        else:
            kind = self._of_joints.message
            self._safe = self.create_publisher(kind, self._of_joints.safe, stream)
        if self._robot is not None:
            self._joint_stops = self.create_publisher(
                JointTrajectory, topics.STOP_JOINT_TRAJECTORY, qos.EVENT
            )
            self.create_subscription(
                JointState, topics.JOINT_STATES, self._joints.hear, qos.STREAM_IN
            )
        wanted = topics.COMMANDING[values["command"]]
        self.create_subscription(kind, wanted.name, self._on_command, qos.STREAM_IN)
        self._silence = SilentTopic(self, wanted.name, wanted.type)
        self._heading = Heading(self._silence.full_name, values["world_frame"])
        self.create_subscription(
            FusedEstimate, topics.FUSED_ESTIMATE, self._on_fused, qos.STREAM_IN
        )
        self.create_service(Trigger, topics.EMERGENCY_STOP, self._on_stop)
        self.create_service(Trigger, topics.RELEASE_STOP, self._on_release)
        self.create_timer(1.0 / values["rate"], self._step)

    def _renew(self, stamp_ns: int = 0) -> None:
        """Creates a governor for the held containers and the robot's present joint positions."""
        tray = self._container.tray
        held = tray if tray.present else tray.first.model
        self._held = self._told_container
        try:
            arm = None
            if not self._joints.missing:
                arm = arm_of(self._robot, self._joints.places, self._values)
            before = self._core
            self._core = governor_of(held, self._values, arm, at_rest=self._at_rest)
            if before is not None:
                self._core.go_on(before)
            self._refused = ""
        except SloshPlanError as error:
            self._core, self._refused = None, str(error)
            self._refused_at = [] if self._joints.missing else self._joints.places
        self._settings.publish({**self._container.files, **files_of_robot(self._values)}, stamp_ns)

    def _on_command(self, message: Any) -> None:
        self._report.counts["command"] += 1
        if self._core is None or self._joints.missing:
            return
        self._silence.heard()
        self._heading = self._heading.of(message, self.now_ns())
        if self._of_joints is not None:
            command: Command = self._of_joints.command(
                message, self._names, self._values["values"]
            )
        else:
            command = motion_command(message, self._values["world_frame"])
        self._core.take(command)

    def _on_fused(self, message: FusedEstimate) -> None:
        if not message.trusted or self._core is None:
            return
        stamp_ns = to_nanoseconds(message.header.stamp)
        try:
            modal = modal_of(message)
        except ValueError:
            self._unseen = "modal_position and modal_velocity of different or odd lengths"
        else:
            self._unseen = self._core.see(
                SeenLiquid(
                    stamp_ns, modal, message.msh_stddev, message.frequency_factor,
                    message.uncorrected,
                )
            )  # fmt: skip
        if self._unseen:
            self._report.counts["fused_estimate refused"] += 1

    def _step(self) -> None:
        now_ns = self.now_ns()
        if self._waits and (self._core is None or self._core.rests):
            self._waits = False
            own = self._container.limit
            self._values["limit"] = self._limit if math.isnan(own) else own
            self._renew(now_ns)
        elif self._is_elsewhere:
            # Others have moved the container.
            self._at_rest &= self._core is None or self._core.arm is None
            self._renew(now_ns)
        if self._core is None or self._joints.missing:
            self._moved = None
            return
        started = time.perf_counter()
        self._locate(self._core, now_ns)
        begun = self._core.commands > 0
        self._at_rest &= not begun
        self._moved = moved = self._core.step(now_ns) if begun else self._core.idle(now_ns)
        self._seconds.append(time.perf_counter() - started)
        frame = self._values["world_frame"]
        if self._of_joints is None:
            self._safe.publish(safe_twist(moved, frame))
        else:
            self._safe.publish(
                self._of_joints.passed(
                    moved, self._names, self._core.period, self._values["values"]
                )
            )
        self._told.publish(governed_message(moved, frame, self._names))

    def _locate(self, core: Governor, now_ns: int) -> None:
        """Tells the governor the measured joint positions, or that recent ones are missing."""
        if self._robot is None or self._of_joints is not None:
            return
        self._lost = self._joints.silence(now_ns, TUNING.unheard)
        if self._lost:
            core.lose(lost=True)
        else:
            self._lost = core.locate(self._joints.places)

    @property
    def _is_elsewhere(self) -> bool:
        """Whether the joints were moved by something else while the governor was at rest."""
        if self._robot is None or self._joints.missing:
            return False
        core = self._core
        if core is None:
            return self._joints.places != self._refused_at
        if not core.joints.size:
            return True
        if core.arm is None:
            return False  # see `_locate`
        apart = np.abs(core.place - self._joints.places).max()
        return bool(core.rests and apart > TUNING.moved)

    @property
    def _told_container(self) -> tuple[object, ...]:
        return (self._container.files, self._container.limit)

    def _on_container(self) -> None:
        """After a change of the container, stops; a new governor then knows nothing of its liquid.

        The same container told again is no change: its liquid goes on.
        """
        if not self._waits and repr(self._told_container) == repr(self._held):
            return
        self._waits, self._at_rest = True, False
        if self._core is not None:
            self._core.stop()

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._report.counts["emergency_stop"] += 1
        response.success, response.message = True, "at rest"
        core, moved = self._core, self._moved
        if core is None:
            return response
        told = copy.deepcopy(core).stopped() if moved and core.commands else []
        core.stop()
        if told and moved and not core.rests:
            moving = [moved, *told]
            self._stops.publish(stop_message(moving, core.period, self._values["world_frame"]))
            if self._robot is not None:
                self._joint_stops.publish(joint_trajectory(moving, self._names, core.period))
            gone = math.dist(told[-1].position, moved.position)
            highest = max(told, key=lambda one: one.peak / one.limit)
            whose = f" in {highest.worst}" if highest.worst else ""
            response.message = (
                f"at rest in {core.period * len(told):.2f} s, {1e3 * gone:.0f} mm from "
                f"here; the liquid{whose} rises to {1e3 * highest.peak:.1f} mm at most"
            )
        return response

    def _on_release(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        free = self._core is not None and not self._waits and self._core.release()
        response.success = free
        response.message = "commands are followed" if free else "not at rest yet"
        return response

    def _health(self) -> Health:
        if self._refused:
            return ERROR, self._refused
        if self._joints.missing:
            return WARN, self._joints.waiting
        moved = self._moved
        if moved is None or (not moved.steps and moved.safe):
            waits = self._lost or self._silence.misfit()
            return (WARN, waits) if waits else (OK, "no command yet")
        doing = moved.state.name.lower()
        if not moved.safe:
            beside = self._stop_told(moved, doing) if moved.reason else self._silence.misfit()
            return ERROR, "; ".join(filter(None, [not_safe(moved), beside or self._remark]))
        if self._lost:
            return WARN, f"{doing}: {self._lost}"
        if self._unseen:
            return WARN, f"{doing}: {topics.FUSED_ESTIMATE} is not used: {self._unseen}"
        if moved.refused_by:
            doing += f", {moved.refused_by}"
        if moved.state is GovernorState.STOPPING or moved.reason:
            return WARN, self._stop_told(moved, doing)
        level = WARN if self._heading.doubts_unit(moved) else OK
        return level, "; ".join(filter(None, [doing, self._remark]))

    @property
    def _remark(self) -> str:
        """What is doubtful about the last command, which is followed all the same."""
        return self._heading.remark(self._moved)

    def _stop_told(self, moved: Governed, doing: str) -> str:
        """Says why it stops, and what helps."""
        text = why(moved, self._heading)
        if moved.reason is StopReason.SILENT:
            text = self._silence.misfit() or text
        return f"{doing}: {moved.reason.name.lower()}" + (text and f": {text}")

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
                "worst container": self._moved.worst,
                "unknown wave [mm]": round(1e3 * self._moved.unknown, 2),
                "unknown because": self._moved.unknown_cause,
            }
        return facts


def main() -> int:
    """Runs the governor node."""
    return run_node(lambda: GovernorNode(later=True))


if __name__ == "__main__":
    sys.exit(main())
