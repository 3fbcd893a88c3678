"""Runs the nodes of a recording again: their own code, given what they took, in its order."""

from __future__ import annotations

import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.reader import BagReader
from slosh_estimator.inputs import ROBOT
from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_estimator.nodes.monitor_node import MonitorNode
from slosh_estimator.nodes.sensor_node import PAYLOAD, SensorNode
from slosh_model.tray import TRAY
from slosh_msgs_py import topics
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.journal import BEGIN, START, whole_words
from slosh_msgs_py.node.offline import Place, replayed
from slosh_replay.journaled.taken import Process, read_processes
from slosh_replay.recording.settings import NodeStart, read_starts


class Row(NamedTuple):
    """A node that can be replayed.

    Attributes:
        node: its class.
        arguments: of the class.
        files: parameters that are set to a file with a recorded text, by the text's name.
    """

    node: type[GuardedNode]
    arguments: Mapping[str, Any]
    files: Mapping[str, str]


ROWS: Mapping[str, Row] = {
    "estimator": Row(
        EstimatorNode, {"later": True}, {"model": "model", TRAY: "model", ROBOT: "urdf"}
    ),
    "monitor": Row(MonitorNode, {}, {}),
    "sensor": Row(SensorNode, {}, {PAYLOAD: PAYLOAD}),
}
COMPARED = (
    topics.ESTIMATE, topics.EXPECTED_READING, topics.TRAY_ESTIMATE, topics.FUSED_ESTIMATE,
    topics.CALM, topics.COMPARISON, topics.SENSED_SURFACE, topics.FREE_SURFACE,
    topics.ESTIMATOR_STATE, topics.OBSERVER_STATE, topics.LIMIT_EVENT,
)  # fmt: skip
_STAMP = slice(4, 12)
"""Where a serialised message has the stamp of its header."""


class TopicMatch(NamedTuple):
    """Recorded messages of one topic against those of the replay.

    Attributes:
        identical: recorded ones that the replay gives bit for bit.
        different: recorded ones of whose stamp the replay gives another message.
        missing: recorded ones of whose stamp it gives none.
        unchecked: recorded ones that the node sent after its last journal, as when it was killed.
    """

    identical: int = 0
    different: int = 0
    missing: int = 0
    unchecked: int = 0

    @property
    def exact(self) -> bool:
        """Whether there are messages and all are the same."""
        return self.identical > 0 and not self.different and not self.missing


class NodeReplay(NamedTuple):
    """Result of the replay of one process of a node.

    Attributes:
        node: its name.
        taken: things that it was given.
        lacking: why it was not given all; empty: it was.
        matches: by the last name of the topic.
    """

    node: str
    taken: int
    lacking: str
    matches: Mapping[str, TopicMatch]

    @property
    def failure(self) -> str:
        """What differs from the recorded messages, in one line; empty: nothing."""
        parts = [
            f"{topic}: {match.different} of {match.identical + match.different} differ, "
            f"{match.missing} are missing"
            for topic, match in self.matches.items()
            if match.different or match.missing
        ]
        return f"{self.node} by its journal: {'; '.join(parts)}" if parts else ""


def replay_journals(path: str | Path, cell: str | None = None) -> list[NodeReplay]:
    """Replays each node of a recording by its journal, and compares what it publishes.

    Args:
        path: of the bag.
        cell: namespace of the topics; None: the first cell that has journals.

    Raises:
        SloshBagError: no readable bag.
    """
    reader = BagReader(path)
    if cell is None:
        suffix = f"/{topics.JOURNAL}"
        named = (one.removesuffix(suffix) for one in reader.topics() if one.endswith(suffix))
        cell = next(named, topics.NAMESPACE)
    processes = read_processes(reader, f"{cell}/{topics.JOURNAL}")
    starts = read_starts(reader, f"{cell}/{topics.SETTINGS}")
    found: list[NodeReplay] = []
    before_ns: dict[str, int] = defaultdict(lambda: -(2**63))
    for process in processes:
        row = ROWS.get(process.node)
        own = [one for one in starts if one.node == process.node and one.is_process]
        start = next((one for one in own if one.log_ns > before_ns[process.node]), None)
        before_ns[process.node] = process.begin_ns
        if row is None or start is None:
            continue
        found.append(_replay(reader, process, row, start, cell))
    return found


def _replay(
    reader: BagReader, process: Process, row: Row, start: NodeStart, cell: str
) -> NodeReplay:
    given: dict[str, list[bytes]] = defaultdict(list)

    def give(topic: str, serialise: Callable[[], bytes]) -> None:
        if topic.removeprefix(f"{cell}/") in COMPARED:
            given[topic].append(serialise())

    with tempfile.TemporaryDirectory(prefix="slosh_replay_") as name:
        parameters = {**start.parameters, **_files(Path(name), start, row)}
        place = Place(cell, parameters, start.topics, simulated=False, give=give)
        node = replayed(row.node, place, **row.arguments)
        for taken in process.taken:
            if taken.source == START:
                node.journal.begin(taken)
            elif taken.source == BEGIN:
                node.journal.begin(taken)
                node.prepare(lambda _: None)
                node.is_prepared()
            else:
                node.use(taken)
    matches = {
        topic.removeprefix(f"{cell}/"): _match(reader, topic, messages, process)
        for topic, messages in given.items()
    }
    return NodeReplay(process.node, len(process.taken), process.lacking, matches)


def _files(folder: Path, start: NodeStart, row: Row) -> dict[str, str]:
    """Writes recorded texts to files; returns the parameters that name them."""
    found = {}
    for text, parameter in row.files.items():
        if text in start.files:
            path = folder / f"{text}.yaml"
            path.write_text(start.files[text], "utf-8")
            found[parameter] = str(path)
    return found


def _match(reader: BagReader, topic: str, given: Sequence[bytes], process: Process) -> TopicMatch:
    own = [
        one
        for one in reader.messages({topic})
        if process.begun_ns <= one.publish_ns < process.end_ns
    ]
    recorded = [one for one in own if one.publish_ns <= process.until_ns]
    late = len(own) - len(recorded)
    if not recorded:
        return TopicMatch(unchecked=late)
    kind = recorded[0].message_type
    ours, theirs = _places(given), _places([message.data for message in recorded])
    shared = [place for place in theirs if place in ours]
    pairs = [
        reader.columns(_block(topic, kind, [data[place] for place in shared]))
        for data in (ours, theirs)
    ] if shared else [{}, {}]  # fmt: skip
    same = np.ones(len(shared), dtype=bool)
    for name, column in pairs[1].items():
        same &= _same_bits(column, pairs[0].get(name, column[:0]))
    identical = int(np.count_nonzero(same))
    return TopicMatch(identical, len(shared) - identical, len(theirs) - len(shared), late)


def _places(messages: Sequence[bytes]) -> dict[tuple[bytes, int], bytes]:
    """Returns messages by stamp, and by their place among those of the same stamp."""
    counts: Counter[bytes] = Counter()
    found = {}
    for data in messages:
        stamp = data[_STAMP]
        found[stamp, counts[stamp]] = data
        counts[stamp] += 1
    return found


def _block(topic: str, kind: str, messages: Sequence[bytes]) -> MessageBlock:
    whole = [whole_words(data) for data in messages]
    length = np.array([len(data) for data in whole], np.int64)
    start = np.cumsum(length) - length
    times = np.zeros(len(whole), np.int64)
    buffer = np.frombuffer(b"".join(whole), np.uint8)
    return MessageBlock(topic, kind, times, times, start, length, buffer)


def _same_bits(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.bool_]:
    if a.shape != b.shape:
        return np.zeros(len(a), dtype=bool)
    if a.dtype.kind == "f":
        a, b = (np.ascontiguousarray(one).view(f"i{one.itemsize}") for one in (a, b))
    same = np.ma.filled(np.ma.asarray(a == b), True) if np.ma.isMaskedArray(a) else a == b
    rows: NDArray[np.bool_] = np.all(np.asarray(same).reshape(len(a), -1), axis=1)
    return rows
