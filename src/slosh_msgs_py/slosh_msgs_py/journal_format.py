"""Form of a node's journal: names of its sources, check sums, and its rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple
from zlib import crc32

from slosh_base.files.nanoseconds import SECOND

MICROSECOND = 1000
MESSAGE, TIMER, SERVICE = "message ", "timer ", "service "
"""How sources of these kinds begin; what follows is a full name, or a timer's number."""
START, BEGIN, PARAMETERS, ANSWER = "start", "begin", "parameters", "answer"
"""A node that is created, that begins its work; its parameters change; what the graph answers."""


class Entry(NamedTuple):
    """Something that a node took.

    Attributes:
        source: where it comes from; see `Journal.msg`.
        check: of a message its check sum, otherwise the length of the content.
        content: what the journal holds of it.
        now_ns, steady_ns: when, by the node's clock and by the steady one [ns].
    """

    source: str
    check: int
    content: bytes
    now_ns: int
    steady_ns: int

    @property
    def topic(self) -> str:
        """Full name of a message's topic; empty: it is no message."""
        is_message = self.source.startswith(MESSAGE)
        return self.source.removeprefix(MESSAGE).partition(" ")[0] if is_message else ""


def checksum(data: bytes) -> int:
    """Returns the CRC-32 of a serialised message in whole words."""
    return crc32(whole_words(data))


def whole_words(data: bytes) -> bytes:
    """Fills a serialised message up to whole words of four bytes with zeros.

    Fast DDS does so between processes, not within one.
    """
    short = -len(data) % 4
    return data + bytes(short) if short else data


def begun_ns(journal: Any) -> int:
    """Returns the time of the first thing in a journal [ns]."""
    stamp = journal.header.stamp
    return int(stamp.sec * SECOND + stamp.nanosec)


def entries(journal: Any) -> Iterator[Entry]:
    """Yields what a Journal message of any reader holds, in order."""
    base = begun_ns(journal)
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
        yield Entry(
            source, check, own, base + since * MICROSECOND, journal.steady + steady * MICROSECOND
        )
