"""Reads from a recording what each node took, in the order in which it took it."""

from __future__ import annotations

import json
from collections import defaultdict, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from slosh_bag.reader import BagReader
from slosh_base.files.nanoseconds import SECOND
from slosh_msgs_py.node.journal import ANSWER, MESSAGE, MICROSECOND, checksum
from slosh_msgs_py.node.offline import Taken

_NEVER = 2**63 - 1


class Process(NamedTuple):
    """What one process of a node took.

    Attributes:
        node: its name.
        begin_ns: log time of its first journal [ns].
        begun_ns, end_ns: when it began, and when the next one of the node did [ns].
        until_ns: up to when what it published is known from what it took [ns]. It sent its last
            journal then, or took the last thing before the first that is lacking.
        taken: in order, up to the first thing that the recording lacks.
        lacking: what that is; empty: nothing.
    """

    node: str
    begin_ns: int
    begun_ns: int
    end_ns: int
    until_ns: int
    taken: list[Taken]
    lacking: str


class _Entry(NamedTuple):
    source: str
    check: int
    content: bytes
    now_ns: int
    steady_ns: int


@dataclass(slots=True)
class _Notes:
    """Entries of one process, as they are read, and when its journals came and were sent."""

    begin_ns: int
    until_ns: int
    entries: list[_Entry] = field(default_factory=list)
    gap: str = ""


def read_processes(reader: BagReader, topic: str) -> list[Process]:
    """Reads the journals of all nodes and finds the messages that they name.

    Args:
        reader: of the bag.
        topic: the journals' full name.

    Raises:
        SloshBagError: a journal cannot be read.
    """
    notes = _read_notes(reader, topic)
    heard = {
        entry.source.removeprefix(MESSAGE).partition(" ")[0]
        for one in notes.values()
        for run in one
        for entry in run.entries
        if entry.source.startswith(MESSAGE)
    }
    messages = _messages(reader, heard)
    found = []
    for node, runs in notes.items():
        begins = [_begun_ns(run) for run in runs]
        for run, begun_ns, end_ns in zip(runs, begins, [*begins[1:], _NEVER], strict=True):
            found.append(_process(node, run, messages, begun_ns, end_ns))
    return found


def _read_notes(reader: BagReader, topic: str) -> Mapping[str, list[_Notes]]:
    found: dict[str, list[_Notes]] = defaultdict(list)
    for message in reader.messages({topic}):
        journal = reader.decode(message)
        runs = found[journal.node]
        if journal.first == 0:
            runs.append(_Notes(message.log_ns, message.publish_ns))
        elif not runs:
            begun = _Notes(message.log_ns, message.publish_ns)
            begun.gap = "the beginning of its journal"
            runs.append(begun)
        run = runs[-1]
        missing = journal.first - len(run.entries)
        if missing and not run.gap:
            run.gap = f"{missing} things of its journal"
        if not run.gap:
            run.entries.extend(_entries(journal))
            run.until_ns = message.publish_ns
    return found


def _entries(journal: Any) -> Iterator[_Entry]:
    base = journal.header.stamp.sec * SECOND + journal.header.stamp.nanosec
    content, at = bytes(journal.content), 0
    rows = zip(
        journal.source.tolist(), journal.check.tolist(), journal.time.tolist(),
        journal.steady_time.tolist(), strict=True,
    )  # fmt: skip
    for index, check, since, steady in rows:
        source = journal.sources[index]
        own = b""
        if not source.startswith(MESSAGE):
            own, at = content[at : at + check], at + check
        yield _Entry(
            source, check, own, base + since * MICROSECOND, journal.steady + steady * MICROSECOND
        )


def _messages(reader: BagReader, topics: set[str]) -> dict[tuple[str, int], deque[bytes]]:
    """Returns the messages of some topics by topic and CRC-32, equal ones in order."""
    found: dict[tuple[str, int], deque[bytes]] = defaultdict(deque)
    for message in reader.messages(topics):
        found[message.topic, checksum(message.data)].append(message.data)
    return found


def _process(
    node: str,
    notes: _Notes,
    messages: Mapping[tuple[str, int], deque[bytes]],
    begun_ns: int,
    end_ns: int,
) -> Process:
    taken: list[Taken] = []
    lacking = notes.gap
    for entry in notes.entries:
        if entry.source == ANSWER:
            if taken:
                question, answer = json.loads(entry.content)
                last = taken[-1]
                taken[-1] = last._replace(answers=(*last.answers, (question, answer)))
            continue
        content = entry.content
        if entry.source.startswith(MESSAGE):
            topic = entry.source.removeprefix(MESSAGE).partition(" ")[0]
            known = messages.get((topic, entry.check))
            if known is None:
                lacking = f"a message on {topic}"
                break
            content = known[0]
        taken.append(Taken(entry.source, content, entry.now_ns, entry.steady_ns))
    until_ns = taken[-1].now_ns if lacking and taken else notes.until_ns
    return Process(node, notes.begin_ns, begun_ns, end_ns, until_ns, taken, lacking)


def _begun_ns(notes: _Notes) -> int:
    return notes.entries[0].now_ns if notes.entries else notes.begin_ns
