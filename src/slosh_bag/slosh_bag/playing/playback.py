"""Schedules a bag's messages and /clock messages without reading any clock.

Bag time is the messages' log time [ns], wall time counts from the start of the playing [ns].
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, count
from typing import NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagMessage
from slosh_base.files.nanoseconds import SECOND

_LAST_SECOND = 2**31
RATES = (0.01, 1000.0)
CLOCK_RATES = (1.0, 10_000.0)
IDLE_PERIOD = 10_000_000  # ns of wall time; a pause in the messages is no pause of time
LEAD = 1_000_000  # ns of wall time that messages share one /clock message
GREATEST_LEAD = 10_000_000  # ns of bag time; nodes take it for the messages' age
_MOST_TOGETHER = 1000
_SHORTEST_PASS = 100_000_000  # ns of wall time; a single message is not repeated without end


@dataclass(frozen=True, slots=True)
class PlaybackSettings:
    """Settings for playing a bag: rate, range and loops.

    Attributes:
        rate: seconds of the bag per second.
        start: how far from the bag's beginning [s].
        duration: how much of it [s]; 0: to its end.
        loop: begin anew at the end, without end.
        clock_rate: /clock messages per second of wall time; 0: one for all messages of a
            millisecond, and a hundred per second where there are none.

    Raises:
        SloshBagError: a value does not fit.
    """

    rate: float = 1.0
    start: float = 0.0
    duration: float = 0.0
    loop: bool = False
    clock_rate: float = 0.0

    def __post_init__(self) -> None:
        low, high = RATES
        if not low <= self.rate <= high:
            raise SloshBagError(f"rate = {self.rate:g}: must lie in [{low:g}, {high:g}]")
        for name in ("start", "duration"):
            value = getattr(self, name)
            if not 0.0 <= value <= 1e9:
                raise SloshBagError(f"{name} = {value:g} s: must lie in [0, 1e9] s")
        low, high = CLOCK_RATES
        if self.clock_rate and not low <= self.clock_rate <= high:
            raise SloshBagError(
                f"clock = {self.clock_rate:g} Hz: must be 0 or lie in [{low:g}, {high:g}] Hz"
            )


class Step(NamedTuple):
    """A message or a /clock time to publish, and the time when it is due.

    Attributes:
        wall_ns: when.
        clock_ns: bag time: of the message, or what /clock is to say.
        message: what; None: /clock.
    """

    wall_ns: int
    clock_ns: int
    message: BagMessage | None = None


class Playback:
    """Assigns a publishing time to each message of a bag.

    /clock never goes back within a pass and is never earlier than a message that is out. It says
    the time of the last message among those that follow it within `LEAD`, so that a node spends
    its time on the messages and not on the clock.

    Args:
        span: bag time of the whole bag's first and last message [ns].
        settings: how it is played.
        latched: topics whose last messages from before the start still hold, and how many.

    Raises:
        SloshBagError: the start lies behind the bag's end, or the bag behind what ROS can say.

    Attributes:
        first_ns, last_ns: bag time at the start and at the end of a pass.
    """

    def __init__(
        self,
        span: tuple[int, int],
        settings: PlaybackSettings,
        latched: Mapping[str, int] | None = None,
    ) -> None:
        begin, end = span
        if end >= _LAST_SECOND * SECOND:
            raise SloshBagError(f"log time {end} ns: ROS times end in the year 2038")
        self.settings = settings
        self.first_ns = begin + round(settings.start * SECOND)
        if self.first_ns > end:
            raise SloshBagError(
                f"start = {settings.start:g} s: the bag ends after {(end - begin) / SECOND:.3f} s"
            )
        length = round(settings.duration * SECOND)
        self.last_ns = min(end, self.first_ns + length) if length else end
        self._latched = dict(latched or {})
        rate, clock = settings.rate, settings.clock_rate
        self._idle = max(1, round(rate * (SECOND / clock if clock else IDLE_PERIOD)))
        self._lead = self._idle if clock else min(round(rate * LEAD), GREATEST_LEAD)

    @property
    def length(self) -> float:
        """Duration of the played part of the bag, once through [s]."""
        return (self.last_ns - self.first_ns) / SECOND

    def steps(self, messages: Callable[[], Iterable[BagMessage]]) -> Iterator[Step]:
        """Yields all messages and clock times to publish, in order.

        Args:
            messages: gives the bag's messages in the order of their log times, anew for each
                pass.
        """
        pass_wall = max(round((self.last_ns - self.first_ns) / self.settings.rate), _SHORTEST_PASS)
        for number in count():
            yield from self._pass(messages(), number * pass_wall)
            if not self.settings.loop:
                return

    def _pass(self, messages: Iterable[BagMessage], begin_wall: int) -> Iterator[Step]:
        rate, first, clock = self.settings.rate, self.first_ns, self.first_ns

        def wall(bag_ns: int) -> int:
            return begin_wall + round((bag_ns - first) / rate)

        yield Step(begin_wall, clock)
        for group in self._groups(self._window(messages)):
            head, last = group[0][0], group[-1][0]
            while clock + self._idle < head:
                clock += self._idle
                yield Step(wall(clock), clock)
            if last > clock:
                clock = last
                yield Step(wall(head), clock)
            for time_ns, message in group:
                yield Step(wall(time_ns), time_ns, message)
        while clock < self.last_ns:
            clock = min(clock + self._idle, self.last_ns)
            yield Step(wall(clock), clock)

    def _window(self, messages: Iterable[BagMessage]) -> Iterator[tuple[int, BagMessage]]:
        """Yields the messages in the played time range, each with its due bag time [ns]."""
        held: dict[str, deque[BagMessage]] = {
            topic: deque(maxlen=depth) for topic, depth in self._latched.items()
        }
        rest = iter(messages)
        now = self.first_ns
        for message in rest:
            if message.log_ns >= now:
                rest = chain([message], rest)
                break
            if message.topic in held:
                held[message.topic].append(message)
        for early in sorted(chain(*held.values()), key=lambda message: message.log_ns):
            yield now, early
        for message in rest:
            # Files that follow each other may overlap a little: time still does not go back.
            now = max(now, message.log_ns)
            if now > self.last_ns:
                return
            yield now, message

    def _groups(
        self, messages: Iterable[tuple[int, BagMessage]]
    ) -> Iterator[list[tuple[int, BagMessage]]]:
        """Groups successive messages that share one /clock message."""
        group: list[tuple[int, BagMessage]] = []
        for item in messages:
            if group and (item[0] - group[0][0] >= self._lead or len(group) >= _MOST_TOGETHER):
                yield group
                group = []
            group.append(item)
        if group:
            yield group
