"""The newest estimate, polled on demand."""

from __future__ import annotations

from typing import Any

import numpy as np
from rclpy.node import Node

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.sampling import TOO_SLOW
from slosh_estimator.validity import EstimateFlag
from slosh_msgs.msg import ModelEstimate, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_plan import LiquidState

OLDEST = 0.5
"""An estimate older than this [s] says nothing of the liquid now."""
UNKNOWN = EstimateFlag.SETTLING | EstimateFlag.AFTER_GAP | EstimateFlag.DIVERGED
"""Flags of an estimate whose state is not that of the liquid."""


class NewestEstimate:
    """Subscribes to estimates without a callback, and takes the newest on demand.

    A thousand messages a second must not wake the process. So the subscription is one of a hidden
    node that no executor has. A callback group that never executes is not enough: the events
    executor does not ask callback groups, and takes every message away.

    Args:
        node: the node.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        # The name on the command line would be this node's name, too.
        self._reader = Node(
            f"_{node.get_name()}_newest_estimate", namespace=node.get_namespace(),
            context=node.context, use_global_arguments=False, enable_rosout=False,
            start_parameter_services=False,
        )  # fmt: skip
        self._subscription = self._reader.create_subscription(
            SloshEstimate, node.resolve_topic_name(topics.ESTIMATE), lambda _: None,
            qos.NEWEST_IN,
        )  # fmt: skip
        self._last: SloshEstimate | None = None

    def state(self) -> LiquidState:
        """Returns the present state of the liquid.

        Raises:
            SloshEstimatorError: nobody tells, or what is told is old or no known state.
        """
        with self._subscription.handle:
            taken = self._subscription.handle.take_message(SloshEstimate, False)
        if taken is not None:
            self._last = taken[0]
        message = self._last
        if message is None:
            raise SloshEstimatorError(
                f"no estimate has come on {self._subscription.topic_name}: the liquid's state is "
                "unknown; is the estimator running?"
            )
        age = (self._node.get_clock().now().nanoseconds - to_nanoseconds(message.header.stamp)) / (
            SECOND
        )
        if age > OLDEST:
            raise SloshEstimatorError(
                f"the last estimate is {age:.2f} s old: the liquid's state is unknown"
            )
        flags = EstimateFlag(message.flags) & UNKNOWN
        if flags:
            raise SloshEstimatorError(
                f"the estimate's flags {int(flags):#x} say that the liquid's state is unknown; "
                "wait until it has settled"
            )
        if message.flags & EstimateFlag.INPUT_TOO_SLOW:
            raise SloshEstimatorError(f"{TOO_SLOW}, and so is the liquid's state")
        return LiquidState(_modal(message.linear), _modal(message.nonlinear))


def _modal(answer: ModelEstimate) -> Any:
    position = np.array(answer.modal_position).reshape(-1, 2)
    velocity = np.array(answer.modal_velocity).reshape(-1, 2)
    return np.hstack((position, velocity))
