"""Buffer of recent messages, limited in time and memory, which keeps latched messages."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterator
from typing import Final, NamedTuple

OVERHEAD: Final = 300
"""What a message takes in memory beside its data [bytes]."""
STANDING: Final = 1000
"""Messages of earlier that hold on, of one topic at most."""


class Place(NamedTuple):
    """Key by which a new latched message replaces earlier ones.

    Attributes:
        key: a later message of the same key takes its place.
        level: and that of those with a higher level: a start that of earlier changes.
    """

    key: Hashable
    level: int = 0


class Held(NamedTuple):
    """A message held in memory, with its topic and times.

    Attributes:
        topic: its topic.
        data: CDR bytes.
        log_ns: when it was received [ns].
        publish_ns: when it was sent [ns]; None: unknown.
        at_ns: the black box's own time, which never goes back [ns].
    """

    topic: str
    data: bytes
    log_ns: int
    publish_ns: int | None
    at_ns: int

    @property
    def size(self) -> int:
        """Memory used by the message [bytes]."""
        return len(self.data) + OVERHEAD


class Ring:
    """Buffer of the newest messages of all topics, in the order of arrival.

    Of latched topics, what leaves the ring is kept until a later message takes its place: a bag
    that begins in the middle of a run needs it.

    Args:
        span_ns: messages older than this leave [ns].
        memory: so many bytes at most.
        most: so many messages at most.
        place: of a message, by its topic and data; None: it stands for nothing later.

    Attributes:
        size: bytes that the messages take.
        is_short: whether memory, not time, bounds it.
    """

    def __init__(
        self,
        span_ns: int,
        memory: int,
        most: int,
        place: Callable[[str, bytes], Place | None],
    ) -> None:
        self._span_ns, self._memory, self._most = span_ns, memory, most
        self._place = place
        self._messages: deque[Held] = deque()
        self._standing: dict[str, dict[Place, Held]] = {}
        self.size = 0
        self.is_short = False

    def __len__(self) -> int:
        return len(self._messages)

    def __iter__(self) -> Iterator[Held]:
        """Yields all buffered messages, oldest first."""
        return iter(self._messages)

    @property
    def begin_ns(self) -> int | None:
        """Arrival time of the oldest buffered message [ns], or None if the buffer is empty."""
        return self._messages[0].at_ns if self._messages else None

    def standing(self) -> list[Held]:
        """Returns latched messages that left the buffer but are still valid, oldest first."""
        held = [message for places in self._standing.values() for message in places.values()]
        return sorted(held, key=lambda message: message.at_ns)

    def add(self, message: Held) -> None:
        """Adds a message and removes old messages beyond the limits."""
        self._messages.append(message)
        self.size += message.size
        self.trim(message.at_ns)

    def trim(self, now_ns: int) -> None:
        """Removes messages that are too old at a time [ns] or exceed the memory limit."""
        oldest_ns = now_ns - self._span_ns
        while self._messages:
            too_old = self._messages[0].at_ns < oldest_ns
            too_much = self.size > self._memory or len(self._messages) > self._most
            if not too_old and not too_much:
                return
            self.is_short = not too_old
            self._leave(self._messages.popleft())

    def forget(self, topic: str) -> None:
        """Removes all messages of a topic, because its type has changed."""
        self._messages = deque(held for held in self._messages if held.topic != topic)
        self._standing.pop(topic, None)
        self.size = sum(message.size for message in self._messages)

    def _leave(self, message: Held) -> None:
        self.size -= message.size
        place = self._place(message.topic, message.data)
        if place is None:
            return
        standing = self._standing.get(message.topic, {})
        replaced = [one for one in standing if one.key == place.key and one.level >= place.level]
        for one in replaced:
            del standing[one]
        standing[place] = message
        if len(standing) > STANDING:
            del standing[next(iter(standing))]
        self._standing[message.topic] = standing
