"""Monitors limits; a violation ends only after the value falls clearly below the limit."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_estimator.errors import SloshEstimatorError

LIMIT = "limit"
"""Name of a limit that was set."""


class Source(IntEnum):
    """Quantity that is compared with a limit; the values are those of LimitEvent.msg."""

    MEASURED = 0
    ESTIMATED = 1
    DISAGREEMENT = 2


class Kind(IntEnum):
    """Start or end of a limit violation; the values are those of LimitEvent.msg."""

    START = 0
    END = 1


@dataclass(frozen=True, slots=True)
class Event:
    """Event that reports the start or the end of a limit violation.

    Attributes:
        stamp_ns: moment of the crossing or the return [ns].
        id: number of the excess, given by the monitor.
        kind, source: see there.
        limit, peak: the limit and the largest value so far [m].
        peak_stamp_ns: moment of the largest value [ns].
        duration_ns: since the start of the excess [ns].
        description: one line.
    """

    stamp_ns: int
    id: int
    kind: Kind
    source: Source
    limit: float
    peak: float
    peak_stamp_ns: int
    duration_ns: int
    description: str


@dataclass(frozen=True, slots=True)
class Hysteresis:
    """Share of the limit that a value must fall below, and for how long, to end a violation.

    Attributes:
        release: share of the limit below which the value must fall.
        hold_ns: for how long it must stay there [ns].

    Raises:
        SloshEstimatorError: release is not in (0, 1], or the time negative.
    """

    release: float = 0.9
    hold_ns: int = 100_000_000

    def __post_init__(self) -> None:
        if not 0.0 < self.release <= 1.0:
            raise SloshEstimatorError(f"release = {self.release!r} must lie in (0, 1]")
        if self.hold_ns < 0:
            raise SloshEstimatorError(f"hold = {self.hold_ns!r} ns must not be negative")


class LimitChange(NamedTuple):
    """A limit [m] with its hysteresis, which applies to values after a stamp [ns].

    `name`: what it is: LIMIT, or that the container's rim limits.
    """

    stamp_ns: int
    limit: float
    hysteresis: Hysteresis
    name: str = LIMIT


class LimitTracker:
    """Compares one height with one limit, and reports start and end of a violation.

    Args:
        source: the quantity.
        limit: [m]; NaN or infinite: nothing is watched.
        hysteresis: how an excess ends.
        name: what the limit is: LIMIT, or that the container's rim limits.
    """

    def __init__(
        self, source: Source, limit: float, hysteresis: Hysteresis, name: str = LIMIT
    ) -> None:
        self.source = source
        self._name = name
        self.limit = _watched(limit)
        self.active = False
        self.identifier = 0
        self._hysteresis = hysteresis
        self._start_ns = self._peak_ns = 0
        self._peak = 0.0
        self._below_since_ns: int | None = None

    def update(self, stamp_ns: int, value: float) -> Event | None:
        """Checks a value [m], ignoring NaN, against the limit; returns the event it causes."""
        if math.isnan(value):
            return None
        if not self.active:
            return self._start(stamp_ns, value) if value > self.limit else None
        if value > self._peak:
            self._peak, self._peak_ns = value, stamp_ns
        if value > self.release_level:
            self._below_since_ns = None
            return None
        if self._below_since_ns is None:
            self._below_since_ns = stamp_ns
        if stamp_ns - self._below_since_ns < self._hysteresis.hold_ns:
            return None
        return self.close(self._below_since_ns, "back below the limit")

    def change(
        self, stamp_ns: int, limit: float, hysteresis: Hysteresis, name: str = LIMIT
    ) -> Event | None:
        """Sets a new limit for the next values and ends a violation of the old limit.

        Args:
            stamp_ns: the last moment that was judged by the old limit [ns].
            limit, hysteresis, name: as above.

        Returns:
            the end of the excess; None: there was none, or the limit is the same.
        """
        limit, self._hysteresis = _watched(limit), hysteresis
        if limit == self.limit:
            self._name = name
            return None
        event = self.close(max(stamp_ns, self._peak_ns), f"limit changed to {1e3 * limit:.1f} mm")
        self.limit, self._name = limit, name
        return event

    @property
    def at_rim(self) -> bool:
        """Whether the limit is the container's rim or a set distance below the rim."""
        return self._name != LIMIT

    @property
    def limit_text(self) -> str:
        """Name and value of the limit, as text for messages."""
        return f"{self._name} {1e3 * self.limit:.1f} mm"

    def ignores(self, values: Iterable[float]) -> bool:
        """Returns whether the next values [m] would neither start nor affect a violation."""
        return not self.active and not any(value > self.limit for value in values)

    def can_matter(
        self, stamps: NDArray[np.int64], values: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Returns a mask of values that can start, prolong or end a violation of the limit.

        Args:
            stamps: (N,) increasing [ns].
            values: (N,) [m].

        Returns:
            (N,) true for all that can start, prolong or end an excess.
        """
        count = len(stamps)
        if not count or (not self.active and math.isinf(self.limit)):
            return np.zeros(count, dtype=bool)
        high = ~(values <= self.release_level)
        index = np.arange(count)
        last_high = np.maximum.accumulate(np.where(high, index, -1))
        # The stamp from which the values have been low.
        since = stamps[np.minimum(last_high + 1, count - 1)]
        known = self._below_since_ns if self._below_since_ns is not None else int(stamps[0])
        since = np.where(last_high < 0, known, since)
        waiting = ~high & (stamps - since < self._hysteresis.hold_ns)
        waiting |= ~high & (index == last_high + 1)
        if not self.active:
            waiting &= last_high >= 0
        found: NDArray[np.bool_] = high | waiting
        found[1:] |= found[:-1].copy()  # the first value after the hold time ends the excess
        return found

    @property
    def release_level(self) -> float:
        """Value below which a limit violation can end [m]."""
        return self._hysteresis.release * self.limit

    def close(self, stamp_ns: int, reason: str) -> Event | None:
        """Ends a limit violation and returns its event, or None if there is no violation."""
        if not self.active:
            return None
        self.active = False
        seconds = (stamp_ns - self._start_ns) * 1e-9
        return self._event(stamp_ns, Kind.END, f"{reason} after {seconds:.2f} s")

    def _start(self, stamp_ns: int, value: float) -> Event:
        self.active = True
        self._start_ns = self._peak_ns = stamp_ns
        self._peak = value
        self._below_since_ns = None
        return self._event(stamp_ns, Kind.START, f"{1e3 * value:.1f} mm")

    def _event(self, stamp_ns: int, kind: Kind, remark: str) -> Event:
        name = {
            Source.MEASURED: "measured height",
            Source.ESTIMATED: "estimated height",
            Source.DISAGREEMENT: "measured and estimated height differ:",
        }[self.source]
        text = f"{name} {remark} ({self.limit_text}, peak {1e3 * self._peak:.1f} mm)"
        return Event(
            stamp_ns, self.identifier, kind, self.source, self.limit, self._peak, self._peak_ns,
            stamp_ns - self._start_ns, text,
        )  # fmt: skip


def _watched(limit: float) -> float:
    """Returns a quantity's limit [m], or infinity if the quantity is not monitored."""
    return limit if math.isfinite(limit) else math.inf
