"""Predicts the liquid's response to each message on the topic `planned_trajectory`."""

from __future__ import annotations

import math

from rclpy.node import Node
from trajectory_msgs.msg import MultiDOFJointTrajectory

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.errors import SloshEstimatorError
from slosh_model.tilt import added_text, attitude_of
from slosh_model.tray import Tray
from slosh_motion.errors import SloshMotionError
from slosh_msgs.msg import MotionPrediction, PredictionOutcome
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.node.diagnostics import WARN, Health
from slosh_msgs_py.node.memory import LargeMessages
from slosh_msgs_py.point_arrays import unpacked
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_plan import HeightLimits
from slosh_plan.doubts import trajectory_doubts
from slosh_plan.look_ahead import Record, error_of, look_ahead, warning
from slosh_plan.nodes.held_container import ContainerWatch
from slosh_plan.nodes.newest_estimate import NewestEstimate
from slosh_plan.nodes.predict_messages import trajectory_of_points
from slosh_plan.start import LiquidStates
from slosh_plan.trajectory import MOST_POINTS
from slosh_plan.tray import TrayPrediction

MOST_BYTES = 50_000_000
"""Of a message: 200,000 points with poses, velocities and accelerations have 35 MB."""
POINT_BYTES = 80
"""Of a point with a pose."""
NAME = "the planned motion"


class PlannedMotions:
    """Receives planned trajectories and publishes predictions for them.

    Args:
        node: the node.
        container: what the gripper holds.
        limits: that motions are to keep.
        estimate: tells how the liquid stands.
        frame: of the container.

    Attributes:
        limits: that the next motions are to keep.
        count: trajectories so far.
        large: gives back the memory of large messages.
    """

    def __init__(
        self,
        node: Node,
        container: ContainerWatch,
        limits: HeightLimits,
        estimate: NewestEstimate,
        frame: str,
    ) -> None:
        self._node, self._container, self._frame = node, container, frame
        self.large = LargeMessages(node)
        self.limits = limits
        self._estimate = estimate
        self.count = 0
        self._last: MotionPrediction | None = None
        self._record: Record | None = None
        self._predictions = node.create_publisher(MotionPrediction, topics.PREDICTION, qos.EVENT)
        node.create_subscription(
            PredictionOutcome, topics.PREDICTION_OUTCOME, self._on_outcome, qos.EVENT
        )
        # Raw: what is too long for a motion is not unpacked.
        node.create_subscription(
            MultiDOFJointTrajectory, topics.PLANNED_TRAJECTORY, self._on_planned, qos.PLANNED_IN,
            raw=True,
        )  # fmt: skip

    def health(self) -> Health | None:
        """Returns a warning if the motion in progress exceeds a limit, otherwise None."""
        last = self._last
        if last is None or last.state == MotionPrediction.KEPT:
            return None
        began = max(to_nanoseconds(last.start), to_nanoseconds(last.header.stamp))
        since = (self._now() - began) / SECOND
        over = since > (0.0 if math.isnan(last.duration) else last.duration) + 5.0
        return None if over else (WARN, f"planned motion {last.id}: {last.description}")

    def _now(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

    def _on_outcome(self, message: PredictionOutcome) -> None:
        record = Record(message.count, message.sigma, message.epsilon)
        if not record.possible:
            self._node.get_logger().warning(
                f"a prediction_outcome with sigma {record.sigma:g} m and epsilon "
                f"{record.epsilon:g} is not used: the values are invalid"
            )
            return
        self._record = record

    def _on_planned(self, data: bytes) -> None:
        self.count += 1
        self.large.add(len(data) // POINT_BYTES)
        try:
            message = self._predicted(data)
        except ValueError as error:
            if not type(error).__module__.startswith("slosh_"):
                raise
            message = filled(
                MotionPrediction,
                stamp_ns=self._now(),
                frame_id=self._frame,
                state=MotionPrediction.REFUSED,
                id=self.count,
                description=str(error),
            )
        self._last = message
        self._predictions.publish(message)
        if message.state != MotionPrediction.KEPT:
            self._node.get_logger().warning(f"planned motion {message.id}: {message.description}")

    def _predicted(self, data: bytes) -> MotionPrediction:
        now = self._now()
        # Of this moment: while a long trajectory is unpacked the motion may begin.
        tray = self._container.asked("", topics.PREDICTION)
        state, whence = self._state(tray)
        if len(data) > MOST_BYTES:
            raise SloshEstimatorError(
                f"{NAME}: {1e-6 * len(data):.0f} MB are more than {1e-6 * MOST_BYTES:.0f} MB"
            )
        message = unpacked(data, MultiDOFJointTrajectory, MOST_POINTS)
        motion = trajectory_of_points(message.points, NAME)
        start_ns = to_nanoseconds(message.header.stamp)
        delay = (start_ns - now) / SECOND if start_ns else 0.0
        if delay < -motion.duration:
            raise SloshEstimatorError(
                f"{NAME}: by its stamp it has ended {-delay - motion.duration:.1f} s ago"
            )
        found = look_ahead(
            tray, motion, delay, limits=self.limits, state=state, error=error_of(self._record)
        )
        if delay < 0.0:
            whence += f"; by its stamp it began {-delay:.2f} s ago"
        added = added_text(tray.first.placed, attitude_of(motion))
        whence += f"; it {added}" if added else ""
        doubts = trajectory_doubts(motion, tray.first.placed)
        whence += "".join(f"; but {doubt}" for doubt in doubts)
        return self._message(found, now, start_ns, state is not None, whence)

    def _state(self, tray: Tray) -> tuple[LiquidStates | None, str]:
        """Returns the liquid's state; if unknown, None (taken as at rest) and the reason."""
        try:
            return self._estimate.state_for(tray), ""
        except SloshMotionError as error:
            return None, f"; predicted from rest: {error}"

    def _message(
        self, tray: TrayPrediction, now: int, start_ns: int, live: bool, whence: str
    ) -> MotionPrediction:
        found = tray.of_worst
        nonlinear, limits = found.nonlinear, found.limits
        said = warning(found) or f"the liquid will rise to {1e3 * found.upper:.1f} mm"
        said = f"worst container {tray.worst}: {said}" if tray.worst else said
        said = "; ".join(filter(None, (said, tray.falling)))
        return filled(
            MotionPrediction,
            stamp_ns=now,
            frame_id=self._frame,
            state=MotionPrediction.KEPT if tray.kept else MotionPrediction.EXCEEDED,
            id=self.count,
            start_ns=start_ns,
            from_estimate=live,
            duration=found.duration,
            peak=nonlinear.peak,
            peak_lower=found.lower,
            peak_upper=found.upper,
            peak_time=nonlinear.peak_time,
            azimuth=nonlinear.azimuth,
            residual=nonlinear.residual,
            limit=limits.height,
            residual_limit=limits.residual,
            excess=found.excess,
            residual_excess=found.residual_excess,
            flags=int(found.flags),
            distance_to_rim=found.distance_to_rim,
            description=said + whence,
            container=tray.worst,
        )
