"""Why nothing comes on a topic, and for how long."""

from __future__ import annotations

import time

from rclpy.node import Node


class SilentTopic:
    """A topic that a node reads.

    Args:
        node: the node.
        name: the topic, as the node subscribes to it.
        type_name: what it reads, e.g. 'sensor_msgs/msg/Image'.

    Attributes:
        full_name: of the topic, as it is remapped.
    """

    def __init__(self, node: Node, name: str, type_name: str) -> None:
        self.full_name: str = node.resolve_topic_name(name)
        self._node, self._type_name = node, type_name
        self._since = time.monotonic()

    @property
    def seconds(self) -> float:
        """For how long nothing has been heard [s]."""
        return time.monotonic() - self._since

    def heard(self) -> None:
        """Something has come."""
        self._since = time.monotonic()

    def reason(self) -> str:
        """Why nothing comes, as far as the middleware knows."""
        name = self.full_name
        types = [info.topic_type for info in self._node.get_publishers_info_by_topic(name)]
        if not types:
            return f"nobody publishes {name}"
        if self._type_name not in types:
            return f"{name} is published as {types[0]}, it must be {self._type_name}"
        others = sorted({*types} - {self._type_name})
        strange = f"; it is published as {others[0]}, too, which is not heard" if others else ""
        return f"the publisher of {name} is silent{strange}"
