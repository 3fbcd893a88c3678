"""Groups many items into tasks of about equal duration, which become shorter at the end.

A scheduler takes some milliseconds for a task, however short it is. So a task gets as many items
as take TASK_SECONDS, by the time that the tasks before it have taken, but no more than a share of
what is left: towards the end tasks become smaller, and no worker waits long for another one's last
task (guided self-scheduling: Polychronopoulos, Kuck, IEEE Trans. Comput. C-36, 1987).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Final, Generic, TypeVar

Item = TypeVar("Item")

TASK_SECONDS: Final = 0.5
"""Aimed duration of a task [s]: some hundred times what a scheduler takes for it."""
SHARES: Final = 4
"""A task gets at most this part of what is left, divided by the number of workers."""
REMEMBERED: Final = 0.5
"""Weight of what was known of the items' duration before, against the last task."""


class Batches(Generic[Item]):
    """Groups items, in order, into tasks for the workers of a cluster.

    Args:
        items: all items.
        sizes: size of each item in any one unit, which its duration grows with; None: one item
            is a task.
    """

    def __init__(self, items: Iterable[Item], sizes: Sequence[float] | None = None) -> None:
        self._numbered: Iterator[tuple[int, Item]] = iter(enumerate(items))
        self._weights = None if sizes is None else _weights(sizes)
        self._left = sum(self._weights or ())
        self._seconds: float | None = None  # of an item of weight 1

    def take(self, workers: int) -> list[tuple[int, Item]]:
        """Returns the numbered items of the next task; empty if no items are left.

        Args:
            workers: number of workers that share what is left.
        """
        batch = list(islice(self._numbered, 1))
        if self._weights is None or not batch:
            return batch
        share = self._left / (SHARES * workers)
        aim = TASK_SECONDS / self._seconds if self._seconds else 0.0
        weight, index = self._weights[batch[0][0]], batch[0][0] + 1
        while index < len(self._weights) and weight + self._weights[index] <= min(aim, share):
            batch += islice(self._numbered, 1)
            weight, index = weight + self._weights[index], index + 1
        self._left -= weight
        return batch

    def learn(self, batch: Sequence[tuple[int, Item]], seconds: float) -> None:
        """Updates the expected duration of an item from a finished task.

        Args:
            batch: its items.
            seconds: duration without the time of the scheduler [s].
        """
        if self._weights is None:
            return
        last = seconds / sum(self._weights[index] for index, _ in batch)
        known = last if self._seconds is None else self._seconds
        self._seconds = REMEMBERED * known + (1.0 - REMEMBERED) * last


def _weights(sizes: Sequence[float]) -> list[float]:
    """Returns the items' expected durations relative to their mean, from their sizes."""
    mean = sum(sizes) / len(sizes) if sizes else 0.0
    return [0.5 + 0.5 * size / mean if mean else 1.0 for size in sizes]
