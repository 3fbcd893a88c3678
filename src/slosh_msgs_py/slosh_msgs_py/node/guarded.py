"""Node base class that keeps running after exceptions in callbacks.

Whatever others send, a node must not fall by it. What is known to be wrong is refused where it is
read, with its reason; here is the last catch, for what nobody thought of: the message is lost, the
node counts it, tells it and goes on.
"""

from __future__ import annotations

import functools
import os
import time
import traceback
from collections import Counter
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.action import ActionServer
from rclpy.clock import Clock, ClockType
from rclpy.impl.rcutils_logger import RcutilsLogger, _internal_callers
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message

from slosh_base.files.plain_text import plain_line
from slosh_msgs_py import journal_format
from slosh_msgs_py.node.journal import PERIOD, Journal
from slosh_msgs_py.node.mismatches import Mismatches
from slosh_msgs_py.node.speakers import WithInfo

Callback = Callable[..., Any]


class Faults:
    """Counts and reports exceptions raised in callbacks.

    Args:
        tell: is given a line the first time, the tenth, the hundredth, and so on.
    """

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._counts: Counter[str] = Counter()
        self._last = ""
        self._reported = 0

    @property
    def total(self) -> int:
        """Number of exceptions so far."""
        return self._counts.total()

    def add(self, where: str, error: Exception) -> str:
        """Counts an exception and returns it as a line of text.

        Args:
            where: the topic or service.
            error: what was raised.
        """
        place = traceback.extract_tb(error.__traceback__)[-1]
        file = place.filename.rpartition("/")[2]
        what = f"{type(error).__name__} in {file}:{place.lineno}"
        self._last = f"{where}: a message could not be handled: {what}"
        self._counts[self._last] += 1
        count = self._counts[self._last]
        if str(count).strip("0") == "1":
            # The error's own words may quote what a stranger sent; they stay in this log.
            self._tell(f"{self._last}: {str(error)[:200]} ({count} so far); the node continues")
        return self._last

    def news(self) -> str:
        """Returns the exceptions since the last call in one line; empty if there are none."""
        new, self._reported = self.total - self._reported, self.total
        return f"{self._last} ({new} since the last report)" if new else ""


class GuardedNode(Node):
    """A node that keeps running when a callback raises an exception.

    Args:
        name: of the node.
        journaled: whether it publishes all that it takes, in order, for a replay.

    Attributes:
        faults: what they stumbled over.
        mismatches: who is not heard, or does not hear, for another QoS.
        journal: of what it takes; None: it has none.
    """

    _plain_logger: PlainLogger | None = None
    _timers_noted = 0

    def __init__(self, name: str, *, journaled: bool = False, **options: Any) -> None:
        # Before the node, which makes services of its own.
        self.faults = Faults(lambda line: self.get_logger().error(line))
        self.mismatches = Mismatches(self)
        self.journal: Journal | None = None
        self._topics_noted: Counter[str] = Counter()
        super().__init__(name, **options)
        if journaled:
            self.journal = self._new_journal()

    def _new_journal(self) -> Journal:
        """Creates the journal and publishes it, twice a second and when the node ends."""
        new = Journal(self)
        new.publish()
        new.take(new.source(journal_format.START))
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        super().create_timer(PERIOD, new.flush, clock=steady)
        self.context.on_shutdown(new.abandon)
        return new

    def destroy_node(self) -> None:
        """Publishes the rest of the journal and ends the node."""
        if self.journal is not None:
            self.journal.close()
            self.journal = None
        super().destroy_node()

    def now_ns(self) -> int:
        """Returns when the thing that is being used was taken, by the node's clock [ns]."""
        if self.journal is None:
            return int(self.get_clock().now().nanoseconds)
        return self.journal.now_ns

    def steady_ns(self) -> int:
        """Returns when the thing that is being used was taken, by the steady clock [ns]."""
        return time.monotonic_ns() if self.journal is None else self.journal.steady_ns

    def count_publishers(self, topic_name: str) -> int:
        """Returns how many publishers a topic has."""
        ask = partial(super().count_publishers, topic_name)
        return int(self.noted(f"count {self.resolve_topic_name(topic_name)}", ask))

    def noted(self, question: str, ask: Callable[[], Any]) -> Any:
        """Returns the answer to a question that no message answers; notes it where it changes.

        Args:
            question: its name in the journal.
            ask: finds the answer, which JSON can hold.
        """
        return ask() if self.journal is None else self.journal.noted(question, ask)

    @property
    def is_simulated(self) -> bool:
        """Whether the node's time is a simulated one."""
        return bool(self.noted("simulated", lambda: self.get_clock().ros_time_is_active))

    def get_publishers_info_by_topic(self, topic_name: str, **options: Any) -> list[Any]:
        """Returns what is known of each publisher of a topic."""
        ask = partial(super().get_publishers_info_by_topic, topic_name, **options)
        found: list[Any] = []

        def known() -> list[list[str]]:
            found.extend(ask())
            return [
                [one.node_name, one.node_namespace, one.topic_type, bytes(one.endpoint_gid).hex()]
                for one in found
            ]

        noted = self.noted(f"info {self.resolve_topic_name(topic_name)}", known)
        return found or [_endpoint(*one) for one in noted]

    def get_logger(self) -> PlainLogger:
        """Returns the node's logger, which prints each message as one line."""
        if self._plain_logger is None:
            self._plain_logger = PlainLogger(super().get_logger().name)
        return self._plain_logger

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callback,
        qos_profile: QoSProfile | int,
        **options: Any,
    ) -> Any:
        """Creates a subscription that survives callback exceptions and detects QoS mismatches."""
        if self.journal is not None:
            callback = self._noted(self.journal, callback, topic, msg_type, **options)
            options["raw"] = True
        guarded = self._guarded(callback, topic)
        if isinstance(qos_profile, QoSProfile):
            watch = self.mismatches.of_subscription(topic, qos_profile)
            options.setdefault("event_callbacks", watch)
        return super().create_subscription(msg_type, topic, guarded, qos_profile, **options)

    def create_publisher(
        self, msg_type: Any, topic: str, qos_profile: QoSProfile | int, **options: Any
    ) -> Any:
        """Creates a publisher that detects QoS mismatches."""
        if isinstance(qos_profile, QoSProfile):
            watch = self.mismatches.of_publisher(topic, qos_profile)
            options.setdefault("event_callbacks", watch)
        return super().create_publisher(msg_type, topic, qos_profile, **options)

    def create_timer(
        self, timer_period_sec: float, callback: Callback, *arguments: Any, **options: Any
    ) -> Any:
        """Creates a timer that survives exceptions in its callback."""
        if self.journal is not None:
            callback = self._noted_tick(self.journal, callback)
        guarded = self._guarded(callback, "timer")
        return super().create_timer(timer_period_sec, guarded, *arguments, **options)

    def create_action_server(
        self, action_type: Any, name: str, *arguments: Any, **options: Any
    ) -> Any:
        """Creates an action server."""
        return ActionServer(self, action_type, name, *arguments, **options)

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callback, *arguments: Any, **options: Any
    ) -> Any:
        """Creates a service that reports exceptions in its callback to the client."""

        @functools.wraps(callback)
        def guarded(request: Any, response: Any) -> Any:
            try:
                if self.journal is not None:
                    place = self.journal.source(f"{journal_format.SERVICE}{srv_name}")
                    self.journal.take(place, serialize_message(request))
                return callback(request, response)
            except Exception as error:
                said = self.faults.add(srv_name, error)
                if hasattr(response, "success"):
                    response.success, response.message = False, said
                return response

        return super().create_service(srv_type, srv_name, guarded, *arguments, **options)

    def set_parameters(self, parameter_list: list[Parameter]) -> list[SetParametersResult]:
        """Sets parameters; explains what to do about those that can be set only at the start."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Sets all parameters or none; explains parameters that can be set only at the start."""
        fixed = [
            parameter.name
            for parameter in parameter_list
            if self.has_parameter(parameter.name)
            and self.describe_parameter(parameter.name).read_only
        ]
        if fixed:
            name = fixed[0]
            return SetParametersResult(
                successful=False,
                reason=f"{name} is read at the start only: restart the node with -p {name}:=VALUE",
            )
        return super().set_parameters_atomically(parameter_list)

    def _noted(
        self, notes: Journal, callback: Callback, topic: str, kind: Any, raw: bool = False,
        **_: Any,
    ) -> Callback:  # fmt: skip
        """Wraps a callback of messages so that each is noted, by its bytes, before it is used."""
        name = self.resolve_topic_name(topic)
        self._topics_noted[name] += 1
        again = f" {self._topics_noted[name]}" if self._topics_noted[name] > 1 else ""
        source = f"{journal_format.MESSAGE}{name}{again}"
        place = notes.source(source)

        def noted(data: bytes, *info: Any) -> None:
            notes.take_message(place, data)
            callback(data if raw else deserialize_message(data, kind), *info)

        def noted_with_info(data: bytes, info: Any) -> None:
            noted(data, info)

        informed = isinstance(callback, WithInfo)
        return _from(source, WithInfo(noted_with_info) if informed else lambda data: noted(data))

    def _noted_tick(self, notes: Journal, callback: Callback) -> Callback:
        source = f"{journal_format.TIMER}{self._timers_noted}"
        place = notes.source(source)
        self._timers_noted += 1

        def noted() -> None:
            notes.take(place)
            callback()

        return _from(source, noted)

    def _guarded(self, callback: Callback, where: str) -> Callback:
        @functools.wraps(callback)
        def guarded(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except Exception as error:
                self.faults.add(where, error)

        return guarded


def _endpoint(node: str, namespace: str, kind: str, identity: str) -> Any:
    """Returns what a journal holds of a publisher, in the form that rclpy has."""
    return SimpleNamespace(
        node_name=node, node_namespace=namespace, topic_type=kind,
        endpoint_gid=bytes.fromhex(identity),
    )  # fmt: skip


def _from(source: str, callback: Callback) -> Callback:
    """Marks a callback with the source under which what it takes is noted."""
    callback.source = source  # type: ignore[attr-defined]
    return callback


class PlainLogger(RcutilsLogger):
    """A logger that prints every message as one line without control characters.

    rclpy raises an error where one place in the sources logs with another severity or other
    options (`once`, `throttle_duration_sec`) than before. Here each combination has a logger.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._each: dict[tuple[object, ...], RcutilsLogger] = {}

    def log(self, message: str, severity: int, **options: Any) -> bool:
        """Logs a message; returns whether no option held it back."""
        kind = (severity, *sorted(options.items()))
        logger = self._each.setdefault(kind, RcutilsLogger(self.name))
        return bool(logger.log(plain_line(message), severity, **options))


# The place of a message is where it was logged, not here: options such as `once` count places.
_internal_callers.append(os.path.realpath(__file__))
