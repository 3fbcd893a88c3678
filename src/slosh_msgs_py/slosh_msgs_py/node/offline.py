"""A node without ROS graph: the same node's code, given from a recording what it took then."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from inspect import signature
from types import SimpleNamespace
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message

from slosh_msgs_py import journal_format
from slosh_msgs_py.node.guarded import GuardedNode

Given = Callable[[str, Callable[[], bytes]], None]
"""Takes a topic's full name and what serialises the message, to be called at once if at all."""


class Taken(NamedTuple):
    """Something that a node took.

    Attributes:
        source: where it comes from; see `Journal.msg`.
        content: a message's serialised bytes, or what the journal holds; None: a message that the
            recording lacks.
        now_ns, steady_ns: when, by the node's clock and by the steady one [ns].
        answers: of the graph while it was used, by question, in order.
    """

    source: str
    content: bytes | None
    now_ns: int
    steady_ns: int
    answers: tuple[tuple[str, Any], ...] = ()


class Place(NamedTuple):
    """What surrounds a node without a graph.

    Attributes:
        namespace: of the cell, with a slash in front.
        parameters: values by name at the node's start.
        topics: full names by those that the node's code has, where they were remapped.
        give: receives what the node publishes.
        publishes: is told the full name of each topic on which it does.
    """

    namespace: str
    parameters: Mapping[str, Any]
    topics: Mapping[str, str]
    give: Given
    publishes: Callable[[str], None]


class OfflineJournal:
    """The times of what a node takes, as its journal has them; what the graph answered then.

    Attributes:
        now_ns, steady_ns: see `Journal`.
    """

    def __init__(self) -> None:
        self.now_ns = self.steady_ns = 0
        self._answers: dict[str, Any] = {}
        self._new: list[tuple[str, Any]] = []

    def begin(self, taken: Taken) -> None:
        """Sets time and answers to those of something that is about to be used."""
        self.now_ns, self.steady_ns = taken.now_ns, taken.steady_ns
        self._answers.update(self._new)
        self._new = list(taken.answers)

    def noted(self, question: str, _: Any) -> Any:
        """Returns the noted answer to a question: the next new one, or that of before.

        What was asked before the recording began has the answer of an empty graph.
        """
        for index, (asked, answer) in enumerate(self._new):
            if asked == question:
                del self._new[index]
                self._answers[question] = answer
                break
        known = self._answers.get(question)
        return ([] if question.startswith("info ") else 0) if known is None else known

    def source(self, name: str) -> str:
        """Returns the name of a source."""
        return name

    def flush(self) -> None:
        """Does nothing: a replay has no journal of its own."""

    def take(self, source: str, content: bytes = b"") -> None:
        """Does nothing: what is used was noted when it was recorded."""

    take_message = take_values = take


class OfflineNode(Node):
    """Takes the place of rclpy's node below a GuardedNode.

    `class Replayed(EstimatorNode, OfflineNode)` is the estimator's own code without a graph: what
    GuardedNode asks of the class behind it is answered here.
    """

    place: Place
    """Is set by the class that is created for one replay."""

    def __init__(self, name: str, **_: Any) -> None:
        self._offline_name = name
        self._offline_values: dict[str, Parameter] = {}
        self._offline_takers: dict[str, Callable[[bytes], None]] = {}
        self._parameter_overrides = {
            key: Parameter(key, value=value) for key, value in self.place.parameters.items()
        }

    def count_publishers(self, topic_name: str) -> int:
        """Is never asked: the journal has the answer."""
        return 0

    def get_publishers_info_by_topic(self, topic_name: str, **_: Any) -> list[Any]:
        """Is never asked: the journal has the answer."""
        return []

    def use(self, taken: Taken) -> bool:
        """Gives the node what it took; returns False if it has nothing that takes it."""
        notes: Any = self.journal
        notes.begin(taken)
        taker = self._offline_takers.get(taken.source)
        if taker is None or taken.content is None:
            return False
        taker(taken.content)
        return True

    def destroy_node(self) -> None:
        """Does nothing: there is no node."""

    def get_name(self) -> str:
        """Returns the node's name."""
        return self._offline_name

    def get_namespace(self) -> str:
        """Returns the cell's namespace."""
        return self.place.namespace or "/"

    def get_fully_qualified_name(self) -> str:
        """Returns the node's name behind the cell's namespace."""
        return f"{self.place.namespace.rstrip('/')}/{self._offline_name}"

    def resolve_topic_name(self, topic: str, **_: Any) -> str:
        """Returns a topic's full name, as it was remapped."""
        known = self.place.topics.get(topic)
        return known or (
            topic if topic.startswith("/") else f"{self.place.namespace.rstrip('/')}/{topic}"
        )

    def get_clock(self) -> Any:
        """Returns the clock of what is being used."""
        notes: Any = getattr(self, "journal", None)
        now_ns = 0 if notes is None else notes.now_ns
        return SimpleNamespace(
            now=lambda: SimpleNamespace(nanoseconds=now_ns, to_msg=lambda: _stamp(now_ns)),
            ros_time_is_active=False,
            handle=SimpleNamespace(get_ros_time_override_is_enabled=lambda: False),
        )

    def declare_parameter(self, name: str, value: Any = None, *_: Any, **__: Any) -> Parameter:
        """Declares a parameter with its recorded value, or its default."""
        given = self._parameter_overrides.get(name)
        self._offline_values[name] = given or Parameter(name, value=value)
        return self._offline_values[name]

    def has_parameter(self, name: str) -> bool:
        """Returns whether a parameter is declared."""
        return name in self._offline_values

    def get_parameter(self, name: str) -> Parameter:
        """Returns a declared parameter."""
        return self._offline_values[name]

    def add_pre_set_parameters_callback(self, callback: Any) -> None:
        """Does nothing: what was refused was not noted."""

    add_on_set_parameters_callback = add_pre_set_parameters_callback

    def add_post_set_parameters_callback(self, callback: Any) -> None:
        """Keeps the function that applies changed parameters."""

        def change(content: bytes) -> None:
            changed = [Parameter(k, value=v) for k, v in json.loads(content).items()]
            self._offline_values.update({one.name: one for one in changed})
            callback(changed)

        self._offline_takers[journal_format.PARAMETERS] = change

    def create_publisher(self, kind: Any, topic: str, *_: Any, **__: Any) -> Any:
        """Creates a publisher that hands its messages over."""
        name, give = self.resolve_topic_name(topic), self.place.give
        self.place.publishes(name)
        return SimpleNamespace(
            publish=lambda message: give(name, lambda: bytes(serialize_message(message))),
            get_subscription_count=lambda: 1,
        )

    def create_subscription(
        self, kind: Any, topic: str, callback: Callable[..., None], *_: Any, **__: Any
    ) -> Any:
        """Creates a subscription to recorded messages, which come as bytes."""
        source: str = getattr(callback, "source")  # noqa: B009 - a function's attribute
        info = {"publication_sequence_number": None, "received_timestamp": 0}
        informed = len(signature(callback).parameters) == 2
        self._offline_takers[source] = (
            (lambda data: callback(data, info)) if informed else callback
        )
        return SimpleNamespace(get_publisher_count=lambda: 1)

    def create_timer(self, period: float, callback: Callable[[], None], *_: Any, **__: Any) -> Any:
        """Creates a timer that ticks when the recorded one did."""
        source: str = getattr(callback, "source")  # noqa: B009 - a function's attribute
        self._offline_takers[source] = lambda content: callback()
        return SimpleNamespace(reset=lambda: None)

    def create_service(self, kind: Any, name: str, callback: Any, *_: Any, **__: Any) -> Any:
        """Creates a service that is given recorded requests."""

        def serve(content: bytes) -> None:
            callback(deserialize_message(content, kind.Request), kind.Response())

        self._offline_takers[f"{journal_format.SERVICE}{name}"] = serve
        return SimpleNamespace()


def replayed(node_class: type[GuardedNode], place: Place, **arguments: Any) -> Any:
    """Creates a node of a class without a graph; its methods `use` and `is_prepared` drive it."""
    created = type(
        f"Replayed{node_class.__name__}",
        (node_class, OfflineNode),
        {
            "place": place,
            "_new_journal": lambda self: OfflineJournal(),
            "get_logger": lambda self: _SILENT,
            "waits": _refuse,
            "create_action_server": lambda self, *_, **__: SimpleNamespace(destroy=lambda: None),
        },
    )
    return created(**arguments)


def deserialised(data: bytes, kind: Any) -> Any:
    """Returns the message of a class that serialised bytes hold."""
    return deserialize_message(data, kind)


def _refuse(_: Any, what: str) -> None:
    """Raises the reason for which a live node would wait: here nothing comes.

    Raises:
        ValueError: always.
    """
    raise ValueError(what)


_SILENT = SimpleNamespace(
    debug=lambda _: True, info=lambda _: True, warning=lambda _: True, error=lambda _: True
)
"""A logger: what a node says was said when it was recorded."""


def _stamp(now_ns: int) -> Any:
    from slosh_msgs_py.stamps import to_time

    return to_time(now_ns)
