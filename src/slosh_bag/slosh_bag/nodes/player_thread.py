"""Publishes the messages of a play plan at their times, in a separate thread."""

from __future__ import annotations

import queue
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Generic, TypeVar

from rclpy.duration import Duration
from rosgraph_msgs.msg import Clock

from slosh_bag.errors import SloshBagError
from slosh_bag.playing.play_plan import PlayPlan
from slosh_bag.playing.playback import Step
from slosh_base.files.nanoseconds import SECOND

SETTLE = 0.5  # s; for so long nobody new has come, and who is there hears the publishers
ANNOUNCE_PERIOD = 0.05
LINGER = 0.5  # s; the last messages are read before the process ends
ACKNOWLEDGED = 2.0
# A player that is behind would only overwrite what slow readers have not yet taken: so often and
# for so long it lets those that read reliably catch up.
BEHIND_NS = 100_000_000
EASE_EVERY, EASE = 500, 0.1
# The thread that reads ahead must not keep the interpreter while a message is due.
SWITCH_INTERVAL = 0.0005
NAP = 0.05  # s; longer sleeps look in between whether to stop

BATCH_LENGTH, BATCH_SIZE = 256, 2**20
BATCHES = 32
_POLL = 0.1  # s; how long the thread waits for room before it looks whether anyone still reads

Item = TypeVar("Item")


class PlayerThread:
    """Thread that waits for subscribers, publishes all messages and waits for delivery.

    Args:
        plan: what is played.
        publishers: by the topics' names in the bag.
        clock: publisher of /clock.
        warn: takes what the user should know.

    Attributes:
        count: messages that are out.
        bag_ns: bag time of the newest [ns].
        began_ns: when the playing began, of the steady clock [ns]; 0: it waits for subscribers.
        late_ns, latest_ns: how late the newest message was, and the latest of all [ns].
        failure: why it could not go on; empty: it could.
    """

    def __init__(
        self,
        plan: PlayPlan,
        publishers: Mapping[str, Any],
        clock: Any,
        warn: Callable[[str], Any],
    ) -> None:
        self.count, self.bag_ns = 0, plan.playback.first_ns
        self.began_ns = 0
        self.late_ns = self.latest_ns = 0
        self.failure = ""
        self._plan, self._publishers, self._warn = plan, publishers, warn
        self._clock_publisher, self._clock = clock, Clock()
        self._stop, self._finished = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, subscribers: int, patience: float) -> None:
        """Starts the thread that publishes the messages.

        Args:
            subscribers: how many there must be before the first message.
            patience: after so long it goes on without them [s].
        """
        sys.setswitchinterval(SWITCH_INTERVAL)
        self._thread = threading.Thread(
            target=self._run, args=(subscribers, patience), name="player", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Stops the thread that publishes the messages, at once."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    @property
    def finished(self) -> bool:
        """Whether playback has ended and all messages have been delivered as far as possible."""
        return self._finished.is_set()

    def _run(self, subscribers: int, patience: float) -> None:
        self.failure = "the player ended unexpectedly"
        try:
            # Reads while it waits: the first messages are there when their time comes.
            with ReadAhead(self._plan.steps(), step_size) as steps:
                self._wait_for_subscribers(subscribers, patience)
                self._publish(steps)
            self._deliver()
            self.failure = ""
        except SloshBagError as error:
            self.failure = str(error)
        finally:
            self._finished.set()

    def _wait_for_subscribers(self, wanted: int, patience: float) -> None:
        """Publishes /clock until the required number of subscribers is present."""
        began = settled = time.monotonic()
        before = 0
        while not self._stop.wait(ANNOUNCE_PERIOD):
            self._tell_time(self._plan.playback.first_ns)
            now, there = time.monotonic(), self._subscribers()
            if there != before:
                before, settled = there, now
            if there >= max(wanted, 1) and now - settled >= SETTLE:
                return
            if now - began >= patience:
                self._warn(f"{there} subscribers after {patience:.1f} s: playback starts anyway")
                return

    def _subscribers(self) -> int:
        return sum(publisher.get_subscription_count() for publisher in self._publishers.values())

    def _publish(self, steps: Iterable[Step]) -> None:
        """Publishes each message, and /clock, at its time."""
        publish = {topic: publisher.publish for topic, publisher in self._publishers.items()}
        now = time.monotonic_ns
        self.began_ns = begin = now()
        for step in steps:
            due = begin + step.wall_ns
            if not self._until(due):
                return
            self.bag_ns = step.clock_ns
            if step.message is None:
                self._tell_time(step.clock_ns)
                continue
            publish[step.message.topic](step.message.data)
            self.count += 1
            self.late_ns = late = now() - due
            if late > self.latest_ns:
                self.latest_ns = late
            if late > BEHIND_NS and not self.count % EASE_EVERY:
                self._wait_until_acknowledged(EASE)

    def _until(self, due_ns: int) -> bool:
        """Sleeps until a monotonic time; returns False if the thread should end."""
        while (left := due_ns - time.monotonic_ns()) > 0 and not self._stop.is_set():
            time.sleep(min(left * 1e-9, NAP))
        return not self._stop.is_set()

    def _tell_time(self, bag_ns: int) -> None:
        clock = self._clock.clock
        clock.sec, clock.nanosec = divmod(bag_ns, SECOND)
        self._clock_publisher.publish(self._clock)

    def _deliver(self) -> None:
        """Waits until reliable subscribers have acknowledged all messages, and a moment longer."""
        for warning in dict.fromkeys(self._plan.reader.warnings):
            if warning not in self._plan.warnings:
                self._warn(warning)
        self._wait_until_acknowledged(ACKNOWLEDGED)
        self._stop.wait(LINGER)

    def _wait_until_acknowledged(self, patience: float) -> None:
        until = time.monotonic() + patience
        for publisher in self._publishers.values():
            left = until - time.monotonic()
            if left > 0.0 and not self._stop.is_set():
                publisher.wait_for_all_acked(Duration(seconds=left))


def step_size(step: Step) -> int:
    """Returns the size of the message in a playback step [bytes]."""
    return len(step.message.data) if step.message else 0


class ReadAhead(Generic[Item]):
    """Iterates over items that a background thread reads ahead.

    A thread of its own reads ahead: to read and decompress a chunk of a bag takes milliseconds.

    At most `BATCHES` of at most `BATCH_LENGTH` items and about `BATCH_SIZE` bytes wait. What the
    items' own iterator raises is raised here, behind the items before it.

    Args:
        items: what gives the items.
        size: bytes of an item.
    """

    def __init__(self, items: Iterable[Item], size: Callable[[Item], int]) -> None:
        self._items, self._size = items, size
        self._queue: queue.Queue[list[Item] | BaseException | None] = queue.Queue(BATCHES)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="read ahead", daemon=True)
        self._thread.start()

    def __enter__(self) -> ReadAhead[Item]:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def __iter__(self) -> Iterator[Item]:
        while (batch := self._queue.get()) is not None:
            if isinstance(batch, BaseException):
                raise batch
            yield from batch

    def _run(self) -> None:
        batch: list[Item] = []
        size, end = 0, None
        try:
            for item in self._items:
                batch.append(item)
                size += self._size(item)
                if len(batch) >= BATCH_LENGTH or size >= BATCH_SIZE:
                    if not self._put(batch):
                        return
                    batch, size = [], 0
        except BaseException as error:  # whatever it is, the other side must not wait for ever
            end = error
        if self._put(batch):
            self._put(end)

    def _put(self, batch: list[Item] | BaseException | None) -> bool:
        """Adds a batch of items to the queue; returns False if reading is to stop."""
        while not self._stop.is_set():
            try:
                self._queue.put(batch, timeout=_POLL)
            except queue.Full:
                continue
            return True
        return False
