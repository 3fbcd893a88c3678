"""Selects a cell's bags to delete: bags that are too old, or that exceed a size quota.

Time is an argument: seconds since 1970, as the times of files.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Final, NamedTuple

from slosh_bag.errors import SloshBagError

DAY: Final = 86400.0
"""Length of a day [s]."""


class BagKind(Enum):
    """Kind of a stored bag: complete, of events only, or still being recorded."""

    COMPLETE = "complete"
    EVENT = "event"
    RUNNING = "running"


class StoredBag(NamedTuple):
    """A bag in the folder of a cell's runs, with its age and size.

    Attributes:
        folder: of the bag.
        written: when its newest file was last written [s since 1970].
        size: of its files [bytes].
        kind: RUNNING: a recorder is writing to it.
    """

    folder: Path
    written: float
    size: int
    kind: BagKind


@dataclass(frozen=True, slots=True)
class Retention:
    """Limits of total size and age beyond which a cell's bags are deleted.

    Attributes:
        quota: total size of the bags [bytes]; 0: no limit.
        days: age from which complete bags are deleted [day]; 0: no limit.
        event_days: the same for event bags [day]; 0: no limit.

    Raises:
        SloshBagError: a limit is negative, or event bags would be kept for less time.
    """

    quota: int = 0
    days: float = 0.0
    event_days: float = 0.0

    def __post_init__(self) -> None:
        for name in ("quota", "days", "event_days"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise SloshBagError(f"{name} = {getattr(self, name)!r} must not be negative")
        if self.event_days and not 0.0 < self.days <= self.event_days:
            raise SloshBagError(
                f"event_days = {self.event_days:g} must not be less than days = {self.days:g}: "
                "event bags are kept longer"
            )

    @property
    def is_limited(self) -> bool:
        """Whether any limit is set, so that bags can be deleted."""
        return bool(self.quota or self.days or self.event_days)


class Surplus(NamedTuple):
    """The bags to delete, and by how much the remaining bags still exceed the quota [bytes].

    Attributes:
        bags: those to delete, in this order.
        excess: size by which the rest still exceeds the quota [bytes].
    """

    bags: tuple[StoredBag, ...]
    excess: int


def surplus(bags: Sequence[StoredBag], retention: Retention, now: float) -> Surplus:
    """Selects the bags to delete because of their age or their total size.

    First those that are too old, then, as long as the rest exceeds the quota, the oldest complete
    bags, and only then the oldest event bags. A running one is never selected.

    Args:
        bags: in any order.
        retention: how much is kept.
        now: the time [s since 1970].
    """
    limits = {
        BagKind.COMPLETE: DAY * retention.days or math.inf,
        BagKind.EVENT: DAY * retention.event_days or math.inf,
        BagKind.RUNNING: math.inf,
    }
    order = (BagKind.COMPLETE, BagKind.EVENT)
    oldest_first = sorted(
        (bag for bag in bags if bag.kind in order),
        key=lambda bag: (order.index(bag.kind), bag.written, bag.folder),
    )
    chosen = [bag for bag in oldest_first if now - bag.written > limits[bag.kind]]
    size = sum(bag.size for bag in bags) - sum(bag.size for bag in chosen)
    quota = retention.quota or math.inf
    for bag in oldest_first:
        if size > quota and bag not in chosen:
            chosen.append(bag)
            size -= bag.size
    return Surplus(tuple(chosen), max(0, size - retention.quota) if retention.quota else 0)
