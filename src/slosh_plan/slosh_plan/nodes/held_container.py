"""Follows changes of the container in the gripper, for predictor and planner."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.held_container import HeldContainer, held_by
from slosh_model.model import Model
from slosh_msgs.msg import ContainerChange
from slosh_msgs_py import qos, topics


class ContainerWatch:
    """Follows changes of the container that the gripper holds.

    Args:
        node: the node.
        start: its own model.
        changed: is called after each change.

    Attributes:
        held: what the gripper holds.
    """

    def __init__(self, node: Node, start: Model, changed: Callable[[], None]) -> None:
        self._node, self._start, self._changed = node, start, changed
        self.held, self._follows = HeldContainer(start), False
        node.create_subscription(
            ContainerChange, topics.CONTAINER, self._on_change, qos.LATCHED_STREAM
        )

    def model(self) -> Model:
        """Model of the container that the gripper holds.

        Raises:
            SloshEstimatorError: the gripper is empty.
        """
        if self.held.empty:
            raise SloshEstimatorError(
                f"the gripper is empty, says {topics.CONTAINER}: no liquid to predict"
            )
        return self.held.model

    def _on_change(self, message: ContainerChange) -> None:
        try:
            held = held_by(message, self._start)
        except ValueError as error:
            self._node.get_logger().error(f"{topics.CONTAINER}: not followed: {error}")
            return
        known, self._follows = self._follows, bool(message.model) or held.empty
        if not (known or self._follows):
            return  # the estimator has started, and so has this node
        self.held = held
        self._node.get_logger().info(f"now {held.described}")
        self._changed()
