"""The recorder's core: takes messages at any rate, writes them from a thread of its own.

A chunk's compression stalls for tens of milliseconds; a queue keeps that away from whoever
receives the messages.
"""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from slosh_bag.bag_writer import BagWriter, Qos

FLUSH_PERIOD_NS = 500_000_000
"""A killed process loses at most what came since the last flush."""
QUEUE_LENGTH = 20_000
QUEUE_BYTES = 512 * 2**20


class _Message(NamedTuple):
    topic: str
    data: bytes
    log_ns: int


class _Topic(NamedTuple):
    name: str
    message_type: str
    qos: Qos


@dataclass(frozen=True, slots=True)
class RecorderStatus:
    """How the recording goes.

    Attributes:
        written: messages by topic.
        lost: messages that found the queue full.
        waiting: messages in the queue.
        highest: most messages that the queue has held.
        failure: why writing has stopped, or an empty text.
    """

    written: dict[str, int]
    lost: int
    waiting: int
    highest: int
    failure: str


class Recorder:
    """Records serialised messages into a bag."""

    def __init__(self, folder: Path) -> None:
        self._writer = BagWriter(folder)
        self.path = self._writer.path
        self._queue: queue.Queue[_Message | _Topic | None] = queue.Queue(QUEUE_LENGTH)
        self._lost = self._highest = 0
        self._bytes = 0
        self._lock = threading.Lock()
        self._failure = ""
        self._thread = threading.Thread(target=self._run, name="bag writer", daemon=True)
        self._thread.start()

    def add_topic(self, name: str, message_type: str, qos: Qos) -> None:
        """Announces a topic; its messages follow."""
        self._queue.put(_Topic(name, message_type, qos))

    def add(self, topic: str, data: bytes, log_ns: int) -> None:
        """Takes a message; a full queue loses it, which `status` tells."""
        with self._lock:
            full = self._bytes + len(data) > QUEUE_BYTES
            self._bytes += 0 if full else len(data)
        if full:
            self._lost += 1
            return
        try:
            self._queue.put_nowait(_Message(topic, data, log_ns))
        except queue.Full:
            self._lost += 1
            with self._lock:
                self._bytes -= len(data)
            return
        self._highest = max(self._highest, self._queue.qsize())

    def status(self) -> RecorderStatus:
        """How the recording goes."""
        counts = self._writer.counts
        return RecorderStatus(
            counts, self._lost, self._queue.qsize(), self._highest, self._failure
        )

    def close(self) -> None:
        """Writes what waits and finishes the bag."""
        self._queue.put(None)
        self._thread.join()

    def _run(self) -> None:
        flushed_ns = 0
        while (item := self._next()) is not None:
            if self._failure:
                continue  # keep emptying the queue: the node lives on and says what is wrong
            try:
                if isinstance(item, _Topic):
                    self._writer.add_topic(*item)
                    continue
                if isinstance(item, _Message):
                    self._writer.write(*item)
                newest_ns = item.log_ns if isinstance(item, _Message) else None
                if newest_ns is None or newest_ns - flushed_ns >= FLUSH_PERIOD_NS:
                    self._writer.flush()
                    flushed_ns = flushed_ns if newest_ns is None else newest_ns
            except (OSError, ValueError) as error:
                self._failure = f"{self.path}: {error}"
        try:
            self._writer.close()
        except OSError as error:
            self._failure = self._failure or f"{self.path}: {error}"

    def _next(self) -> _Message | _Topic | bool | None:
        """The next item; True where nothing came for a flush period; None at the end."""
        try:
            item = self._queue.get(timeout=FLUSH_PERIOD_NS * 1e-9)
        except queue.Empty:
            return True
        if isinstance(item, _Message):
            with self._lock:
                self._bytes -= len(item.data)
        return item
