"""Notices whose messages cannot pass, as the two ends of a topic ask for and offer other QoS.

To the middleware that is no error: nothing comes, as if nobody spoke. It tells by an event, once,
when it meets such an end; which one it is, and whether it is still there, the graph tells.
"""

from __future__ import annotations

from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from slosh_msgs_py.node.rivals import node_of

_ERROR = "ERROR: "


class Mismatches:
    """The ends that do not fit those of a node.

    Args:
        node: the node.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._read: dict[str, QoSProfile] = {}
        self._published: dict[str, QoSProfile] = {}

    def of_subscription(self, topic: str, asked: QoSProfile) -> SubscriptionEventCallbacks:
        """What watches a subscription of the node: its topic, and what it asks for."""
        return SubscriptionEventCallbacks(incompatible_qos=self._note(self._read, topic, asked))

    def of_publisher(self, topic: str, offered: QoSProfile) -> PublisherEventCallbacks:
        """What watches a publisher of the node: its topic, and what it offers."""
        return PublisherEventCallbacks(incompatible_qos=self._note(self._published, topic, offered))

    def look(self) -> str:
        """Who is not heard or does not hear, why and what to do, in a line; empty: nobody."""
        return "; ".join(self._unheard() + self._unhearing())

    def _note(self, met: dict[str, QoSProfile], topic: str, own: QoSProfile) -> Any:
        def note(_: Any) -> None:
            met[self._node.resolve_topic_name(topic)] = own

        return note

    def _unheard(self) -> list[str]:
        lines = []
        for topic, asked in list(self._read.items()):
            publishers = self._node.get_publishers_info_by_topic(topic)
            found = [
                _line(topic, one, "is not heard", why)
                for one in publishers
                if (why := _reason(one.qos_profile, asked))
            ]
            lines += found or self._forget(self._read, topic)
        return lines

    def _unhearing(self) -> list[str]:
        lines = []
        for topic, offered in list(self._published.items()):
            subscriptions = self._node.get_subscriptions_info_by_topic(topic)
            found = [
                _line(topic, one, "hears nothing", why)
                for one in subscriptions
                if (why := _reason(offered, one.qos_profile))
            ]
            lines += found or self._forget(self._published, topic)
        return lines

    @staticmethod
    def _forget(met: dict[str, QoSProfile], topic: str) -> list[str]:
        """Whoever it was has gone."""
        del met[topic]
        return []


def _line(topic: str, end: TopicEndpointInfo, what: str, why: str) -> str:
    return f"{topic}: {node_of(end)} {what}, its QoS does not fit: {why}; change it there"


def _reason(offered: QoSProfile, asked: QoSProfile) -> str:
    """Why a publisher and a subscription do not speak to each other; empty: they do."""
    _, text = qos_check_compatible(offered, asked)
    parts = (part.strip() for part in text.split(";"))
    return ", ".join(part.removeprefix(_ERROR) for part in parts if part.startswith(_ERROR))
