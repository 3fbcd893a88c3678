"""Recorder that queues messages and writes them to a bag in a separate thread.

A chunk's compression and a busy disk stall for tens of milliseconds; a queue keeps that away from
whoever receives the messages. Flushes follow a steady clock, not the messages' own times: those
stand still, or jump back, where a simulated clock does. While the disk is full the messages wait
in the queue; when there is room again they go into a new file.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from rosbags.typesys.base import TypesysError

from slosh_bag.bag_writer import NEVER, BagWriter, Qos, Split
from slosh_bag.errors import SloshBagError
from slosh_bag.held_folder import HeldFolder
from slosh_bag.mcap_files.mcap_file import FAST

FLUSH_PERIOD = 0.5  # s
"""A killed process loses at most what came since the last flush, and what waited then."""
PERIOD = 0.1  # s
"""How long messages wait for the writer; it takes them all at once, which spares it wake-ups."""
RETRY = 1.0  # s
QUEUE_LENGTH = 100_000
QUEUE_BYTES = 512 * 2**20
WAKE_BYTES = 8 * 2**20
"""The writer does not sleep on as much as this."""
ROOM = 16 * 2**20
"""Free space, besides that for what waits, before a new file is begun on a disk that was full."""
LAST_ROOM = 2**20
"""Free space with which the last file is begun, when the recording ends on a full disk."""
RESERVE = ".reserve"
RESERVED = 256 * 2**10
"""Space that is kept for the ends of the files and what they note, in a file of this name [bytes].
It is given up when the recording ends."""
LOST = "messages_lost"
"""A fact of a bag: messages that were sent and are not in it, so far as the recorder knows."""
LOST_BY_TOPIC = "messages_lost_by_topic"
"""The same by topic, as JSON; without a topic where it is not known."""
SEVERAL = "several_publishers"
"""A fact of a bag: topics of one node on which several spoke, with commas."""
PUBLISHERS = "publishers_of_shared_topics"
"""Nodes that spoke on these topics, one for each publisher, as JSON by topic."""
RATE_PERIOD = 30  # samples, one a second


class _Message(NamedTuple):
    topic: str
    data: bytes
    log_ns: int
    publish_ns: int | None
    arrived: float


class _Topic(NamedTuple):
    name: str
    message_type: str
    qos: Qos
    arrived: float


@dataclass(frozen=True, slots=True)
class RecorderStatus:
    """State of a recording: files, losses and failures.

    Attributes:
        path: the newest file.
        files: their number.
        written: messages by topic.
        size: bytes of these messages.
        refused: why a topic cannot be recorded, by topic; the others go on.
        unkept: messages that found the queue full, were there when the recording ended and could
            not be written, or were in a file that somebody has deleted.
        missed: messages that were sent and did not reach the recorder.
        waiting: messages in the queue.
        highest: most messages that the queue has held.
        age: since when the oldest message waits that a killed process would lose [s].
        free: free space on the disk [bytes].
        rate: growth of the files [bytes/s]; NaN before it is known.
        failure: why nothing is written now, or an empty text.
        since: for how long that has been so [s].
        interruptions: how often that was so before.
        lost_meanwhile: messages among `unkept` that came while nothing could be written.
    """

    path: Path
    files: int
    written: dict[str, int]
    size: int
    refused: dict[str, str]
    unkept: int
    waiting: int
    highest: int
    age: float
    free: int
    rate: float
    failure: str
    since: float
    interruptions: int
    lost_meanwhile: int
    missed: int = 0

    @property
    def lost(self) -> int:
        """Number of messages that were sent but will be missing in the bag."""
        return self.unkept + self.missed

    @property
    def time_left(self) -> float:
        """Time until the disk is full at the present data rate [s]; infinite if unknown."""
        return self.free / self.rate if self.rate > 0.0 else float("inf")


def free_space(folder: Path) -> int:
    """Returns the free space on a folder's disk [bytes]."""
    return shutil.disk_usage(folder).free


class Recorder:
    """Records serialised messages to a bag in a separate thread.

    Messages come from one thread; `status` may be asked by any.

    Args:
        folder: the bag's folder.
        split: when its next file begins.
        clock: steady clock [s].
        free: free space on a folder's disk [bytes].

    Raises:
        SloshBagError: the folder holds files, another recorder writes in it, or it cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        split: Split = NEVER,
        clock: Callable[[], float] = time.monotonic,
        free: Callable[[Path], int] = free_space,
    ) -> None:
        self._held = HeldFolder.made(folder)
        try:
            self._writer = BagWriter(folder, split=split, level=FAST)
        except BaseException:
            self._held.release()
            raise
        self._clock = clock
        self._free_space = free
        self._queue: deque[_Message | _Topic] = deque()
        self._open: list[_Message] = []  # given to the writer, not in a file yet
        self._refused: dict[str, str] = {}
        self._unkept: Counter[str] = Counter()
        self._missed: Mapping[str, int] = {}
        self._lost_meanwhile = self._highest = self._size = 0
        # Each counted by one thread alone: the difference needs no lock.
        self._bytes_in = self._bytes_out = 0
        self._notes: dict[str, str] = {}
        self._failure = ""
        self._failed_path = self._writer.path
        self._failed_at = self._retry_at = 0.0
        self._interruptions = 0
        self._free = 0
        self._reserve = folder / RESERVE
        self._take_reserve()
        self._sizes: deque[tuple[float, int]] = deque(maxlen=RATE_PERIOD)
        self._measure()
        self._wake = threading.Event()
        self._ending = False
        self._thread = threading.Thread(target=self._run, name="bag writer", daemon=True)
        self._thread.start()

    @property
    def path(self) -> Path:
        """Path of the bag's newest file."""
        return self._writer.path

    def add_topic(self, name: str, message_type: str, qos: Qos) -> None:
        """Registers a topic before its first message."""
        self._queue.append(_Topic(name, message_type, qos, self._clock()))

    def add(self, topic: str, data: bytes, log_ns: int, publish_ns: int | None = None) -> None:
        """Adds a message to the queue, or counts it as lost if the queue is full.

        Args:
            topic: a topic that was announced.
            data: CDR bytes.
            log_ns: when it was received [ns].
            publish_ns: when it was sent [ns]; None: unknown.
        """
        waiting = self._bytes_in - self._bytes_out + len(data)
        if waiting > QUEUE_BYTES or len(self._queue) >= QUEUE_LENGTH:
            self._unkept[topic] += 1
            self._lost_meanwhile += bool(self._failure)
            return
        self._bytes_in += len(data)
        self._queue.append(_Message(topic, data, log_ns, publish_ns, self._clock()))
        self._highest = max(self._highest, len(self._queue))
        if waiting > WAKE_BYTES:
            self._wake.set()

    def note(self, name: str, value: str) -> None:
        """Stores a key and value of bag metadata."""
        self._notes[name] = value

    def miss(self, counts: Mapping[str, int]) -> None:
        """Sets the number of messages that were sent but not received, by topic."""
        self._missed = dict(counts)

    def status(self) -> RecorderStatus:
        """State of the recording: files, losses and failures."""
        now = self._clock()
        first, last = self._sizes[0], self._sizes[-1]
        elapsed = last[0] - first[0]
        return RecorderStatus(
            path=self._writer.path,
            files=self._writer.files,
            written=self._writer.counts,
            size=self._size,
            refused=self._refused.copy(),
            unkept=sum(self._unkept.copy().values()),
            waiting=len(self._queue),
            highest=self._highest,
            age=max(now - self._oldest(now), 0.0),
            free=self._free,
            rate=max(last[1] - first[1], 0) / elapsed if elapsed > 0.0 else float("nan"),
            failure=self._failure,
            since=now - self._failed_at if self._failure else 0.0,
            interruptions=self._interruptions,
            lost_meanwhile=self._lost_meanwhile,
            missed=sum(self._missed.values()),
        )

    def close(self) -> None:
        """Writes the queued messages and finishes the bag."""
        self._ending = True
        self._wake.set()
        self._thread.join()

    def _oldest(self, now: float) -> float:
        """Returns the arrival time of the oldest unwritten message, or `now` if there is none."""
        for waiting in (self._open, self._queue):
            with contextlib.suppress(IndexError):  # the writer's thread takes them meanwhile
                return waiting[0].arrived
        return now

    def _run(self) -> None:
        while not self._ending:
            self._wake.wait(PERIOD)
            self._wake.clear()
            self._work()
        left = len(self._queue) + 1
        while len(self._queue) < left:  # as long as it helps, whatever the time
            left = len(self._queue)
            self._retry_at = 0.0
            self._work()
        self._end()

    def _work(self) -> None:
        """Writes queued messages and flushes the file regularly, in the writer thread."""
        if self._failure:
            self._try_again()
        while self._queue and not self._failure:
            item = self._queue.popleft()
            if isinstance(item, _Topic):
                self._announce(item)
            else:
                self._write(item)
        if self._open and self._clock() - self._open[0].arrived >= FLUSH_PERIOD:
            self._flush()
        if self._clock() - self._sizes[-1][0] >= 1.0:
            self._measure()
            self._look_for_deleted()

    def _write(self, item: _Message) -> None:
        self._bytes_out += len(item.data)
        if item.topic in self._refused:
            return
        try:
            self._writer.write(item.topic, item.data, item.log_ns, item.publish_ns)
        except (OSError, MemoryError) as error:
            self._fail(error, [item])
            return
        except Exception as error:  # a thread that ended here would say nothing to anyone
            self._unkept[item.topic] += 1
            self._fail(error, [])
            return
        self._size += len(item.data)
        pending = self._writer.pending
        if pending > 1:
            self._open.append(item)
            if item.arrived - self._open[0].arrived >= FLUSH_PERIOD:
                self._flush()
        else:
            self._open = [item] if pending else []

    def _flush(self) -> None:
        try:
            self._writer.flush()
        except Exception as error:
            self._fail(error, [])
        else:
            self._open = []

    def _announce(self, topic: _Topic) -> None:
        """Adds a topic to the bag unless the definition of its type is missing."""
        try:
            self._writer.add_topic(topic.name, topic.message_type, topic.qos)
        except (SloshBagError, TypesysError) as error:
            self._refused[topic.name] = " ".join(str(error).split())

    def _fail(self, error: Exception, also: list[_Message]) -> None:
        """Ends the file after a write error and returns unwritten messages to the queue."""
        self._failed_path = self._writer.path
        # Where it failed after a split's end everything before is in a file already.
        again = self._open if self._writer.abandon() else []
        self._size -= sum(len(item.data) for item in again)
        for item in reversed([*again, *also]):
            self._bytes_out -= len(item.data)
            self._queue.appendleft(item)
        self._open = []
        now = self._clock()
        # At once for a limit on the file alone; where that fails too, once a period.
        self._retry_at = now + RETRY if now - self._failed_at < RETRY else now
        self._failed_at = now
        self._measure()  # first: whoever reads of the failure reads how much room there is, too
        self._failure = f"{self._failed_path}: {_reason(error)}"

    def _try_again(self) -> None:
        """Continues the bag in a new file if the disk has space for the queue."""
        now = self._clock()
        if now < self._retry_at:
            return
        self._retry_at = now + RETRY
        self._measure()
        # In the end as much as there is room for, before that all of it or nothing.
        needed = LAST_ROOM if self._ending else ROOM + self._bytes_in - self._bytes_out
        if self._free < needed:
            return
        try:
            self._writer.resume()
        except Exception as error:
            self._writer.abandon()
            self._failure = f"{self._failed_path}: {_reason(error)}"
        else:
            self._failure = ""
            self._interruptions += 1

    def _end(self) -> None:
        """Finishes the bag and counts messages that cannot be written as lost."""
        self._look_for_deleted()
        with contextlib.suppress(OSError):
            self._reserve.unlink(missing_ok=True)
        try:
            self._writer.flush()
            self._count_missed()
            self._writer.close()
        except Exception as error:
            self._fail(error, [])
            self._count_missed()
        self._open = []
        self._held.release()

    def _count_missed(self) -> None:
        left = Counter(item.topic for item in self._queue if isinstance(item, _Message))
        self._queue.clear()
        self._unkept.update(left)
        self._lost_meanwhile += sum(left.values())
        lost = self._unkept + Counter(self._missed)
        if lost:
            self._writer.note(LOST, str(sum(lost.values())))
            self._writer.note(LOST_BY_TOPIC, json.dumps(dict(sorted(lost.items()))))
        for name, value in self._notes.items():
            self._writer.note(name, value)

    def _look_for_deleted(self) -> None:
        """Detects bag files that were deleted during the recording."""
        gone = self._writer.forget_deleted()
        if not gone:
            return
        self._unkept[""] += gone
        self._lost_meanwhile += gone
        self._open = []
        self._held.release()
        self._held = HeldFolder(self._writer.folder)
        self._take_reserve()
        self._interruptions += 1

    def _take_reserve(self) -> None:
        with contextlib.suppress(OSError):  # on a full disk there is none to be had
            self._reserve.write_bytes(bytes(RESERVED))

    def _measure(self) -> None:
        with contextlib.suppress(OSError):
            self._free = self._free_space(self._writer.folder)
        self._sizes.append((self._clock(), self._writer.size))


def _reason(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error)
    return " ".join(text.split()) or type(error).__name__
