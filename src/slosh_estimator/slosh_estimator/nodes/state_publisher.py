"""Publishes the estimator's complete state several times a second."""

from __future__ import annotations

from rclpy.node import Node

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.estimator import Estimator
from slosh_estimator.nodes.estimator_messages import fill_state
from slosh_estimator.state import EstimatorState
from slosh_motion.inputs.inputs import AnyInput
from slosh_msgs import msg as messages
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds, to_time

PERIOD_NS = SECOND // 4
"""How far the inputs' stamps go on between two states [ns]."""


class StatePublisher:
    """Publishes the estimator's state at regular intervals of the input stamps.

    Args:
        node: whose.
        frame: the container's.
    """

    def __init__(self, node: Node, frame: str) -> None:
        self._message = messages.EstimatorState()
        self._message.header.frame_id = frame
        self._publisher = node.create_publisher(
            messages.EstimatorState, topics.ESTIMATOR_STATE, qos.STREAM_OUT
        )
        self._last_ns = -PERIOD_NS

    def look(self, stamp_ns: int, estimator: Estimator, source: AnyInput) -> None:
        """Records that an input with this stamp [ns] was used; publishes the state if it is due.

        Before the input's estimate goes out: in a recording, too, the state comes first.
        """
        # Time that was set back begins anew.
        if 0 <= stamp_ns - self._last_ns < PERIOD_NS:
            return
        state = estimator.state()
        if state is None:
            return
        self._last_ns = stamp_ns
        self._message.header.stamp = to_time(stamp_ns)
        self._message.samples_used = source.gate.used
        fill_state(self._message, state, source.memory)
        self._publisher.publish(self._message)

    def take_up(
        self, message: messages.EstimatorState, estimator: Estimator, source: AnyInput
    ) -> None:
        """Restores a published state, as a replay does behind what its recording lacks.

        Raises:
            SloshEstimatorError: the state is one of another model, input or version.
        """
        self._last_ns = to_nanoseconds(message.header.stamp)
        estimator.take_up(EstimatorState.of_message(message))
        source.take_up(self._last_ns, message.input.tolist())
        source.gate.used = message.samples_used
