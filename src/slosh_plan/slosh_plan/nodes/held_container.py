"""Follows changes of the container in the gripper, for the predictor and the planner."""

from __future__ import annotations

import math
from collections.abc import Callable

from rclpy.node import Node

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.held_container import held_by
from slosh_estimator.nodes.requested_model import tray_at
from slosh_model.model_text import format_model
from slosh_model.tray import TRAY, Tray, TrayContainer, format_tray, parse_tray
from slosh_msgs.msg import ContainerChange
from slosh_msgs_py import qos, topics


class ContainerWatch:
    """Keeps the description of what the gripper holds: one container, or a tray of containers.

    Args:
        node: the node.
        start: its own tray, or its model as a tray of one.
        changed: is called after each change.

    Attributes:
        tray: what the gripper holds.
        limit: of one container's heights in place of the node's own [m]; NaN: there is none.
    """

    def __init__(self, node: Node, start: Tray, changed: Callable[[], None]) -> None:
        self._node, self._start, self._changed = node, start, changed
        self.tray, self._follows = start, False
        self.limit, self._described = math.nan, start.first.model.container.described
        node.create_subscription(
            ContainerChange, topics.CONTAINER, self._on_change, qos.LATCHED_STREAM
        )

    @property
    def described(self) -> str:
        """Describes the container or tray in the gripper in one line."""
        if not self.tray.is_tray:
            return self._described
        pairs = (f"{one.name} {one.model.container.described}" for one in self.tray.present)
        return f"tray: {', '.join(pairs)}"

    @property
    def files(self) -> dict[str, str]:
        """Texts of the model and tray files in use, for the node's settings."""
        tray = {TRAY: format_tray(self.tray)} if self.tray.is_tray else {}
        return {"model": format_model(self.tray.first.model), **tray}

    def asked(self, path: str, service: str) -> Tray:
        """Returns the tray that a request names; a single model becomes a one-container tray.

        Args:
            path: of the file that the request names; empty: what the gripper holds.
            service: that is asked.

        Raises:
            SloshEstimatorError: there is no such file, or the gripper is empty.
        """
        tray = tray_at(path, self._node.get_logger().warning, service) if path else self.tray
        if not tray.present:
            raise SloshEstimatorError(
                f"the gripper is empty, says {path or topics.CONTAINER}: no liquid to predict"
            )
        return tray

    def _on_change(self, message: ContainerChange) -> None:
        try:
            held = held_by(message, self._start.first.model)
            tray = parse_tray(message.tray, "container.tray") if message.tray else None
        except ValueError as error:
            self._node.get_logger().error(f"{topics.CONTAINER}: not followed: {error}")
            return
        known, self._follows = self._follows, bool(message.model) or held.empty
        if not (known or self._follows):
            return  # the estimator has started, and so has this node
        if not self._follows:
            tray = self._start
        self.limit, self._described = held.limit, held.described
        self.tray = tray or Tray((TrayContainer("", held.model, empty=held.empty),))
        self._node.get_logger().info(f"now {self.described}")
        self._changed()
