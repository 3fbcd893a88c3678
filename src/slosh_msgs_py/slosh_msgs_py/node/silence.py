"""Explains why no messages arrive on a topic, and for how long."""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING, Final

from slosh_msgs_py.node.network import TRANSPORTS, WITHOUT_SHARED_MEMORY, has_shared_memory

if TYPE_CHECKING:  # who reads what nodes say needs no middleware
    from rclpy.node import Node

UNHEARD: Final = "no messages on"
"""Fact of a node that has heard nothing on a topic for LONG, though somebody publishes it: the
topic and its type."""
LONG: Final = 5.0
"""A publisher that is at work pauses for less [s]."""


class SilentTopic:
    """Watches a subscribed topic for the absence of messages.

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
        self._since = self._came = time.monotonic()
        self._total = 0
        self._has_heard = False

    @property
    def seconds(self) -> float:
        """Time since the last valid message of the topic [s]."""
        return time.monotonic() - self._since

    def heard(self) -> None:
        """Records that a valid message has just arrived."""
        self._since = time.monotonic()
        self._has_heard = True

    def facts(self, total: int) -> dict[str, str]:
        """Returns a diagnostics entry if messages are published but not received; else empty.

        Args:
            total: how many messages have come so far, of use or not.
        """
        now = time.monotonic()
        if total != self._total:
            self._total, self._came, self._has_heard = total, now, True
        if now - self._came < LONG or self._type_name not in self._types():
            return {}
        return {UNHEARD: f"{self.full_name} {self._type_name}"}

    def reason(self) -> str:
        """Describes why no messages arrive, as far as the middleware knows."""
        name = self.full_name
        types = self._types()
        if not types:
            return f"{name} has no publisher"
        if self._type_name not in types:
            return f"{name} is published as {types[0]}, but must be {self._type_name}"
        others = sorted({*types} - {self._type_name})
        strange = f"; it is also published as {others[0]}, which is not received" if others else ""
        return f"the publisher of {name} sends no messages{self._unshared()}{strange}"

    def misfit(self) -> str:
        """Says that the topic is published with other types alone; empty if it is not."""
        types = self._types()
        return self.reason() if types and self._type_name not in types else ""

    def _unshared(self) -> str:
        """Returns a hint that shared memory may fail between users; empty once a message came."""
        if self._has_heard or not has_shared_memory(os.environ):
            return ""
        remedy = f"set {TRANSPORTS}={WITHOUT_SHARED_MEMORY} for this process"
        return f", or belongs to another user or container; then {remedy}"

    def _types(self) -> list[str]:
        """Returns the message types of the topic's publishers."""
        found = self._node.get_publishers_info_by_topic(self.full_name)
        return [info.topic_type for info in found]
