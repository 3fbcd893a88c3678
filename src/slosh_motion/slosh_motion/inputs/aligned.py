"""Aligns streams of timed values, such as joints of several drivers, in time.

The moments are those of the slowest stream that moves: nothing is made up between its values. The
others are interpolated linearly there; what has not moved yet is held. Where all come in one
stream, or with the same stamps, nothing is interpolated at all. A stream that is too slow to be
integrated, such as a localisation's corrections, leads only where no faster one moves.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Mapping, Set
from typing import Generic, TypeVar

from slosh_base.files.nanoseconds import SECOND
from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.inputs.sampling import SECONDS_PER_NS
from slosh_motion.tuning import TUNING

Values = tuple[float, ...]
Mix = Callable[[Values, Values, float], Values]
"""Between two values, at a share of the way."""


Key = TypeVar("Key", bound=Hashable)


class Lead:
    """By how much the stamps of one publisher lie after the arrival of its messages.

    Attributes:
        ahead: on the average [s].
        first_ns, last_ns: its first and last stamp [ns].
    """

    def __init__(self) -> None:
        self.ahead, self._count = 0.0, 0
        self.first_ns = self.last_ns = 0
        self._is_stamp = True

    @property
    def interval_ns(self) -> float:
        """Mean time between two stamps [ns]."""
        return (self.last_ns - self.first_ns) / max(self._count - 1, 1)

    @property
    def is_blind(self) -> bool:
        """Whether all times of arrival are the stamps, as a converter writes them."""
        return self._count > 0 and self._is_stamp

    @property
    def is_known(self) -> bool:
        """Whether enough messages have come."""
        return self._count >= TUNING.first_states

    def take(self, stamp_ns: int, at_ns: int) -> None:
        """Adds a stamp and the moment of its arrival [ns]."""
        self.first_ns, self.last_ns = self.first_ns or stamp_ns, stamp_ns
        self._is_stamp &= stamp_ns == at_ns
        self._count += 1
        self.ahead += ((stamp_ns - at_ns) * SECONDS_PER_NS - self.ahead) / self._count


def clock_doubt(leads: Mapping[str, Lead]) -> Doubt | None:
    """Returns what the arrival of messages shows of their publishers' clocks.

    A message may be late, but cannot arrive before its stamp.
    """
    if len(leads) < 2:
        return None
    if all(lead.is_blind for lead in leads.values()):
        return _span_doubt(leads)
    clocks = [(lead.ahead, name) for name, lead in leads.items()]
    (least, late), (most, early) = min(clocks), max(clocks)
    if most - least < TUNING.clock_apart:
        return None
    if most > 0.5 * TUNING.clock_apart:
        return Doubt(
            f"{early} are stamped {1e3 * most:.0f} ms ahead of their arrival, and {late} "
            f"{1e3 * least:.0f} ms: the clocks of their publishers differ, and the motion is "
            "put together wrongly; synchronise them, or stamp with the time of measurement"
        )
    return Doubt(
        f"{late} arrive {-1e3 * least:.0f} ms after their stamps, and {early} "
        f"{abs(1e3 * most):.0f} ms: if that is no delay, their publishers' clocks differ",
        wrong=False,
    )


def _span_doubt(leads: Mapping[str, Lead]) -> Doubt | None:
    """Returns what the ends of a recording show of clocks, where log times are the stamps.

    All publishers were heard from its beginning to its end: whose clock is ahead begins and ends
    later than the others, by the same time.
    """
    (early, ahead), (late, behind) = (
        choose(leads.items(), key=lambda item: item[1].last_ns) for choose in (max, min)
    )
    begins, ends = ahead.first_ns - behind.first_ns, ahead.last_ns - behind.last_ns
    apart = min(begins, ends) * SECONDS_PER_NS
    # One that starts later and is heard longer begins and ends later, too, by other times.
    if apart < TUNING.clock_apart or abs(begins - ends) > ahead.interval_ns + behind.interval_ns:
        return None
    return Doubt(
        f"{early} begin and end {1e3 * apart:.0f} ms later than {late}, and the log times are the "
        "stamps: if both were recorded all the time, their publishers' clocks differ; compare "
        "with the original recording"
    )


class AlignedStreams(Generic[Key]):
    """Collects several streams of timed values and returns their values at common stamps.

    Args:
        is_complete: tells whether all streams have come.
    """

    def __init__(self, mix: Mix, is_complete: Callable[[], bool]) -> None:
        self._mix, self._is_complete = mix, is_complete
        self._streams: dict[Key, _Stream] = {}
        self._leads: dict[Key, Lead] = {}
        self._leader: _Stream | None = None

    @property
    def keys(self) -> Set[Key]:
        """Keys of the streams from which values were received."""
        return self._streams.keys()

    @property
    def moved(self) -> bool:
        """Whether any received value has ever changed."""
        return any(stream.moved for stream in self._streams.values())

    def silent(self) -> tuple[Key, float] | None:
        """Returns the stream that is furthest behind and its delay [s]; None if none is late."""
        if not self._streams:
            return None
        key, stream = min(self._streams.items(), key=lambda item: item[1].newest_ns)
        behind = max(one.newest_ns for one in self._streams.values()) - stream.newest_ns
        late = behind > TUNING.silent_ns + TUNING.silent_intervals * stream.interval_ns
        return (key, behind * SECONDS_PER_NS) if stream.moved and late else None

    def forget(self) -> None:
        """Discards the values of all streams."""
        self._streams.clear()
        self._leader = None

    def clocks(self, named: Callable[[Key], str]) -> dict[str, Lead]:
        """Returns by how much the stamps of streams that move lie after their arrival."""
        return {
            named(key): self._leads[key]
            for key, stream in self._streams.items()
            if key in self._leads and self._leads[key].is_known and stream.swift
        }

    def hear(self, key: Key, stamp_ns: int, at_ns: int) -> None:
        """Notes when a stream's message arrived, or was recorded, beside its stamp [ns]."""
        self._leads.setdefault(key, Lead()).take(stamp_ns, at_ns)

    def add(self, key: Key, stamp_ns: int, values: Values) -> None:
        """Adds a stream's values; clears all streams if time jumps.

        Args:
            stamp_ns: of the values [ns].
        """
        stream = self._streams.get(key)
        if stream is None:
            stream = self._streams[key] = _Stream(values)
        elif stream.newest_ns - stamp_ns > TUNING.set_back_ns:
            self.forget()
            self._leads.clear()
            stream = self._streams[key] = _Stream(values)
        stream.take(stamp_ns, values)

    def rows(self) -> list[tuple[int, dict[Key, Values]]]:
        """Returns stamps [ns] at which all streams have values, and those values by stream."""
        if not self._is_complete():
            return []
        leader = self._choose()
        others = [(k, s) for k, s in self._streams.items() if s is not leader]
        own = next(k for k, s in self._streams.items() if s is leader)
        found = []
        while leader.waiting:
            stamp_ns, values = leader.waiting[0]
            if any(stream.moved and stream.newest_ns < stamp_ns for _, stream in others):
                break
            leader.waiting.popleft()
            at = {key: stream.at(stamp_ns, self._mix) for key, stream in others}
            if all(at.values()):
                found.append((stamp_ns, {own: values, **at}))
        for _, stream in others:
            stream.waiting.clear()
        return found

    def _choose(self) -> _Stream:
        """Returns the slowest stream with changed values that is not too slow to lead."""
        streams = list(self._streams.values())
        moving = [stream for stream in streams if stream.moved] or streams
        fast = [stream for stream in moving if stream.interval_ns <= TUNING.leading_ns]
        moving = fast or moving
        slowest = max(moving, key=lambda stream: stream.interval_ns)
        leader = self._leader
        if leader not in moving or slowest.interval_ns > TUNING.slower * leader.interval_ns:
            leader = self._leader = slowest
        return leader


class _Stream:
    """The newest values of one stream, with their stamps, for interpolation.

    Attributes:
        newest_ns: stamp of the newest one [ns].
        interval_ns: usual time between two [ns]; 0: not known.
        moved: whether it has left its first values.
        swift: whether it moves fast enough for its publisher's clock to matter.
        waiting: stamps and values that have not led a row yet.
    """

    def __init__(self, values: Values) -> None:
        self.newest_ns = -(2**62)
        self.interval_ns = 0.0
        self.moved = False
        self.swift = False
        self.waiting: deque[tuple[int, Values]] = deque(maxlen=TUNING.kept_states)
        self._first = values
        self._since: tuple[int, Values] = (self.newest_ns, values)
        self._kept: deque[tuple[int, Values]] = deque(maxlen=TUNING.kept_states)

    def take(self, stamp_ns: int, values: Values) -> None:
        """Adds values with their stamp [ns]; ignores values not newer than those stored."""
        if stamp_ns <= self.newest_ns:
            return
        if self._kept:
            apart = stamp_ns - self.newest_ns
            share = 0.1 if self.interval_ns else 1.0
            self.interval_ns += share * (apart - self.interval_ns)
        self.newest_ns = stamp_ns
        self._kept.append((stamp_ns, values))
        self.waiting.append((stamp_ns, values))
        if not self.moved:
            self.moved = _change(values, self._first) > TUNING.moved
        if not self.swift:
            if stamp_ns - self._since[0] > SECOND:
                self._since = stamp_ns, values
            self.swift = _change(values, self._since[1]) > TUNING.clock_way

    def at(self, stamp_ns: int, mix: Mix) -> Values:
        """Interpolates the values at a stamp [ns]; empty before the first values."""
        after = self._kept[-1]
        if stamp_ns >= after[0]:
            return after[1]
        for before in reversed(self._kept):
            if before[0] == stamp_ns:
                return before[1]
            if before[0] < stamp_ns:
                share = (stamp_ns - before[0]) / (after[0] - before[0])
                return mix(before[1], after[1], share)
            after = before
        return ()


def _change(one: Values, other: Values) -> float:
    """Returns the largest difference between two values."""
    return max(abs(a - b) for a, b in zip(one, other, strict=True))
