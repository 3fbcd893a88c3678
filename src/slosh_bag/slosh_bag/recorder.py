"""The recorder's core: takes messages at any rate, writes them from a thread of its own.

A chunk's compression stalls for tens of milliseconds; a queue keeps that away from whoever
receives the messages. Flushes follow a steady clock, not the messages' own times: those stand
still, or jump back, where a simulated clock does.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from rosbags.typesys.base import TypesysError

from slosh_bag.bag_writer import BagWriter, Qos
from slosh_bag.errors import SloshBagError

FLUSH_PERIOD = 0.5  # s
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
        size: bytes of these messages.
        refused: why a topic cannot be recorded, by topic; the others go on.
        lost: messages that found the queue full.
        waiting: messages in the queue.
        highest: most messages that the queue has held.
        failure: why writing has stopped, or an empty text.
    """

    written: dict[str, int]
    size: int
    refused: dict[str, str]
    lost: int
    waiting: int
    highest: int
    failure: str


class Recorder:
    """Records serialised messages into a bag.

    Args:
        folder: the bag's folder.
        clock: steady clock of the flushes [s].
    """

    def __init__(self, folder: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self._writer = BagWriter(folder)
        self.path = self._writer.path
        self._clock = clock
        self._queue: queue.Queue[_Message | _Topic | None] = queue.Queue(QUEUE_LENGTH)
        self._written: dict[str, int] = {}
        self._refused: dict[str, str] = {}
        self._lost = self._highest = 0
        self._bytes = self._size = 0
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
        return RecorderStatus(
            # Copies in one step each: the writer's thread adds topics meanwhile.
            written=self._written.copy(),
            size=self._size,
            refused=self._refused.copy(),
            lost=self._lost,
            waiting=self._queue.qsize(),
            highest=self._highest,
            failure=self._failure,
        )

    def close(self) -> None:
        """Writes what waits and finishes the bag."""
        self._queue.put(None)
        self._thread.join()

    def _run(self) -> None:
        flushed = self._clock()
        while (item := self._next(flushed + FLUSH_PERIOD - self._clock())) is not None:
            if self._failure:
                continue  # keep emptying the queue: the node lives on and says what is wrong
            try:
                self._take(item)
                if self._clock() - flushed >= FLUSH_PERIOD:
                    self._writer.flush()
                    flushed = self._clock()
            except Exception as error:  # a thread that ended here would say nothing to anyone
                self._fail(error)
        try:
            self._writer.close()
        except Exception as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        reason = " ".join(str(error).split()) or type(error).__name__
        self._failure = self._failure or f"{self.path}: {reason}"

    def _take(self, item: _Message | _Topic | bool) -> None:
        if isinstance(item, _Topic):
            self._announce(item)
        elif isinstance(item, _Message) and item.topic not in self._refused:
            self._writer.write(*item)
            self._written[item.topic] += 1
            self._size += len(item.data)

    def _announce(self, topic: _Topic) -> None:
        """A topic whose type nobody can describe is left out; all others are recorded."""
        try:
            self._writer.add_topic(*topic)
        except (SloshBagError, TypesysError) as error:
            self._refused[topic.name] = " ".join(str(error).split())
        else:
            self._written.setdefault(topic.name, 0)

    def _next(self, patience: float) -> _Message | _Topic | bool | None:
        """The next item; True where nothing came for some seconds; None at the end."""
        try:
            item = self._queue.get(timeout=max(patience, 0.0))
        except queue.Empty:
            return True
        if isinstance(item, _Message):
            with self._lock:
                self._bytes -= len(item.data)
        return item
