"""The recorder node: every topic of the cell into a bag, bytes untouched."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy as Durability
from rclpy.qos import QoSHistoryPolicy as History
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy as Reliability
from rclpy.subscription import Subscription

from slosh_bag.bag_writer import Qos
from slosh_bag.errors import SloshBagError
from slosh_bag.recorder import Recorder
from slosh_msgs_py.node.diagnostics import ERROR, OK, STALE, WARN, DiagnosticsReporter, Health
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.run import run_node

DISCOVERY_PERIOD = 0.2
# Several seconds at 1 kHz: a stalled disk must not lose messages before the queue sees them.
DEPTH = 5000
PARAMETERS = (
    ParameterSpec("output", "bag", "folder of the bag; it must be new or empty"),
    ParameterSpec("topics", ".*", "regular expression of the topics to record"),
    ParameterSpec(
        "exclude",
        # Names with /_ are hidden by convention: the inner topics of actions, of no use in a bag.
        "^/(rosout|parameter_events)$|/_",
        "regular expression of those to leave out",
    ),
)


class RecorderNode(Node):
    """Discovers topics, subscribes to them raw, hands the bytes to the core."""

    def __init__(self) -> None:
        super().__init__("recorder")
        values = declare(self, PARAMETERS)
        self._include = _pattern("topics", values["topics"])
        self._exclude = _pattern("exclude", values["exclude"])
        self._subscribed: dict[str, Subscription] = {}
        self._unknown: dict[str, str] = {}
        self._unheard: set[str] = set()
        self._core = Recorder(Path(values["output"]))
        self._reported = 0
        self._report = DiagnosticsReporter(self, self._health, self._facts)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self.create_timer(DISCOVERY_PERIOD, self._discover, clock=steady)
        self._discover()

    def close(self) -> None:
        """Finishes the bag."""
        self._core.close()
        status = self._core.status()
        total = sum(status.written.values())
        self.get_logger().info(f"{total} messages in {self._core.path}, {status.lost} lost")

    def _discover(self) -> None:
        for topic in sorted(self._unheard):
            self._adapt(topic)
        self._unheard.clear()
        for topic, types in self.get_topic_names_and_types():
            wanted = self._include.search(topic) and not self._exclude.search(topic)
            known = topic in self._subscribed or topic in self._unknown
            if wanted and not known and self.count_publishers(topic):
                self._add(topic, types[0])

    def _add(self, topic: str, type_name: str) -> None:
        try:
            message_type = find_type(type_name)
        except (AttributeError, ImportError, ValueError):
            self._unknown[topic] = f"{type_name} is not installed here"
            self.get_logger().error(f"{topic} is not recorded: {self._unknown[topic]}")
            return
        profile = self._offered(topic)
        self._core.add_topic(topic, type_name, noted(profile))
        self._subscribed[topic] = self._subscribe(message_type, topic, profile)

    def _adapt(self, topic: str) -> None:
        """Asks for less where a publisher that came later offers less than the first ones."""
        old = self._subscribed[topic]
        self.get_logger().warning(f"{topic}: a publisher offers less; subscribing anew")
        self.destroy_subscription(old)
        self._subscribed[topic] = self._subscribe(old.msg_type, topic, self._offered(topic))

    def _offered(self, topic: str) -> QoSProfile:
        return matching([info.qos_profile for info in self.get_publishers_info_by_topic(topic)])

    def _subscribe(self, message_type: Any, topic: str, profile: QoSProfile) -> Subscription:
        clock = self.get_clock()

        # Without the message's info: the events executor fails on messages that come with it.
        def receive(data: bytes) -> None:
            self._core.add(topic, data, clock.now().nanoseconds)

        # A subscription cannot be replaced inside its own event: the next discovery does it.
        events = SubscriptionEventCallbacks(incompatible_qos=lambda _: self._unheard.add(topic))
        return self.create_subscription(
            message_type, topic, receive, profile, event_callbacks=events, raw=True
        )

    def _health(self) -> Health:
        status = self._core.status()
        total = sum(status.written.values())
        silent, self._reported = total == self._reported, total
        if status.failure:
            return ERROR, f"nothing is recorded any more: {status.failure}"
        if status.lost:
            return ERROR, f"{status.lost} messages lost: the disk is too slow"
        left_out = self._unknown | status.refused
        if left_out:
            topic, reason = next(iter(left_out.items()))
            return WARN, f"{len(left_out)} topics are not recorded, such as {topic}: {reason}"
        return (STALE, "nothing to record") if silent else (OK, f"{total} messages recorded")

    def _facts(self) -> dict[str, Any]:
        status = self._core.status()
        return {
            "file": self._core.path,
            "topics": len(status.written),
            "messages": sum(status.written.values()),
            "bytes": status.size,
            "lost": status.lost,
            "queue": status.waiting,
            "queue maximum": status.highest,
        }


def find_type(name: str) -> Any:
    """The class of a message type, e.g. 'std_msgs/msg/Header'."""
    package, kind, message = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), message)


def _pattern(name: str, text: str) -> re.Pattern[str]:
    try:
        return re.compile(text)
    except re.error as error:
        raise SloshBagError(
            f"parameter {name} = {text!r}: no regular expression: {error}"
        ) from None


def matching(offered: list[QoSProfile]) -> QoSProfile:
    """The most demanding profile that every publisher of a topic still satisfies."""
    reliable = bool(offered) and all(p.reliability == Reliability.RELIABLE for p in offered)
    latched = bool(offered) and all(p.durability == Durability.TRANSIENT_LOCAL for p in offered)
    return QoSProfile(
        history=History.KEEP_LAST,
        depth=DEPTH,
        reliability=Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT,
        durability=Durability.TRANSIENT_LOCAL if latched else Durability.VOLATILE,
    )


def noted(profile: QoSProfile) -> Qos:
    """A profile as the bag notes it."""
    return Qos(
        "reliable" if profile.reliability == Reliability.RELIABLE else "best_effort",
        "transient_local" if profile.durability == Durability.TRANSIENT_LOCAL else "volatile",
    )


def main() -> int:
    """Runs the node."""
    return run_node(RecorderNode)


if __name__ == "__main__":
    sys.exit(main())
