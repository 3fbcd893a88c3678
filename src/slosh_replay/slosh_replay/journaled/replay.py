"""Runs the nodes of a recording again: their own code, given what they took, in its order."""

from __future__ import annotations

import tempfile
from collections import defaultdict, deque
from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from slosh_bag.reader import BagMessage, BagReader
from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.inputs import ROBOT
from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_estimator.nodes.monitor_node import MonitorNode
from slosh_estimator.nodes.sensor_node import PAYLOAD, SensorNode
from slosh_model.tray import TRAY
from slosh_msgs_py import topics
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.journal import BEGIN, START
from slosh_msgs_py.node.offline import Place, Taken, replayed
from slosh_replay.journaled.outputs import ComparedOutput, Recorded
from slosh_replay.journaled.taken import ProcessNotes, RecentMessages, begun_ns
from slosh_replay.recording.settings import NodeStart, read_starts
from slosh_replay.replay.verification import Tally, Verification


class Row(NamedTuple):
    """A node that can be replayed.

    Attributes:
        node: its class.
        arguments: of the class.
        compared: types of those of its messages that must come out again.
        files: parameters that are set to a file with a recorded text, by the text's name.
    """

    node: type[GuardedNode]
    arguments: Mapping[str, Any]
    compared: frozenset[str]
    files: Mapping[str, str] = MappingProxyType({})


_TYPES = {row.name: row.type for row in topics.TOPICS}


def types_of(*names: str) -> frozenset[str]:
    """Returns the types of a cell's topics, by their names."""
    return frozenset(_TYPES[name] for name in names)


ROWS: Final[Mapping[str, Row]] = {
    "estimator": Row(
        EstimatorNode,
        {"later": True},
        types_of(
            topics.ESTIMATE, topics.EXPECTED_READING, topics.TRAY_ESTIMATE, topics.FUSED_ESTIMATE,
            topics.CALM, topics.ESTIMATOR_STATE, topics.OBSERVER_STATE,
        ),
        {"model": "model", TRAY: "model", ROBOT: "urdf"},
    ),
    "monitor": Row(MonitorNode, {}, types_of(topics.COMPARISON, topics.LIMIT_EVENT)),
    "sensor": Row(SensorNode, {}, types_of(topics.FREE_SURFACE), {PAYLOAD: PAYLOAD}),
}  # fmt: skip
_UNTAKEN_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
"""No node with a journal takes these; they are large."""
LATE_NS: Final = 2 * SECOND
"""A message may be recorded so long after a journal that names it."""
KEPT: Final = 20_000
"""Recorded messages of a topic that no node is known to publish."""


class NodeReplay(NamedTuple):
    """What was replayed of one process of a node.

    Attributes:
        node: its name.
        taken: things that it was given.
        lacking: why it was not given all; empty: it was.
    """

    node: str
    taken: int
    lacking: str


class JournaledReplay(NamedTuple):
    """Result of the replay of all nodes of a recording by their journals.

    Attributes:
        processes: of nodes, in the order in which they began.
        verified: recorded messages against those of the replay, by the topic's name in the cell.
    """

    processes: tuple[NodeReplay, ...]
    verified: Mapping[str, Verification]


def replay_journals(
    bag: str | Path | BagReader, cell: str | None = None, rows: Mapping[str, Row] = ROWS
) -> JournaledReplay:
    """Replays each node of a recording by its journal, and compares what it publishes.

    Args:
        bag: its path, or a reader of it.
        cell: namespace of the topics; None: the first cell that has journals.
        rows: the nodes that can be replayed, by name.

    Raises:
        SloshBagError: no readable bag.
    """
    reader = bag if isinstance(bag, BagReader) else BagReader(bag)
    if cell is None:
        suffix = f"/{topics.JOURNAL}"
        named = (one.removesuffix(suffix) for one in reader.topics() if one.endswith(suffix))
        cell = next(named, topics.NAMESPACE)
    with tempfile.TemporaryDirectory(prefix="slosh_replay_") as folder:
        replay = _Replay(reader, f"/{cell.strip('/')}".rstrip("/"), rows, Path(folder))
        return replay.run()


class _Replay:
    """A running replay: reads the recording once, and gives the nodes what they took."""

    def __init__(
        self, reader: BagReader, cell: str, rows: Mapping[str, Row], folder: Path
    ) -> None:
        self._reader, self._cell, self._rows, self._folder = reader, cell, rows, folder
        self._journal = f"{cell}/{topics.JOURNAL}"
        self._types = {name: info.message_type for name, info in reader.topics().items()}
        self._compared = frozenset[str]().union(*(row.compared for row in rows.values()))
        self._starts = read_starts(reader, f"{cell}/{topics.SETTINGS}")
        self._messages = RecentMessages()
        self._recorded: dict[str, list[Recorded]] = defaultdict(list)
        self._waiting: deque[BagMessage] = deque()
        self._running: dict[str, _Process] = {}
        self._processes: list[_Process] = []
        self._tallies: dict[str, Tally] = {}

    def run(self) -> JournaledReplay:
        """Reads the recording and returns the result."""
        heard = [one for one, kind in self._types.items() if kind not in _UNTAKEN_TYPES]
        for message in self._reader.messages(heard) if self._journal in self._types else ():
            if message.topic == self._journal:
                self._waiting.append(message)
            else:
                self._messages.add(message)
                if message.message_type in self._compared:
                    self._keep(message)
            while self._waiting and message.log_ns - self._waiting[0].log_ns > LATE_NS:
                self._use(self._waiting.popleft())
        while self._waiting:
            self._use(self._waiting.popleft())
        for process in self._running.values():
            process.finish(2**63 - 1)
        processes = [
            NodeReplay(one.node, one.notes.taken, one.notes.lacking) for one in self._processes
        ]
        found = {
            topic.removeprefix(f"{self._cell}/"): tally.result()
            for topic, tally in self._tallies.items()
        }
        verified = {name: one for name, one in found.items() if one.total or one.unchecked}
        return JournaledReplay(tuple(processes), verified)

    def _keep(self, message: BagMessage) -> None:
        """Keeps what a node may have published; of what none does, the last."""
        kept = self._recorded[message.topic]
        kept.append(Recorded(message.publish_ns, message.data))
        if len(kept) > KEPT and message.topic not in self._tallies:
            del kept[: KEPT // 2]

    def _use(self, message: BagMessage) -> None:
        """Gives a node what the next of its journals names."""
        journal = self._reader.decode(message)
        process = self._running.get(journal.node)
        if journal.first == 0 or process is None:
            if process is not None:
                process.finish(begun_ns(journal))
            process = self._begin(journal, message.log_ns)
        if process is not None:
            process.add(journal, message.publish_ns)

    def _begin(self, journal: Any, log_ns: int) -> _Process | None:
        """Creates a node for its process that begins with a journal; None: it has no row."""
        before = [one.notes.log_ns for one in self._processes if one.node == journal.node]
        row = self._rows.get(journal.node)
        start = next(
            (one for one in self._starts if one.node == journal.node and one.is_process
             and one.log_ns > max(before, default=-(2**63))),
            None,
        )  # fmt: skip
        if row is None or start is None:
            return None
        lacking = "the beginning of its journal" if journal.first else ""
        notes = ProcessNotes(journal.node, log_ns, begun_ns(journal), lacking)
        output = partial(self._output, row.compared)
        process = _Process(notes, self._messages, output, self._recorded)
        folder = self._folder / str(len(self._processes))
        parameters = {**start.parameters, **_files(folder, start, row)}
        place = Place(
            self._cell, parameters, start.topics, simulated=False, give=process.give,
            publishes=process.publishes,
        )  # fmt: skip
        process.create(row, place)
        self._running[journal.node] = process
        self._processes.append(process)
        return process

    def _output(self, compared: Collection[str], topic: str) -> ComparedOutput | None:
        """Creates what compares a topic; None: it was not recorded, or is not compared."""
        kind = self._types.get(topic)
        if kind is None or kind not in compared:
            return None
        tally = self._tallies.setdefault(topic, Tally(topic))
        return ComparedOutput(self._reader, topic, kind, tally)


class _Process:
    """One process of a node in a replay."""

    def __init__(
        self, notes: ProcessNotes, messages: RecentMessages,
        output: Callable[[str], ComparedOutput | None], recorded: Mapping[str, list[Recorded]],
    ) -> None:  # fmt: skip
        self.notes, self.node = notes, notes.node
        self._messages, self._output, self._recorded = messages, output, recorded
        self._outputs: dict[str, ComparedOutput | None] = {}
        self._node: Any = None

    def create(self, row: Row, place: Place) -> None:
        """Creates the node, without a graph; what its settings tell may be a stranger's."""
        self._try(lambda: replayed(row.node, place, **row.arguments))

    def publishes(self, topic: str) -> None:
        """Is told each topic that the node publishes."""
        self._outputs[topic] = self._output(topic)

    def give(self, topic: str, serialise: Callable[[], bytes]) -> None:
        """Takes what the node publishes."""
        output = self._outputs[topic]
        if output is not None:
            output.give(serialise())

    def add(self, journal: Any, sent_ns: int) -> None:
        """Gives the node what a journal names; compares what was recorded of it until then."""
        for taken in self.notes.add(journal, sent_ns, self._messages):
            self._take(taken)
            if self.notes.lacking:
                break
        self._compare()

    def finish(self, end_ns: int) -> None:
        """Compares the rest; the next process of the node began at this time [ns]."""
        for taken in () if self.notes.lacking else self.notes.rest():
            self._take(taken)
        self._compare()
        for topic, output in self._outputs.items():
            if output is not None:
                output.finish(len(self._due(topic, end_ns - 1)))

    def _try(self, create: Callable[[], Any]) -> None:
        try:
            self._node = create()
        except (ValueError, TypeError, LookupError, OSError) as error:
            self.notes.lacking = f"usable settings: {error}"

    def _take(self, taken: Taken) -> None:
        node = self._node
        if taken.source in (START, BEGIN):
            node.journal.begin(taken)
            if taken.source == BEGIN:
                self._try(lambda: _prepared(node))
        else:
            node.use(taken)

    def _compare(self) -> None:
        for topic, output in self._outputs.items():
            if output is not None:
                output.compare(self._due(topic, self.notes.until_ns))

    def _due(self, topic: str, until_ns: int) -> list[Recorded]:
        """Removes and returns recorded messages of the process that were sent until a time."""
        waiting = self._recorded[topic]
        found = [one for one in waiting if self.notes.begun_ns <= one.sent_ns <= until_ns]
        if found:
            waiting[:] = [one for one in waiting if one.sent_ns > until_ns]
        return found


def _prepared(node: Any) -> Any:
    """Lets a node begin its work, as `run_node` does."""
    node.prepare(lambda _: None)
    node.is_prepared()
    return node


def _files(folder: Path, start: NodeStart, row: Row) -> dict[str, str]:
    """Writes recorded texts to files; returns the parameters that name them."""
    found = {}
    folder.mkdir()
    for text, parameter in row.files.items():
        if text in start.files:
            path = folder / f"{text}.yaml"
            path.write_text(start.files[text], "utf-8")
            found[parameter] = str(path)
    return found
