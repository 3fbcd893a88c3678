"""Recorder node: records the cell's topics to a bag as serialised messages."""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from std_srvs.srv import Trigger

from slosh_bag.bag_writer import Split
from slosh_bag.black_box.black_box import Cause, Happening
from slosh_bag.black_box.event_bags import EventRecorder
from slosh_bag.black_box.ring import Place
from slosh_bag.nodes.event_messages import (
    EVENT_PARAMETERS,
    EventMessages,
    event_facts,
    event_recorder,
    place_of,
)
from slosh_bag.nodes.recorder_health import Traffic, findings, left_out_text
from slosh_bag.nodes.store_thread import STORE_PARAMETERS, StoreThread
from slosh_bag.nodes.topic_input import Received, TopicInput, noted
from slosh_bag.recorded_topics import TopicChoice, TopicSelection
from slosh_bag.recorder import PUBLISHERS, SEVERAL, Recorder, RecorderStatus
from slosh_bag.store.motion_ingest import PARAMETER as MOTIONS
from slosh_bag.store.motion_ingest import MotionIngest
from slosh_base.files.errors import YamlError
from slosh_base.files.nanoseconds import SECOND
from slosh_base.files.yaml_document import parse_yaml
from slosh_msgs.msg import NodeSettings
from slosh_msgs_py import topics
from slosh_msgs_py.conversions import find_type
from slosh_msgs_py.node.diagnostics import ERROR, WARN, DiagnosticsReporter, Health
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.readiness import RECORDED
from slosh_msgs_py.node.rivals import UNKNOWN
from slosh_msgs_py.node.run import run_node

STEP_NS = 50_000_000
"""From here on it is a step of the clock [ns], and no slewing."""
AHEAD_NS = 10_000_000
"""What was received so long after now was received before the clock was set back [ns]."""


class Arrivals:
    """Sorts messages by arrival while topics are polled one after the other.

    A message is held back until those that came before it on other topics must have been taken,
    and no longer than until the next call: a step of the clock holds nothing back for good.
    """

    def __init__(self) -> None:
        self._held: list[Received] = []

    def sort(self, taken: list[Received], settled: int) -> list[Received]:
        """Adds messages; returns, sorted by arrival, those that no later message can precede.

        Args:
            taken: of all topics, since the last call.
            settled: what came up to then has been taken, on every topic [ns].
        """
        # One pass over the topics may last for seconds: what was held since then is settled, too.
        until = max([settled, *(received.arrived_ns for received in self._held)])
        waiting = sorted([*self._held, *taken], key=lambda received: received.arrived_ns)
        self._held = [received for received in waiting if received.arrived_ns > until]
        return waiting[: len(waiting) - len(self._held)]

    def rest(self) -> list[Received]:
        """Returns the messages that were held back, in order of arrival."""
        held, self._held = self._held, []
        return held


class LogTimes:
    """Receive times of the system clock, corrected so that they never decrease.

    Bags are read by these times: of two stretches with the same ones nobody could tell which
    came first. Where the clock is set back they go on as if it had not been, until it is there
    again.

    Args:
        system_ns, steady_ns: both clocks' time [ns].
    """

    def __init__(self, system_ns: int, steady_ns: int) -> None:
        self._now = system_ns
        self._between = system_ns - steady_ns
        self._shift = self._shift_before = 0
        self._last = 0

    def look(self, system_ns: int, steady_ns: int) -> None:
        """Reads system clock and monotonic clock; call it before messages are polled."""
        step = system_ns - steady_ns - self._between
        self._now, self._between = system_ns, system_ns - steady_ns
        self._shift_before = self._shift
        if abs(step) > STEP_NS:
            self._shift = max(self._shift - step, 0)

    def of(self, received_ns: int) -> int:
        """Returns the log time for a message received at a system time [ns]."""
        before_the_step = received_ns > self._now + AHEAD_NS
        return received_ns + (self._shift_before if before_the_step else self._shift)

    def in_order(self, time_ns: int) -> int:
        """Returns a log time [ns], raised to the previous message's log time if that is later."""
        self._last = max(self._last, time_ns)
        return self._last


DISCOVERY_PERIOD = 0.2
TAKE_PERIOD = 0.05
_SETTLED = 2_000_000  # ns; a message received this long ago can be taken by now
COMPLETE, EVENTS = "complete", "events"
PARAMETERS = (
    ParameterSpec("output", "bag", "folder of the bag; it must be new or empty"),
    ParameterSpec(
        "topics",
        "",
        "regular expression of further topics to record; '.*': all topics",
    ),
    ParameterSpec(
        "exclude",
        # Names with /_ are hidden by convention: the inner topics of actions, of no use in a bag.
        "^/(rosout|parameter_events)$|/_",
        "regular expression of topics to leave out",
    ),
    ParameterSpec(
        "raw_images",
        False,
        "record raw images even where compressed ones are recorded",
    ),
    ParameterSpec(
        "max_bag_size",
        4_000_000_000,
        "size after which a new file begins [bytes]; 0: never",
        bounds=(0, 10**15),
    ),
    ParameterSpec(
        "max_bag_duration",
        0,
        "time after which a new file begins [s]; 0: never",
        bounds=(0, 10**9),
    ),
    ParameterSpec(
        "mode",
        COMPLETE,
        "complete: one bag of all messages; events: one bag for the time around each event",
        choices=(COMPLETE, EVENTS),
    ),
    ParameterSpec(
        MOTIONS,
        "",
        "folder or URL, such as s3://bucket/motions, to which `slosh ingest` adds the motions of "
        "the finished recording; empty: they are not stored",
    ),
    *EVENT_PARAMETERS,
    *STORE_PARAMETERS,
)

_RCL_ERRORS = (RuntimeError, ValueError)
"""Of a node that has just ended; rclpy's NodeNameNonExistentError is a RuntimeError."""


class RecorderNode(GuardedNode):
    """Node that subscribes to all topics of a cell and records their serialised messages."""

    def __init__(self) -> None:
        self.failure = ""
        self._inputs: dict[str, TopicInput] = {}
        super().__init__("recorder")
        values = declare(self, PARAMETERS)
        self._choice = TopicChoice(
            self.get_namespace(),
            values["topics"],
            values["exclude"],
            raw_images=values["raw_images"],
        )
        self._chosen = TopicSelection()
        self._unknown: dict[str, str] = {}
        self._other_types: dict[str, str] = {}
        self._shared: dict[str, list[str]] = {}
        self._missed: Counter[str] = Counter()  # of inputs that are no longer recorded
        self._traffic = Traffic()
        self._told: set[str] = set()
        self._stated: set[str] = set()  # topics that the nodes' settings name
        self._taken: list[Received] = []
        self._arrivals = Arrivals()
        self._times = LogTimes(time.time_ns(), time.monotonic_ns())
        self._events: EventMessages | None = None
        self._core = self._made_core(values)
        self._store = StoreThread(Path(values["output"]), values, self.get_logger().info)
        self._motions = MotionIngest(values[MOTIONS], Path(values["output"]))
        self.create_service(Trigger, topics.KEEP, self._keep)
        self._reported = self._reported_lost = 0
        self._report = DiagnosticsReporter(self, self._health, self._facts)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._clocked = [
            self.create_timer(DISCOVERY_PERIOD, self._discover, clock=steady),
            self.create_timer(TAKE_PERIOD, self._take, clock=steady),
        ]
        self._discover()

    def _made_core(self, values: Mapping[str, Any]) -> Recorder | EventRecorder:
        folder = Path(values["output"])
        if values["mode"] == COMPLETE:
            split = Split(values["max_bag_size"], values["max_bag_duration"] * SECOND)
            return Recorder(folder, split)
        self._events = EventMessages(self, values)
        return event_recorder(folder, values, self._place)

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Yields the subscriptions for the executor; recorded topics are polled instead."""
        taken = {topic.subscription for topic in self._inputs.values()}
        return (entry for entry in super().subscriptions if entry not in taken)

    def close(self) -> None:
        """Finishes the bag and stops the node."""
        self._take(final=True)
        for entry in self._inputs.values():
            entry.settle()
        self._core.miss(self._lost_on_the_way())
        self._core.close()
        self._store.close()
        status = self._core.status()
        total = sum(status.written.values())
        self.get_logger().info(f"{total} messages in {status.path.parent}, {status.lost} lost")
        if status.lost:
            self.failure = f"{status.lost} messages are lost (noted in the bag): {_why(status)}"
        # Only now: reading a bag competes with nothing that is recorded.
        self._motions.run(self._report.report)
        self.failure = "; ".join(filter(None, (self.failure, self._motions.complaint)))

    def _discover(self) -> None:
        now = time.monotonic()
        self._take()  # a subscription that is replaced takes its messages with it
        for entry in self._inputs.values():
            change = entry.watch(now)
            if change and entry.silent_since is not None:
                self.get_logger().warning(f"{entry.topic}: {change}")
            elif change:
                self.get_logger().info(f"{entry.topic}: {change}")
        graph = dict(self.get_topic_names_and_types())
        self._other_types = {
            topic: next(kind for kind in graph[topic] if kind != entry.type_name)
            for topic, entry in self._inputs.items()
            if len(graph.get(topic, ())) > 1
        }
        kinds = {topic: types[0] for topic, types in graph.items()}
        used = used_topics(self) | self._stated
        chosen = self._choice.choose(kinds, used, self.count_publishers, now)
        for topic in self._inputs.keys() & chosen.left_out.keys():
            self._remove(topic, chosen.left_out[topic])
        for topic, kind in chosen.recorded.items():
            if topic not in self._inputs and topic not in self._unknown:
                self._add(topic, kind, now)
        self._chosen = chosen

    def _remove(self, topic: str, reason: str) -> None:
        entry = self._inputs.pop(topic)
        entry.settle()
        self._missed[topic] += entry.lost
        self.destroy_subscription(entry.subscription)
        self.get_logger().info(f"{topic} is no longer recorded: {reason}")

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
        self.get_logger().info(f"{topic} is recorded: {type_name}")

    def _hold(self, received: Received) -> None:
        arrived_ns = self._times.of(received.arrived_ns)
        self._taken.append(received._replace(arrived_ns=arrived_ns))
        self._traffic.add(received.topic, len(received.data))

    def _take(self, final: bool = False) -> None:
        """Passes received messages to the recorder in order of arrival across topics."""
        now = time.time_ns()
        self._times.look(now, time.monotonic_ns())
        settled = self._times.of(now) - _SETTLED
        for entry in self._inputs.values():
            entry.take(self._hold)
        taken, self._taken = self._taken, []
        known = self._arrivals.sort(taken, settled) + (self._arrivals.rest() if final else [])
        clock = self.get_clock()
        simulated = clock.now().nanoseconds if clock.ros_time_is_active else None
        for received in known:
            if simulated is None:
                log_ns = self._times.in_order(received.arrived_ns)
                self._core.add(received.topic, received.data, log_ns, received.sent_ns or None)
            else:
                self._core.add(received.topic, received.data, simulated)
            self._look_for_event(received)
        if isinstance(self._core, EventRecorder):
            self._core.look(settled if simulated is None else simulated)
        if not final:
            self._look_for_settings(taken)

    def _look_for_event(self, received: Received) -> None:
        entry = self._inputs.get(received.topic)
        if entry is None or self._events is None or not isinstance(self._core, EventRecorder):
            return
        for happening in self._events.happenings(received, entry.message_type):
            self._happen(self._core, happening)

    def _happen(self, core: EventRecorder, happening: Happening) -> None:
        core.happen(happening)
        where = core.path if core.box.is_writing else f"no bag: {core.box.failure}"
        self.get_logger().info(f"{happening.cause}: {happening.text} ({where})")

    def _keep(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Handles the service request to write a bag of the time before and after the request."""
        if not isinstance(self._core, EventRecorder):
            response.message = f"everything is recorded already: {self._core.path.parent}"
            return response
        self._take()
        now_ns = self.get_clock().now().nanoseconds
        self._happen(self._core, Happening(Cause.REQUEST, now_ns, f"requested by {topics.KEEP}"))
        response.success = self._core.box.is_writing
        response.message = str(self._core.path) if response.success else self._core.box.failure
        return response

    def _place(self, topic: str, data: bytes) -> Place | None:
        entry = self._inputs.get(topic)
        if entry is None:
            return None
        return place_of(entry, data)

    def _look_for_settings(self, taken: Sequence[Received]) -> None:
        """Publishes diagnostics at once when another node's settings have arrived."""
        before = len(self._told)
        for received in taken:
            entry = self._inputs.get(received.topic)
            if entry is not None and entry.message_type is NodeSettings:
                message = deserialize_message(received.data, NodeSettings)
                self._told.add(message.node)
                self._stated |= stated_topics(message)
        if len(self._told) > before:
            self._report.report()

    def _health(self) -> Health:
        missed = self._lost_on_the_way()
        self._core.miss(missed)
        status = self._core.status()
        total, lost = sum(status.written.values()), sum(missed.values())
        silent = total == self._reported
        newly_lost = lost - self._reported_lost
        self._reported, self._reported_lost = total, lost
        left_out = self._unknown | status.refused
        absent, shared = self._absent(), self._look_for_shared()
        shortage = self._core.shortage if isinstance(self._core, EventRecorder) else ""
        level, sentence = findings(
            status, absent, newly_lost, left_out, silent, shared, self._other_types, shortage
        )
        for complaint in filter(None, (self._store.complaint, self._motions.complaint)):
            level = level if level == ERROR else WARN
            sentence = f"{sentence}; {complaint}"
        return level, sentence

    def _look_for_shared(self) -> list[str]:
        """Returns topics that may have only one publisher but carry messages of several."""
        shared = [
            topic
            for topic, entry in self._inputs.items()
            if entry.is_mixed() and self._choice.has_one_publisher(topic, entry.type_name)
        ]
        for topic in shared:
            nodes = self._inputs[topic].publisher_nodes()
            self._shared[topic] = max(nodes, self._shared.get(topic, []), key=_how_telling)
        if shared:
            self._core.note(SEVERAL, ",".join(sorted(self._shared)))
            self._core.note(PUBLISHERS, json.dumps(self._shared, sort_keys=True))
        return shared

    def _facts(self) -> dict[str, Any]:
        status = self._core.status()
        recorded = {}
        if self._choice.wants(self.resolve_topic_name(topics.SETTINGS)):
            recorded = {RECORDED: ", ".join(sorted(self._told))}
        return (
            recorded
            | {
                "file": status.path,
                "files": status.files,
                "topics": len(status.written),
                "messages": sum(status.written.values()),
                "bytes": status.size,
                "lost": status.lost,
                "lost during write failures": status.lost_meanwhile,
                "lost before recording": status.missed,
                "queue": status.waiting,
                "queue maximum": status.highest,
                "oldest unwritten message [s]": f"{status.age:.2f}",
                "free space [MB]": round(1e-6 * status.free),
                "written [MB/s]": f"{1e-6 * status.rate:.2f}",
                "topics without a publisher": ", ".join(self._absent()),
                "recorded [kB/s]": self._traffic.text(self._inputs, time.monotonic()),
                "left out": left_out_text(self._chosen),
            }
            | event_facts(self._core)
            | self._store.facts()
            | self._motions.facts()
        )

    def _absent(self) -> dict[str, float]:
        """Returns how long each recorded topic has had no publisher [s]."""
        now = time.monotonic()
        return {
            topic: now - entry.silent_since
            for topic, entry in self._inputs.items()
            if entry.silent_since is not None
        }

    def _lost_on_the_way(self) -> Counter[str]:
        """Returns the number of messages that were sent but not received, by topic."""
        return self._missed + Counter({topic: entry.lost for topic, entry in self._inputs.items()})


def _how_telling(nodes: list[str]) -> tuple[int, int]:
    """Sort key of publisher name lists: longer ones are greater, then those with known names."""
    return len(nodes), -sum(node.startswith(UNKNOWN) for node in nodes)


def _why(status: RecorderStatus) -> str:
    reasons = []
    if status.missed:
        reasons.append(
            f"{status.missed} did not reach the recorder: it was stopped, or the machine is too "
            "busy"
        )
    if status.unkept:
        reasons.append(status.failure or "the disk was too slow, or the bag was deleted")
    return "; ".join(reasons)


def stated_topics(settings: NodeSettings) -> set[str]:
    """Returns the topics that a node's recorded settings list, as the graph may omit some."""
    try:
        document = parse_yaml(settings.document, settings.node).value
    except YamlError:
        return set()
    found = document.get("topics") if isinstance(document, dict) else None
    return {str(name) for name in found.values()} if isinstance(found, dict) else set()


def used_topics(node: Node) -> set[str]:
    """Returns the topics that the cell's nodes publish or subscribe to.

    Args:
        node: one in the cell's namespace.
    """
    found: set[str] = set()
    for info in node.get_publishers_info_by_topic(topics.SETTINGS):
        for ask in (
            node.get_subscriber_names_and_types_by_node,
            node.get_publisher_names_and_types_by_node,
        ):
            try:
                known = ask(info.node_name, info.node_namespace)
            except _RCL_ERRORS:
                continue
            found.update(topic for topic, _ in known)
    return found


def main() -> int:
    """Runs the recorder node."""
    return run_node(RecorderNode)


if __name__ == "__main__":
    sys.exit(main())
