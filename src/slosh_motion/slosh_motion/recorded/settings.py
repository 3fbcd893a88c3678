"""Reads what the nodes of a recording told: their settings, and what they took by journals."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.reader import BagMessage, BagReader
from slosh_base.files.errors import YamlError
from slosh_base.files.nanoseconds import SECOND
from slosh_base.files.yaml_document import parse_yaml
from slosh_base.types import Integers
from slosh_model.model import Model
from slosh_model.model_text import format_model, parse_model
from slosh_model.tray import TRAY, Tray, parse_tray
from slosh_msgs_py.journal_format import begun_ns, checksum, entries

TOPIC = "settings"
MESSAGE_TYPE = "slosh_msgs/msg/NodeSettings"
T = TypeVar("T")


class NodeStart(NamedTuple):
    """A start, restart or parameter change of a node; see NodeSettings.msg.

    Attributes:
        stamp_ns: the last input that it had used before [ns]; 0: none, its process was new.
        log_ns: when the recorder heard of it [ns].
        code, arithmetic: digests of its sources and of how its machine rounds.
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
        """Whether this is the start of a new process of the node."""
        return not self.stamp_ns and not self.changed


def read_starts(reader: BagReader, topic: str) -> list[NodeStart]:
    """Reads the settings messages of a cell's nodes in recorded order.

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
    """Returns the first settings of a node, or None if none were recorded."""
    return next((start for start in starts if start.node == node), None)


def heard(
    starts: Sequence[NodeStart], node: str, published_ns: NDArray[np.int64]
) -> tuple[NodeStart, ...]:
    """Removes the starts of a node after which it published nothing until the next.

    Such a process had ended, or has told its settings anew before its first message.

    Args:
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


def latest(starts: Sequence[NodeStart], node: str) -> NodeStart | None:
    """Returns the last settings of a node, or None if none were recorded."""
    return last_of_each(starts).get(node)


def last_of_each(starts: Iterable[NodeStart]) -> dict[str, NodeStart]:
    """Returns the last recorded settings of each node, by node name."""
    found: dict[str, NodeStart] = {}
    for start in starts:
        found[start.node] = after(found.get(start.node), start)
    return found


def after(known: NodeStart | None, news: NodeStart) -> NodeStart:
    """Merges a node's settings with its later message; a parameter change is not a new start."""
    if known is None or not news.changed:
        return news
    return known._replace(parameters=news.parameters)


def limits_over_time(
    starts: Sequence[NodeStart], node: str, meaning: Callable[[Mapping[str, Any]], T]
) -> tuple[T, list[tuple[int, T]]] | None:
    """Converts a node's parameters at its last start and each change; None if not recorded.

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
    """Converts the recorded parameters of a node by a given function.

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
    """Returns the model with which an estimator started.

    Raises:
        SloshBagError: the recording does not hold it.
        SloshModelError: it is no model.
    """
    text = start.files.get("model")
    if text is None:
        raise SloshBagError("the recorded estimator's settings hold no model")
    return parse_model(text, "the recorded model")


def tray_of(start: NodeStart) -> Tray | None:
    """Returns the tray that an estimator carried at its start, or None for one container.

    Raises:
        SloshModelError: what is recorded is none.
    """
    text = start.files.get(TRAY)
    return parse_tray(text, "the recorded tray") if text else None


def starts_at_rest(start: NodeStart | None) -> bool:
    """Returns whether an estimator assumed that the liquid was at rest at its start."""
    return start is None or bool(start.parameters.get("starts_at_rest", True))


def model_differences(recorded: Model, replayed: Model) -> list[str]:
    """Lists the differences between two models, one line each with both values."""
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
    """Flattens a nested document to values by dotted keys; effects are keyed by name."""
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
    """Parses a NodeSettings message.

    Args:
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


UNKNOWN, NOT_TAKEN = -1, -2
"""In place of a time: no journal covers the message; one does, and does not name it."""
LATE_NS: Final = 2 * SECOND
"""A message may be noted so long after it was recorded, ..."""
_MOST_UNSEEN: Final = 20_000
KEPT_NS: Final = 30 * SECOND
"""... and be recorded so long after it was noted."""


class Arrivals(NamedTuple):
    """When messages were taken.

    Attributes:
        times: (N,) UNKNOWN, NOT_TAKEN or the time [ns].
        lacking: rows before which messages lack that the estimator took.
    """

    times: Integers
    lacking: list[int]


class TakenInputs:
    """What an estimator took of its inputs, as far as its journals go.

    Args:
        node: whose journals count.

    Attributes:
        begun_ns: when it took the first message [ns]; far ahead: it has taken none so far.
    """

    def __init__(self, reader: BagReader, journal: str, node: str = "estimator") -> None:
        self._reader, self._node = reader, node
        self._journals: Iterator[BagMessage] = reader.messages([journal])
        self._next: BagMessage | None = next(self._journals, None)
        self._times: dict[tuple[str, int], int] = {}
        self._unseen: dict[str, deque[int]] = {}
        self._count = 0
        self._until_ns = -(2**62)  # the journals are complete up to here
        self._holes: deque[tuple[int, int]] = deque()
        self.begun_ns = 2**62

    def arrivals(self, block: MessageBlock) -> Arrivals:
        """Returns when the messages of a block were taken, and before which of them some lack."""
        self._read(int(block.log_ns[-1]) + LATE_NS)
        checks = [checksum(block.data(row)) for row in range(len(block))]
        rows = zip(checks, block.log_ns.tolist(), strict=True)
        times = [self._arrival(block.topic, check, log_ns) for check, log_ns in rows]
        return Arrivals(np.array(times, np.int64), self._lacking(block.topic, checks))

    def _lacking(self, topic: str, checks: list[int]) -> list[int]:
        """Returns the rows before which messages lack that the estimator took."""
        found, here = [], set(checks)
        waiting = self._unseen.setdefault(topic, deque())
        for row, check in enumerate(checks):
            if (topic, check) not in self._times or check not in waiting:
                continue
            before = list(iter(waiting.popleft, check))
            if not here.issuperset(before):
                found.append(row)
        return found

    def _arrival(self, topic: str, check: int, log_ns: int) -> int:
        found = self._times.get((topic, check))
        if found is not None:
            return found
        unknown = log_ns > self._until_ns or any(a <= log_ns <= b for a, b in self._holes)
        return UNKNOWN if unknown else NOT_TAKEN

    def _read(self, until_ns: int) -> None:
        """Reads the journals that were recorded up to a time [ns]."""
        while self._next is not None and self._next.log_ns <= until_ns:
            self._add(self._next)
            self._next = next(self._journals, None)
        while self._times and next(iter(self._times.values())) < until_ns - KEPT_NS:
            del self._times[next(iter(self._times))]
        while self._holes and self._holes[0][1] < until_ns - KEPT_NS:
            self._holes.popleft()

    def _add(self, message: BagMessage) -> None:
        journal = self._reader.decode(message)
        if journal.node != self._node:
            return
        if journal.first not in (0, self._count):  # what lies between is unknown
            self._holes.append((self._until_ns, begun_ns(journal) + LATE_NS))
        self._count = journal.first + len(journal.source)
        for entry in entries(journal):
            if entry.topic:
                self._times.pop((entry.topic, entry.check), None)
                self._times[entry.topic, entry.check] = entry.now_ns
                unseen = self._unseen.setdefault(entry.topic, deque(maxlen=_MOST_UNSEEN))
                unseen.append(entry.check)
                self._until_ns = max(self._until_ns, entry.now_ns)
                self.begun_ns = min(self.begun_ns, entry.now_ns)
