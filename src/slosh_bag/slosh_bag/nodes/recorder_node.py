"""The recorder node: every topic of the cell into a bag, bytes untouched."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from slosh_bag.bag_writer import Split
from slosh_bag.errors import SloshBagError
from slosh_bag.nodes.recorder_health import findings
from slosh_bag.nodes.topic_input import Received, TopicInput, noted
from slosh_bag.recorder import SEVERAL, Recorder
from slosh_bag.recording.log_times import LogTimes
from slosh_files.nanoseconds import SECOND
from slosh_msgs.msg import NodeSettings
from slosh_msgs_py import topics
from slosh_msgs_py.message_type import find_type
from slosh_msgs_py.node.diagnostics import DiagnosticsReporter, Health
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.readiness import RECORDED
from slosh_msgs_py.node.run import run_node

DISCOVERY_PERIOD = 0.2
TAKE_PERIOD = 0.05
_SETTLED = 2_000_000  # ns; a message received this long ago can be taken by now
PARAMETERS = (
    ParameterSpec("output", "bag", "folder of the bag; it must be new or empty"),
    ParameterSpec("topics", ".*", "regular expression of the topics to record"),
    ParameterSpec(
        "exclude",
        # Compressed images hold what the raw ones do, in a tenth of the space. Names with /_ are
        # hidden by convention: the inner topics of actions, of no use in a bag.
        "^/(rosout|parameter_events)$|/image_raw$|/_",
        "regular expression of those to leave out",
    ),
    ParameterSpec(
        "max_bag_size",
        4_000_000_000,
        "a file of this size is followed by the next one [bytes]; 0: never",
        bounds=(0, 10**15),
    ),
    ParameterSpec(
        "max_bag_duration",
        0,
        "time after which the next file begins [s]; 0: never",
        bounds=(0, 10**9),
    ),
)


class RecorderNode(GuardedNode):
    """Discovers topics, takes their messages raw, hands the bytes to the core."""

    def __init__(self) -> None:
        self.failure = ""
        self._inputs: dict[str, TopicInput] = {}
        super().__init__("recorder")
        values = declare(self, PARAMETERS)
        self._include = _pattern("topics", values["topics"])
        self._exclude = _pattern("exclude", values["exclude"])
        self._unknown: dict[str, str] = {}
        self._other_types: dict[str, str] = {}
        self._shared: set[str] = set()
        self._told: set[str] = set()
        self._held: list[Received] = []
        self._times = LogTimes(time.time_ns(), time.monotonic_ns())
        self._core = Recorder(
            Path(values["output"]),
            Split(values["max_bag_size"], values["max_bag_duration"] * SECOND),
        )
        self._reported = self._reported_lost = 0
        self._report = DiagnosticsReporter(self, self._health, self._facts)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._clocked = [
            self.create_timer(DISCOVERY_PERIOD, self._discover, clock=steady),
            self.create_timer(TAKE_PERIOD, self._take, clock=steady),
        ]
        self._discover()

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """What an executor serves: not the recorded topics, those are taken in batches."""
        taken = {topic.subscription for topic in self._inputs.values()}
        return (entry for entry in super().subscriptions if entry not in taken)

    def close(self) -> None:
        """Finishes the bag."""
        self._take(final=True)
        self._core.close()
        status = self._core.status()
        total = sum(status.written.values())
        self.get_logger().info(f"{total} messages in {status.path.parent}, {status.lost} lost")
        if status.lost:
            why = status.failure or "the disk was too slow, or the bag was deleted"
            self.failure = f"{status.lost} messages are lost, which the bag notes: {why}"

    def _discover(self) -> None:
        now = time.monotonic()
        self._take()  # a subscription that is replaced takes its messages with it
        for entry in self._inputs.values():
            change = entry.watch(now)
            if change and entry.silent_since is not None:
                self.get_logger().warning(f"{entry.topic}: {change}")
            elif change:
                self.get_logger().info(f"{entry.topic}: {change}")
        self._other_types = {}
        for topic, types in self.get_topic_names_and_types():
            if topic in self._inputs and len(types) > 1:
                own = self._inputs[topic].type_name
                self._other_types[topic] = next(kind for kind in types if kind != own)
            known = topic in self._inputs or topic in self._unknown
            if self._wants(topic) and not known and self.count_publishers(topic):
                self._add(topic, types[0], now)

    def _wants(self, topic: str) -> bool:
        return bool(self._include.search(topic)) and not self._exclude.search(topic)

    def _add(self, topic: str, type_name: str, now: float) -> None:
        try:
            message_type = find_type(type_name)
        except (AttributeError, ImportError, ValueError):
            self._unknown[topic] = f"{type_name} is not installed here"
            self.get_logger().error(f"{topic} is not recorded: {self._unknown[topic]}")
            return
        entry = TopicInput(self, topic, type_name, message_type, now)
        self._core.add_topic(topic, type_name, noted(entry.profile))
        self._inputs[topic] = entry

    def _hold(self, received: Received) -> None:
        arrived_ns = self._times.of(received.arrived_ns)
        self._held.append(received._replace(arrived_ns=arrived_ns))

    def _take(self, final: bool = False) -> None:
        """Hands over what has come, in the order in which it came on all topics together."""
        now = time.time_ns()
        self._times.look(now, time.monotonic_ns())
        settled = self._times.of(now) - _SETTLED
        for entry in self._inputs.values():
            entry.take(self._hold)
        if not self._held:
            return
        clock = self.get_clock()
        simulated = clock.now().nanoseconds if clock.ros_time_is_active else None
        held, self._held = sorted(self._held, key=lambda received: received.arrived_ns), []
        for received in held:
            # One of another topic may have come before it. After a step of the clock none waits.
            if not final and 0 < received.arrived_ns - settled < SECOND:
                self._held.append(received)
            elif simulated is None:
                log_ns = self._times.in_order(received.arrived_ns)
                self._core.add(received.topic, received.data, log_ns, received.sent_ns or None)
            else:
                self._core.add(received.topic, received.data, simulated)
        if not final:
            self._look_for_settings(held)

    def _look_for_settings(self, taken: Sequence[Received]) -> None:
        """Tells at once whose settings have come: a run does not begin before."""
        before = len(self._told)
        for received in taken:
            if self._inputs[received.topic].message_type is NodeSettings:
                self._told.add(deserialize_message(received.data, NodeSettings).node)
        if len(self._told) > before:
            self._report.report()

    def _health(self) -> Health:
        status = self._core.status()
        total, lost = sum(status.written.values()), self._lost_on_the_way()
        silent = total == self._reported
        newly_lost = lost - self._reported_lost
        self._reported, self._reported_lost = total, lost
        left_out = self._unknown | status.refused
        absent, shared = self._absent(), self._look_for_shared()
        return findings(status, absent, newly_lost, left_out, silent, shared, self._other_types)

    def _look_for_shared(self) -> list[str]:
        """Topics of one node on which several have just spoken; the bag notes all of them."""
        shared = [entry.topic for entry in self._inputs.values() if entry.is_shared()]
        self._shared.update(shared)
        if shared:
            self._core.note(SEVERAL, ",".join(sorted(self._shared)))
        return shared

    def _facts(self) -> dict[str, Any]:
        status = self._core.status()
        recorded = {}
        if self._wants(self.resolve_topic_name(topics.SETTINGS)):
            recorded = {RECORDED: ", ".join(sorted(self._told))}
        return recorded | {
            "file": status.path,
            "files": status.files,
            "topics": len(status.written),
            "messages": sum(status.written.values()),
            "bytes": status.size,
            "lost": status.lost,
            "lost while nothing could be written": status.lost_meanwhile,
            "lost on the way": self._lost_on_the_way(),
            "queue": status.waiting,
            "queue maximum": status.highest,
            "oldest unwritten message [s]": f"{status.age:.2f}",
            "free space [MB]": round(1e-6 * status.free),
            "written [MB/s]": f"{1e-6 * status.rate:.2f}",
            "topics without a publisher": ", ".join(self._absent()),
        }

    def _absent(self) -> dict[str, float]:
        """Since when each topic that has no publisher has had none [s]."""
        now = time.monotonic()
        return {
            topic: now - entry.silent_since
            for topic, entry in self._inputs.items()
            if entry.silent_since is not None
        }

    def _lost_on_the_way(self) -> int:
        return sum(entry.lost for entry in self._inputs.values())


def _pattern(name: str, text: str) -> re.Pattern[str]:
    try:
        return re.compile(text)
    except re.error as error:
        raise SloshBagError(
            f"parameter {name} = {text!r}: no regular expression: {error}"
        ) from None


def main() -> int:
    """Runs the node."""
    return run_node(RecorderNode)


if __name__ == "__main__":
    sys.exit(main())
