"""Decides which messages are written to a bag: those around an event.

The messages of the last seconds wait in a ring. An event begins a bag with them and with the
latched messages of before; it goes on for some seconds after the event, and another event
meanwhile lengthens it. Time is that of the messages: no clock is asked.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final, NamedTuple, Protocol

from slosh_bag.bag_writer import Qos
from slosh_bag.black_box.ring import OVERHEAD, Held, Place, Ring
from slosh_bag.errors import SloshBagError
from slosh_bag.recorder import QUEUE_LENGTH
from slosh_base.files.nanoseconds import SECOND

EVENTS: Final = "events"
"""A fact of a bag: why it was written, as a JSON list of `Happening.document`."""
TOLD: Final = 100
"""Events of a bag that its facts tell; more of the same cause are in its messages alone."""
MOST: Final = QUEUE_LENGTH // 2
"""Messages in the ring at most: a bag's writer takes all of them at once."""
RETRY_NS: Final = SECOND
"""A bag that cannot be begun is tried again after this time [ns]."""

SET_BACK_NS: Final = SECOND
"""A time so far before the last one is a clock that was set back [ns]; less is disorder."""


class Cause(StrEnum):
    """The kind of event for which a bag is written."""

    LIMIT = "limit"
    DISAGREEMENT = "disagreement"
    BLIND = "blind"
    FALSE_CALM = "false_calm"
    REQUEST = "request"


class Happening(NamedTuple):
    """An event for which a bag is written: cause, time and description.

    Attributes:
        cause: its kind.
        stamp_ns: when it happened, by the stamps of the messages [ns].
        text: one line for people.
    """

    cause: Cause
    stamp_ns: int
    text: str

    def document(self) -> dict[str, str | int]:
        """Returns the event's attributes by name, for JSON."""
        return {"cause": self.cause.value, "stamp_ns": self.stamp_ns, "text": self.text}


class Sink(Protocol):
    """Interface of a bag that is being written, as `slosh_bag.recorder.Recorder` implements it."""

    def add_topic(self, name: str, message_type: str, qos: Qos) -> None:
        """Registers a topic before its first message is added."""

    def add(self, topic: str, data: bytes, log_ns: int, publish_ns: int | None = None) -> None:
        """Adds a serialised message to the bag."""

    def note(self, name: str, value: str) -> None:
        """Stores a key and value in the bag's metadata."""

    def miss(self, counts: Mapping[str, int]) -> None:
        """Sets the number of messages that were sent but not received so far, by topic."""

    def close(self) -> None:
        """Finishes the bag's files."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Limits of the recording around an event: time before and after, memory and bag size.

    Attributes:
        before_ns, after_ns: time before and after it [ns].
        memory: that the ring takes at most [bytes].
        longest: size of a bag [bytes]; where a bag would be larger, another one goes on.
    """

    before_ns: int
    after_ns: int
    memory: int
    longest: int


@dataclass(slots=True)
class _Open:
    """A bag that is being written for one or more events."""

    sink: Sink
    until_ns: int
    begin_ns: int
    lost_before: Counter[str]
    happenings: list[Happening]
    size: int = 0
    types: dict[str, str] = field(default_factory=dict)


class _Losses(NamedTuple):
    at_ns: int
    counts: Counter[str]


class BlackBox:
    """Keeps the most recent messages in memory and writes them to a bag at an event.

    All calls come from one thread.

    Args:
        windows: how much is kept.
        begin: begins a bag for an event; raises SloshBagError where it cannot.
        place: of a latched message; see Ring.

    Attributes:
        events: that were told.
        bags: that were begun.
        missed: events of which no bag could be begun while they were in memory.
        continued: bags that go on for an event behind a bag that was full.
        failure: why no bag can be begun now; empty: one can.
    """

    def __init__(
        self,
        windows: Windows,
        begin: Callable[[Happening], Sink],
        place: Callable[[str, bytes], Place | None] = lambda _topic, _data: None,
    ) -> None:
        self._windows = windows
        self._begin = begin
        self.ring = Ring(windows.before_ns, windows.memory, MOST, place)
        self._topics: dict[str, tuple[str, Qos]] = {}
        self._notes: dict[str, str] = {}
        self._losses = [_Losses(0, Counter())]
        self._open: _Open | None = None
        self._pending: list[tuple[int, Happening]] = []
        self._now_ns = self._retry_ns = 0
        self._log_ns: int | None = None
        self.events = self.bags = self.missed = self.continued = 0
        self.failure = ""

    @property
    def is_writing(self) -> bool:
        """Whether a bag is open."""
        return self._open is not None

    @property
    def span_ns(self) -> int:
        """Time span of the messages that are held in memory [ns]."""
        begin_ns = self.ring.begin_ns
        return 0 if begin_ns is None else self._now_ns - begin_ns

    def add_topic(self, name: str, message_type: str, qos: Qos) -> None:
        """Registers a topic, or a change of its type or QoS, before its next message."""
        known = self._topics.get(name)
        if known is not None and known[0] != message_type:
            self.ring.forget(name)
        self._topics[name] = (message_type, qos)

    def add(self, topic: str, data: bytes, log_ns: int, publish_ns: int | None = None) -> None:
        """Adds a message of a registered topic to the memory and to an open bag.

        Args:
            topic: the topic.
            data: CDR bytes.
            log_ns: when it was received [ns]; a time before that of the last message is a clock
                that was set back.
            publish_ns: when it was sent [ns]; None: unknown.
        """
        self.look(log_ns)
        message = Held(topic, data, log_ns, publish_ns, self._now_ns)
        self.ring.add(message)
        if self._open is not None:
            self._write(self._open, message)
            if self._open.size > self._windows.longest:
                self._go_on(self._open)

    def look(self, now_ns: int) -> None:
        """Sets the time [ns], by the messages' clock; ends the open bag after its time range."""
        if self._log_ns is None or self._log_ns - now_ns > SET_BACK_NS:
            self._log_ns = now_ns
        self._now_ns += max(now_ns - self._log_ns, 0)
        self._log_ns = max(now_ns, self._log_ns)
        if self._open is not None and self._now_ns > self._open.until_ns:
            self._end()
        self.ring.trim(self._now_ns)
        if self._pending and self._now_ns >= self._retry_ns:
            self._begin_pending()

    def happen(self, happening: Happening) -> None:
        """Processes a new event: starts a bag, or extends the time range of the open one."""
        self.events += 1
        if self._open is not None:
            self._lengthen(self._open, happening, self._now_ns)
            return
        self._pending.append((self._now_ns, happening))
        self._begin_pending()

    def note(self, name: str, value: str) -> None:
        """Stores a key and value of metadata for all bags from now on."""
        self._notes[name] = value
        if self._open is not None:
            self._open.sink.note(name, value)

    def miss(self, counts: Mapping[str, int]) -> None:
        """Sets the number of messages, by topic, that were sent but not received since start."""
        now = Counter(counts)
        if now != self._losses[-1].counts:
            self._losses.append(_Losses(self._now_ns, now))
            begin_ns = self._open.begin_ns if self._open else self._now_ns
            oldest_ns = min(begin_ns, self._now_ns - self._windows.before_ns)
            while len(self._losses) > 1 and self._losses[1].at_ns < oldest_ns:
                del self._losses[0]
        if self._open is not None:
            self._open.sink.miss(now - self._open.lost_before)

    def close(self) -> None:
        """Finishes the open bag and ends the recording."""
        if self._pending:
            self._begin_pending()
        self.missed += len(self._pending)
        self._pending.clear()
        if self._open is not None:
            self._end()

    def _begin_pending(self) -> None:
        """Starts a bag for events that have none yet, while their messages are in memory."""
        forgotten_ns = self._now_ns - self._windows.before_ns
        current = [pair for pair in self._pending if pair[0] >= forgotten_ns]
        self.missed += len(self._pending) - len(current)
        self._pending = current
        if not current:
            self.failure = ""
            return
        try:
            sink = self._begin(current[0][1])
        except SloshBagError as error:
            self.failure = str(error)
            self._retry_ns = self._now_ns + RETRY_NS
            return
        self.failure = ""
        self._pending = []
        bag = self._start(sink)
        for at_ns, happening in current:
            self._lengthen(bag, happening, at_ns)

    def _start(self, sink: Sink) -> _Open:
        """Starts writing a bag with all messages in memory."""
        begin_ns = self._now_ns - self.span_ns
        before = [entry.counts for entry in self._losses if entry.at_ns < begin_ns]
        bag = _Open(sink, self._now_ns, begin_ns, before[-1] if before else Counter(), [])
        self._open = bag
        self.bags += 1
        for name, value in self._notes.items():
            sink.note(name, value)
        sink.miss(self._losses[-1].counts - bag.lost_before)
        first = next(iter(self.ring), None)
        for message in self.ring.standing():
            # As if heard again when the bag begins: it does not begin hours before.
            log_ns = message.log_ns if first is None else first.log_ns
            self._write(bag, message._replace(log_ns=log_ns))
        for message in self.ring:
            self._write(bag, message)
        return bag

    def _go_on(self, full: _Open) -> None:
        """Ends a bag that has reached its maximum size and continues in a new bag."""
        *_, last = full.happenings
        until_ns = full.until_ns
        self.continued += 1
        self._end()
        try:
            bag = self._start(self._begin(last))
        except SloshBagError as error:
            self.failure = str(error)
            self._pending.append((self._now_ns, last))
            self._retry_ns = self._now_ns + RETRY_NS
            return
        self._lengthen(bag, last, until_ns - self._windows.after_ns)

    def _write(self, bag: _Open, message: Held) -> None:
        topic = message.topic
        kind, qos = self._topics[topic]
        if bag.types.get(topic) != kind:
            bag.types[topic] = kind
            bag.sink.add_topic(topic, kind, qos)
        bag.sink.add(topic, message.data, message.log_ns, message.publish_ns)
        bag.size += len(message.data) + OVERHEAD

    def _lengthen(self, bag: _Open, happening: Happening, at_ns: int) -> None:
        bag.until_ns = max(bag.until_ns, at_ns + self._windows.after_ns)
        if len(bag.happenings) >= TOLD and happening.cause in {
            one.cause for one in bag.happenings
        }:
            return
        bag.happenings.append(happening)
        document = [one.document() for one in bag.happenings]
        bag.sink.note(EVENTS, json.dumps(document, ensure_ascii=False))

    def _end(self) -> None:
        bag, self._open = self._open, None
        if bag is not None:
            bag.sink.close()
