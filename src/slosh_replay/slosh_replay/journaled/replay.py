"""Runs the nodes of a recording again: their own code, given what they took, in its order."""

from __future__ import annotations

import importlib
import tempfile
from collections import defaultdict, deque
from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagMessage, BagReader
from slosh_base.addons import add_ons
from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.held_container import EMPTY
from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_estimator.nodes.monitor_node import MonitorNode
from slosh_estimator.nodes.sensor_node import PAYLOAD, SensorNode
from slosh_model.tray import TRAY
from slosh_motion.inputs.inputs import CHAINED_SINCE, PLACED, ROBOT
from slosh_motion.recorded.settings import NodeStart, last_of_each, read_starts
from slosh_msgs.msg import Calm, EstimatorState, ObserverState
from slosh_msgs_py import topics
from slosh_msgs_py.journal_format import begun_ns
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.offline import Place
from slosh_replay.journaled.outputs import UNTAKEN, ComparedOutput, Recorded
from slosh_replay.journaled.process import LONG_AGO, Process, State
from slosh_replay.journaled.taken import LATCHED, ProcessNotes, RecentMessages
from slosh_replay.replay.verification import Tally, Verification


class Row(NamedTuple):
    """A node that can be replayed.

    Attributes:
        node: its class.
        arguments: of the class.
        compared: types of those of its messages that must come out again.
        files: parameters that are set to a file with a recorded text, by the text's name.
        states: that it goes on from; each is taken up behind those before it.
        fixed: parameters that a node has found; with one it cannot begin in the middle of a run.
    """

    node: type[GuardedNode]
    arguments: Mapping[str, Any]
    compared: frozenset[str]
    files: Mapping[str, str] = MappingProxyType({})
    states: tuple[State, ...] = ()
    fixed: tuple[str, ...] = ()


_TYPES = {row.name: row.type for row in topics.TOPICS}


def known_rows() -> Mapping[str, Row]:
    """Returns the nodes of the core and of installed add-ons that can be replayed, by name."""
    modules = {node: name for one in add_ons() for node, name in one.replay_rows.items()}
    return {**ROWS, **{node: importlib.import_module(name).ROW for node, name in modules.items()}}


def types_of(*names: str) -> frozenset[str]:
    """Returns the types of a cell's topics, by their names."""
    return frozenset(_TYPES[name] for name in names)


MATCHED_NS: Final = 5 * SECOND // 2
"""A monitor matches a measurement and estimates that came so far apart, and none farther."""
_STATES = (
    State(
        types_of(topics.ESTIMATE, topics.EXPECTED_READING, topics.ESTIMATOR_STATE),
        topics.ESTIMATOR_STATE, EstimatorState,
    ),
    State(
        types_of(topics.FUSED_ESTIMATE, topics.OBSERVER_STATE),
        topics.OBSERVER_STATE, ObserverState,
    ),
    State(types_of(topics.CALM), topics.CALM, Calm),
)  # fmt: skip
ROWS: Final[Mapping[str, Row]] = {
    "estimator": Row(
        EstimatorNode,
        {"later": True},
        frozenset[str]().union(types_of(topics.TRAY_ESTIMATE), *(one.gives for one in _STATES)),
        {"model": "model", TRAY: "model", ROBOT: "urdf"},
        _STATES,
        (PLACED, CHAINED_SINCE, EMPTY),
    ),
    "monitor": Row(
        MonitorNode,
        {},
        types_of(topics.COMPARISON, topics.LIMIT_EVENT),
        states=(State(types_of(topics.COMPARISON), after_ns=MATCHED_NS),),
    ),
    "sensor": Row(SensorNode, {}, types_of(topics.FREE_SURFACE), {PAYLOAD: PAYLOAD}),
}
CHANGED: Final = "its message type has changed since"
NO_ROW: Final = "no installed package replays the node"
_OWN: Final = "slosh_msgs/"
"""Other types are repeated by none of the nodes."""
_UNTAKEN_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
"""No node with a journal takes these; they are large."""
LATE_NS: Final = 2 * SECOND
"""A message may be recorded so long after a journal that names it."""
KEPT: Final = 20_000
"""Recorded messages of a topic that no node is known to publish."""
_NEVER = 2**63 - 1


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
        mixed: nodes of which two processes ran at once.
    """

    processes: tuple[NodeReplay, ...]
    verified: Mapping[str, Verification]
    mixed: tuple[str, ...] = ()


def replay_journals(
    bag: str | Path | BagReader,
    cell: str | None = None,
    rows: Mapping[str, Row] | None = None,
) -> JournaledReplay:
    """Replays each node of a recording by its journal, and compares what it publishes.

    Args:
        bag: its path, or a reader of it.
        cell: namespace of the topics; None: the first cell that has journals.
        rows: the nodes that can be replayed, by name; None: those of the core and of add-ons.

    Raises:
        SloshBagError: no readable bag.
    """
    reader = bag if isinstance(bag, BagReader) else BagReader(bag)
    if cell is None:
        suffix = f"/{topics.JOURNAL}"
        named = (one.removesuffix(suffix) for one in reader.topics() if one.endswith(suffix))
        cell = next(named, topics.NAMESPACE)
    known = known_rows() if rows is None else rows
    with tempfile.TemporaryDirectory(prefix="slosh_replay_") as folder:
        replay = _Replay(reader, f"/{cell.strip('/')}".rstrip("/"), known, Path(folder))
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
        self._running: dict[str, Process] = {}
        self._ended: list[ProcessNotes] = []
        self._mixed: dict[str, None] = {}
        self._processes: list[Process] = []
        self._tallies: dict[str, Tally] = {}
        changed = {one for one in set(self._types.values()) if self._has_changed(one)}
        self._unread = {*_UNTAKEN_TYPES, *changed}
        for topic, info in reader.topics().items():
            if info.message_type in changed & self._compared:
                self._tallies[topic] = Tally(topic)
                self._tallies[topic].leave_out(info.count or 0, CHANGED)

    def _has_changed(self, kind: str) -> bool:
        """Returns whether a type of the recording is another one than that of the nodes' code."""
        if self._journal not in self._types:
            return False
        try:
            recorded = self._reader.typestore_of(kind).generate_msgdef(kind, ros_version=2)[0]
            return bool(Definitions().text(kind) != recorded)
        except SloshBagError:
            return True  # nothing here can read it

    def _read_latched(self) -> None:
        """Reads the few messages of latched topics before all others.

        A recorder may find such a topic seconds after a node took its message. What is latched but
        frequent, as calm is in a long recording, is not worth a second reading.
        """
        kinds = {row.type for row in topics.TOPICS if row.latched} - self._unread
        few = [
            topic
            for topic, info in self._reader.topics().items()
            if info.message_type in kinds
            and topic != self._journal
            and 0 < (info.count or 0) <= LATCHED
        ]
        for message in self._reader.messages(few):
            self._messages.add(message)

    def run(self) -> JournaledReplay:
        """Reads the recording and returns the result."""
        if self._journal in self._types:
            self._read_latched()
        heard = [one for one, kind in self._types.items() if kind not in self._unread]
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
            process.finish(_NEVER)
        processes = [
            NodeReplay(one.node, one.notes.taken, one.notes.lacking) for one in self._processes
        ]
        found = {
            topic.removeprefix(f"{self._cell}/"): self._named(topic, tally.result())
            for topic, tally in self._tallies.items()
        }
        verified = {name: one for name, one in found.items() if one.total or one.unchecked}
        return JournaledReplay(tuple(processes), verified, tuple(self._mixed))

    def _named(self, topic: str, result: Verification) -> Verification:
        """Returns the result with the first thing that the recording lacks of what a node took."""
        lacking = [one.notes.lacking for one in self._processes if one.speaks_on(topic)]
        first = next(filter(None, lacking), "")
        if not first or UNTAKEN not in result.unchecked:
            return result
        told = {
            why + f", first {first}" * (why == UNTAKEN): n for why, n in result.unchecked.items()
        }
        return replace(result, unchecked=told)

    def _keep(self, message: BagMessage) -> None:
        """Keeps what a node may have published; of what none does, the last."""
        kept = self._recorded[message.topic]
        kept.append(Recorded(message.publish_ns, message.data))
        if len(kept) > KEPT and message.topic not in self._tallies:
            del kept[: KEPT // 2]

    def _use(self, message: BagMessage) -> None:
        """Gives a node what the next of its journals names."""
        journal = self._reader.decode(message)
        process: Process | None = self._running.get(journal.node)
        if process is None or process.notes.count != journal.first or not journal.first:
            for notes in self._ended:
                if journal.first and (notes.node, notes.count) == (journal.node, journal.first):
                    notes.count += len(journal.source)
                    self._mixed[journal.node] = None
                    return
            if process is not None:
                process.finish(begun_ns(journal))
                self._ended.append(process.notes)
            process = self._begin(journal, message.log_ns)
        if process is not None:
            process.add(journal, message.publish_ns)

    def _begin(self, journal: Any, log_ns: int) -> Process | None:
        """Creates a node for its process that begins with a journal; None: it has no row.

        Where that is not the process's first one, the node begins in the middle of its run.
        """
        row, start = self._rows.get(journal.node), self._start(journal, log_ns)
        if row is None and start is not None:
            self._leave_out(start)
        if row is None or start is None:
            return None
        is_first = all(one.node != journal.node for one in self._processes)
        begun = LONG_AGO if journal.first and is_first else begun_ns(journal)
        notes = ProcessNotes(journal.node, log_ns, begun, journal.first)
        if journal.first and any(start.parameters.get(name) for name in row.fixed):
            row = row._replace(states=())
        output = partial(self._output, row.compared)
        process = Process(notes, row.states, self._messages, output, self._recorded)
        folder = self._folder / str(len(self._processes))
        parameters = {**start.parameters, **_files(folder, start, row)}
        place = Place(
            self._cell, parameters, start.topics, give=process.give, publishes=process.publishes
        )  # fmt: skip
        process.create(row.node, row.arguments, place)
        if journal.first:
            process.begin_late(begun_ns(journal), journal.steady)
        self._running[journal.node] = process
        self._processes.append(process)
        return process

    def _leave_out(self, start: NodeStart) -> None:
        """Notes that nothing here replays what a node of an add-on has published."""
        answers = {row.name for row in topics.TOPICS if row.role is topics.TopicRole.ANSWER}
        for name in answers & start.topics.keys():
            topic, kind = start.topics[name], self._types.get(start.topics[name], "")
            if kind.startswith(_OWN) and kind not in self._compared and topic not in self._tallies:
                self._tallies[topic] = Tally(topic)
                count = self._reader.topics()[topic].count or 0
                self._tallies[topic].leave_out(count, f"{NO_ROW} {start.node}")

    def _start(self, journal: Any, log_ns: int) -> NodeStart | None:
        """Returns the recorded settings with which a process begins its journal."""
        own = [one for one in self._starts if one.node == journal.node]
        if journal.first:
            known = [one for one in own if one.log_ns <= log_ns]
            return last_of_each(known or own[:1]).get(journal.node)
        before = [one.notes.log_ns for one in self._processes if one.node == journal.node]
        after_ns = max(before, default=-(2**63))
        return next((one for one in own if one.is_process and one.log_ns > after_ns), None)

    def _output(self, compared: Collection[str], topic: str) -> ComparedOutput | None:
        """Creates what compares a topic; None: it was not recorded, or is not compared."""
        kind = self._types.get(topic)
        if kind is None or kind not in compared or kind in self._unread:
            return None
        tally = self._tallies.setdefault(topic, Tally(topic))
        return ComparedOutput(self._reader, topic, kind, tally)


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
