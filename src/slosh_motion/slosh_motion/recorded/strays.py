"""Detects messages with stamps out of sequence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Integers

Columns = Mapping[str, NDArray[Any]]

LASTING = 20
"""So many stamps in order before the newest one are no strays: time itself was set back."""


class StrayFilter:
    """Excludes single messages whose stamps are far ahead of their neighbours.

    Args:
        gap: so far ahead of the one before [ns].

    Attributes:
        count: messages that were set aside.
    """

    def __init__(self, gap: int) -> None:
        self.count = 0
        self._gap = gap
        self._before: int | None = None
        self._held: tuple[Integers, Columns] | None = None

    def add(self, stamps: Integers, columns: Columns) -> tuple[Integers, Columns]:
        """Adds consecutive messages; returns those that are known to be in sequence.

        One that may be astray waits for the next one, which tells.

        Args:
            stamps: (N,) [ns].
            columns: their fields, (N,) each.
        """
        if self._held is not None:
            stamps = np.concatenate((self._held[0], stamps))
            columns = {
                name: np.concatenate((self._held[1][name], c)) for name, c in columns.items()
            }
        kept = ~strays_ahead(stamps, self._gap, self._before)
        self.count += len(kept) - int(np.count_nonzero(kept))
        stamps, columns = stamps[kept], {name: c[kept] for name, c in columns.items()}
        decided = len(stamps) - self._is_open(stamps)
        self._held = None
        if decided < len(stamps):
            self._held = (stamps[decided:], {name: c[decided:] for name, c in columns.items()})
        if decided:
            self._before = int(stamps[decided - 1])
        return stamps[:decided], {name: c[:decided] for name, c in columns.items()}

    def _is_open(self, stamps: Integers) -> bool:
        """Returns whether the last stamp can only be judged with its successor."""
        before = stamps[-2] if len(stamps) > 1 else self._before
        return bool(len(stamps) and before is not None and stamps[-1] - before > self._gap)

    def rest(self) -> tuple[Integers, Columns]:
        """Returns the last message if its stamp could not be judged before; else no message."""
        held, self._held = self._held, None
        return held if held is not None else (np.empty(0, dtype=np.int64), {})


def strays_ahead(stamps: Integers, gap: int, before: int | None = None) -> NDArray[np.bool_]:
    """Returns a mask of stamps far ahead of both neighbours, between which there is no gap.

    Args:
        stamps: (N,) in the order in which they came [ns].
        gap: so far ahead of the one before them [ns].
        before: the stamp before the first; None: there is none.

    Returns:
        (N,); the last one is none, as what follows it is not known.
    """
    found = np.zeros(len(stamps), dtype=bool)
    around = stamps if before is None else np.concatenate(([before], stamps))
    left, own, right = around[:-2], around[1:-1], around[2:]
    shift = 1 if before is None else 0
    goes_on = (left < right) & (right - left <= gap)
    found[shift : shift + len(own)] = goes_on & (own > right) & (own - left > gap)
    return found


def set_backs(stamps: Iterable[int]) -> list[int]:
    """Returns the indices of stamps at which time was set back permanently.

    Args:
        stamps: in the order in which they came [ns].
    """
    found: list[int] = []
    newest: int | None = None
    early: int | None = None
    begin = count = 0
    for index, stamp in enumerate(stamps):
        if newest is None or stamp > newest:
            newest, early = stamp, None
            continue
        if early is None or stamp <= early:
            begin, count = index, 0
        early, count = stamp, count + 1
        if count >= LASTING:
            found.append(begin)
            newest, early = stamp, None
    return found
