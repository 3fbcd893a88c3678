"""Detects several publishers on a topic that should have only one."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from rclpy.topic_endpoint_info import TopicEndpointInfo

from slosh_base.files.nanoseconds import SECOND

if TYPE_CHECKING:  # which watches its publishers by this module
    from slosh_msgs_py.node.guarded import GuardedNode

AGAIN = 2.0
"""For so long a second publisher is there before it counts: one may be about to take over [s]."""
FORGOTTEN = 30.0
"""After so long the middleware has forgotten a node that was killed, and another of the same name
that took its place is not its rival [s]."""
PARTICIPANT = 12
"""So many bytes at the beginning of an endpoint's identity are its process's."""
NAMELESS = "_NODE_NAME_UNKNOWN_"
"""The name of a node that is known by its publishers and subscriptions alone."""
UNKNOWN = "unknown node"
"""How such a node is called in texts."""


def node_of(info: TopicEndpointInfo) -> str:
    """Returns the full node name of a publisher or subscription.

    Names come on their own way, later or, on a busy machine, not at all: until then each process
    is a node of its own, and two of them are two.
    """
    if info.node_name == NAMELESS:
        return f"{UNKNOWN} {bytes(info.endpoint_gid[:PARTICIPANT]).hex()}"
    return f"{info.node_namespace.rstrip('/')}/{info.node_name}"


class Rivals:
    """Detects further publishers of a topic that a node subscribes to.

    Args:
        node: the node.
        topic: as the node subscribes to it.
        type_name: what it reads; publishers of other types are not heard.
    """

    def __init__(self, node: GuardedNode, topic: str, type_name: str) -> None:
        self._node, self._topic, self._type_name = node, topic, type_name
        self._since: float | None = None

    def look(self) -> str:
        """Names the additional publishers of the topic in one line; empty if there are none.

        Is to be asked about once a second.
        """
        name = self._node.resolve_topic_name(self._topic)
        speakers = Counter(
            node_of(info)
            for info in self._node.get_publishers_info_by_topic(name)
            if info.topic_type == self._type_name
        )
        if speakers.total() < 2:
            self._since = None
            return ""
        now = self._node.steady_ns() / SECOND  # as the node's journal has it
        if self._since is None:
            self._since = now
        if now - self._since < (AGAIN if len(speakers) > 1 else FORGOTTEN):
            return ""
        named = ", ".join(speakers.elements())
        return f"{speakers.total()} publishers on {name}: {named}; stop all but one"
