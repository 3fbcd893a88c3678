"""What the nodes of a recording worked with, from its `settings` topic."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagMessage, BagReader
from slosh_base.files.errors import YamlError
from slosh_base.files.nanoseconds import SECOND
from slosh_base.files.yaml_document import parse_yaml
from slosh_model.model import Model
from slosh_model.model_text import format_model, parse_model
from slosh_model.tray import TRAY, Tray, parse_tray

TOPIC = "settings"
MESSAGE_TYPE = "slosh_msgs/msg/NodeSettings"
T = TypeVar("T")


class NodeStart(NamedTuple):
    """A node started, started anew, or changed parameters while it goes on; see NodeSettings.msg.

    Attributes:
        node: its name.
        stamp_ns: the last input that it had used before [ns]; 0: none, its process was new.
        log_ns: when the recorder heard of it [ns].
        code, arithmetic: digests of its sources and of how its machine rounds.
        parameters: its parameters by name.
        files: texts of its files by parameter.
        topics: full names of those that it reads and publishes, by their names in this product;
            none in recordings of old.
        changed: names of the parameters that changed while the node goes on; none: it started.
    """

    node: str
    stamp_ns: int
    log_ns: int
    code: str
    arithmetic: str
    parameters: Mapping[str, Any]
    files: Mapping[str, str]
    topics: Mapping[str, str] = MappingProxyType({})
    changed: tuple[str, ...] = ()

    @property
    def is_process(self) -> bool:
        """Whether the node's process was new."""
        return not self.stamp_ns and not self.changed


def read_starts(reader: BagReader, topic: str) -> list[NodeStart]:
    """The starts of a cell's nodes, in the order of the recording.

    What cannot be read beside what can is a stranger's, who must not cost the recording.

    Raises:
        SloshBagError: none of them can be read.
    """
    source = f"{reader.path}: {topic}"
    starts, failure = [], None
    for block in reader.look_up([topic]):
        for index, log_ns in enumerate(block.log_ns.tolist()):
            message = BagMessage(topic, MESSAGE_TYPE, log_ns, log_ns, block.data(index))
            try:
                starts.append(node_start(reader.decode(message), log_ns, source))
            except SloshBagError as error:
                failure = failure or error
    if failure is not None and not starts:
        raise failure
    return starts


def first(starts: Sequence[NodeStart], node: str) -> NodeStart | None:
    """A node's first start; None: the recording does not tell."""
    return next((start for start in starts if start.node == node), None)


def heard(
    starts: Sequence[NodeStart], node: str, published_ns: NDArray[np.int64]
) -> tuple[NodeStart, ...]:
    """The starts without those of a node's processes that ended before they published anything.

    Args:
        starts: in the order of the recording.
        node: which.
        published_ns: (N,) when its messages were recorded, rising [ns].
    """
    own = [start.log_ns for start in starts if start.node == node and start.is_process]
    counts = np.diff(np.searchsorted(published_ns, own))
    idle = [(own[k], own[k + 1]) for k in np.flatnonzero(counts == 0).tolist()]
    return tuple(
        start
        for start in starts
        if start.node != node or not any(begin <= start.log_ns < end for begin, end in idle)
    )


def of_process(
    starts: Sequence[NodeStart], node: str, number: int, count: int
) -> tuple[NodeStart, ...]:
    """The starts without those of a node's other processes, where as many are known as there are.

    Args:
        starts: in the order of the recording.
        node: which.
        number: of its processes, from 1, in the order of their starts.
        count: how many of them ran side by side.
    """
    own = [place for place, start in enumerate(starts) if start.node == node]
    begun = [place for place in own if starts[place].is_process]
    if len(begun) != count:
        return tuple(starts)
    return tuple(
        start
        for place, start in enumerate(starts)
        if place not in own or place == begun[number - 1]
    )


def latest(starts: Sequence[NodeStart], node: str) -> NodeStart | None:
    """What a node last worked with; None: the recording does not tell."""
    return last_of_each(starts).get(node)


def last_of_each(starts: Iterable[NodeStart]) -> dict[str, NodeStart]:
    """What each node last worked with, by its name."""
    found: dict[str, NodeStart] = {}
    for start in starts:
        found[start.node] = after(found.get(start.node), start)
    return found


def after(known: NodeStart | None, news: NodeStart) -> NodeStart:
    """What a node works with after its news: a change of parameters is no other start."""
    if known is None or not news.changed:
        return news
    return known._replace(parameters=news.parameters)


def limits_over_time(
    starts: Sequence[NodeStart], node: str, meaning: Callable[[Mapping[str, Any]], T]
) -> tuple[T, list[tuple[int, T]]] | None:
    """What a node's parameters mean at its last start, and after each later change.

    Args:
        starts: in the order of the recording.
        node: which.
        meaning: that the node itself gives them.

    Returns:
        what holds at first; what holds for data with stamps after each of these [ns]. None: the
        recording does not tell.

    Raises:
        SloshBagError: a parameter is missing or cannot be.
    """
    own = [start for start in starts if start.node == node]
    if not own:
        return None
    begin = max((k for k, start in enumerate(own) if not start.changed), default=0)
    first_of_all, *later = own[begin:]
    changes = [(start.stamp_ns, settings_of(start, meaning)) for start in later]
    return settings_of(first_of_all, meaning), changes


def settings_of(start: NodeStart, meaning: Callable[[Mapping[str, Any]], T]) -> T:
    """What a recorded node's parameters mean.

    Args:
        start: of the node.
        meaning: that the node itself gives them.

    Raises:
        SloshBagError: one is missing or cannot be.
    """
    try:
        return meaning(start.parameters)
    except (KeyError, TypeError, ValueError) as error:
        raise SloshBagError(
            f"the recorded {start.node}'s settings cannot be read: {error}"
        ) from None


def model_of(start: NodeStart) -> Model:
    """The model that an estimator started with.

    Raises:
        SloshBagError: the recording does not hold it.
        SloshModelError: it is no model.
    """
    text = start.files.get("model")
    if text is None:
        raise SloshBagError("the recorded estimator's settings hold no model")
    return parse_model(text, "the recorded model")


def tray_of(start: NodeStart) -> Tray | None:
    """The tray that an estimator started with; None: it carried one container.

    Raises:
        SloshModelError: what is recorded is none.
    """
    text = start.files.get(TRAY)
    return parse_tray(text, "the recorded tray") if text else None


def starts_at_rest(start: NodeStart | None) -> bool:
    """Whether an estimator took the liquid for still when it started; those of old always did."""
    return start is None or bool(start.parameters.get("starts_at_rest", True))


def model_differences(recorded: Model, replayed: Model) -> list[str]:
    """How two models differ, one line each: where, and both values."""
    old = _flat(parse_yaml(format_model(recorded), "model").value)
    new = _flat(parse_yaml(format_model(replayed), "model").value)
    return [
        f"model: {key}: recorded {_shown(old, key)}, replayed {_shown(new, key, 'with ')}"
        for key in {**old, **new}
        if old.get(key) != new.get(key)
    ]


def _shown(values: Mapping[str, Any], key: str, preposition: str = "") -> str:
    if key not in values:
        return "without it"
    return "with it" if values[key] is True else f"{preposition}{values[key]!r}"


def _flat(document: Any, prefix: str = "") -> dict[str, Any]:
    """Values by dotted key; effects by their names."""
    if isinstance(document, list) and all(isinstance(item, dict) for item in document):
        document = {item.pop("name", index): item for index, item in enumerate(document)}
        document = {name: item or True for name, item in document.items()}
    if not isinstance(document, dict):
        return {prefix: document}
    flat: dict[str, Any] = {}
    for key, value in document.items():
        flat.update(_flat(value, f"{prefix}.{key}" if prefix else str(key)))
    return flat


def node_start(message: Any, log_ns: int, source: str) -> NodeStart:
    """What a NodeSettings message says.

    Args:
        message: as any middleware or reader decodes it.
        log_ns: when it was heard [ns].
        source: where it comes from, for the error.

    Raises:
        SloshBagError: its document cannot be read.
    """
    stamp = message.header.stamp
    try:
        document = parse_yaml(message.document, source).value
        parameters, files = dict(document["parameters"]), dict(document["files"])
        topics = dict(document.get("topics", {}))
        changed = tuple(map(str, document.get("changed", ())))
    except (YamlError, AttributeError, KeyError, TypeError, ValueError):
        raise SloshBagError(
            f"{source} of node {message.node!r}: its document is not "
            "YAML with parameters and files"
        ) from None
    return NodeStart(
        message.node, stamp.sec * SECOND + stamp.nanosec, log_ns, message.code,
        message.arithmetic, parameters, files, topics, changed,
    )  # fmt: skip
