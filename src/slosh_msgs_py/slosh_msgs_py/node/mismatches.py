"""Detects topics on which incompatible QoS prevents communication.

To the middleware that is no error: nothing comes, as if nobody spoke. It tells by an event, once,
when it meets such an end; which one it is, and whether it is still there, the graph tells.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from slosh_msgs_py.node.rivals import node_of

_ERROR = "ERROR: "
_INFINITE = 2**62
"""No deadline is that long [ns]."""


class _Met:
    """A topic with an incompatible publisher or subscriber.

    Attributes:
        own: QoS of the node's own end.
        is_found: whether the graph has shown the other one, which may be later than the event.
    """

    def __init__(self, own: QoSProfile) -> None:
        self.own = own
        self.is_found = False


class Mismatches:
    """Tracks incompatible publishers and subscribers of a node's topics.

    Args:
        node: the node.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._read: dict[str, _Met] = {}
        self._published: dict[str, _Met] = {}

    def of_subscription(self, topic: str, asked: QoSProfile) -> SubscriptionEventCallbacks:
        """Creates the event handler that detects QoS mismatches of a subscription."""
        return SubscriptionEventCallbacks(incompatible_qos=self._note(self._read, topic, asked))

    def of_publisher(self, topic: str, offered: QoSProfile) -> PublisherEventCallbacks:
        """Creates the event handler that detects QoS mismatches of a publisher."""
        watch = self._note(self._published, topic, offered)
        return PublisherEventCallbacks(incompatible_qos=watch)

    def look(self) -> str:
        """Describes all QoS mismatches with reason and remedy; empty if there are none."""
        unheard = _lines(
            self._read, self._node.get_publishers_info_by_topic, "cannot be received",
            lambda own, other: _reason(other, own),
        )  # fmt: skip
        deaf = _lines(
            self._published,
            self._node.get_subscriptions_info_by_topic,
            "receives nothing",
            _reason,
        )
        return "; ".join([*unheard, *deaf])

    def _note(self, met: dict[str, _Met], topic: str, own: QoSProfile) -> Callable[[Any], None]:
        return lambda _: met.update({self._node.resolve_topic_name(topic): _Met(own)})


def _lines(
    met: dict[str, _Met],
    ends: Callable[[str], Sequence[TopicEndpointInfo]],
    what: str,
    reason: Callable[[QoSProfile, QoSProfile], str],
) -> list[str]:
    """Describes QoS mismatches, one line each; forgets topics whose mismatch has gone.

    Args:
        met: topics on which such an end was met.
        ends: the other ends of a topic.
        what: what happens to such an end.
        reason: why the node's own QoS and another one do not fit; empty: they do.
    """
    lines = []
    for topic, one in list(met.items()):
        reasons = [(end, reason(one.own, _told(end))) for end in ends(topic)]
        found = [_line(topic, end, what, why) for end, why in reasons if why]
        lines += found
        if one.is_found and not found:
            del met[topic]
        one.is_found = bool(found)
    return lines


def _told(end: TopicEndpointInfo) -> QoSProfile:
    """Returns an endpoint's QoS without placeholder values for infinite durations."""
    given = end.qos_profile
    has_deadline = given.deadline.nanoseconds < _INFINITE
    return QoSProfile(
        depth=1,
        reliability=given.reliability,
        durability=given.durability,
        deadline=given.deadline if has_deadline else Duration(),
    )


def _line(topic: str, end: TopicEndpointInfo, what: str, why: str) -> str:
    return f"{topic}: {node_of(end)} {what}, its QoS is incompatible: {why}; change it there"


def _reason(offered: QoSProfile, asked: QoSProfile) -> str:
    """Returns why the QoS of publisher and subscriber are incompatible; empty if they match."""
    _, text = qos_check_compatible(offered, asked)
    parts = (part.strip() for part in text.split(";"))
    return ", ".join(part.removeprefix(_ERROR) for part in parts if part.startswith(_ERROR))
