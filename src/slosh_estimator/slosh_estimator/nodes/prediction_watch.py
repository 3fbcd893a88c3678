"""The monitor's ear for predictions: what became of them is published and told."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node

from slosh_estimator.agreement import MotionAgreement
from slosh_estimator.prediction_record import Announced, PredictionRecord
from slosh_msgs.msg import MotionPrediction, PredictionOutcome
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.stamps import to_nanoseconds


class PredictionWatch:
    """Takes a node's predictions and motions, publishes outcomes.

    Args:
        node: the node.
        frame: of the container.
    """

    def __init__(self, node: Node, frame: str) -> None:
        self._node, self._frame = node, frame
        self._record = PredictionRecord()
        self._outcomes = node.create_publisher(
            PredictionOutcome, topics.PREDICTION_OUTCOME, qos.EVENT
        )
        node.create_subscription(
            MotionPrediction, topics.PREDICTION, self._on_prediction, qos.EVENT
        )

    def reset(self) -> None:
        """Starts the record anew."""
        self._record.reset()

    def judge(self, motion: MotionAgreement) -> None:
        """Takes a motion that has ended; publishes what became of its prediction."""
        outcome = self._record.judge(motion)
        if outcome is None:
            return
        message = filled(PredictionOutcome, frame_id=self._frame, **outcome._asdict())
        self._outcomes.publish(message)
        self._node.get_logger().info(f"planned motion {outcome.id}: {outcome.description}")

    def facts(self) -> dict[str, Any]:
        """For the diagnostics."""
        record, last = self._record, self._record.last
        if last is None:
            return {"predictions": 0}
        return {
            "predictions": record.count,
            "last prediction": last.description,
            "MAE of predictions [mm]": f"{1e3 * record.sigma:.2f}",
            "epsilon of predictions [%]": f"{1e2 * record.epsilon:.1f}",
        }

    def _on_prediction(self, message: MotionPrediction) -> None:
        self._record.announce(
            Announced(
                message.id,
                to_nanoseconds(message.header.stamp),
                to_nanoseconds(message.start),
                message.duration,
                message.peak,
            )
        )
