"""Takes what an iterator gives in a thread of its own, some of it before it is needed.

Reading a chunk of a bag and decompressing it takes milliseconds: no message must wait for that.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import Generic, TypeVar

BATCH_LENGTH, BATCH_SIZE = 256, 2**20
BATCHES = 32
_POLL = 0.1  # s; how long the thread waits for room before it looks whether anyone still reads

Item = TypeVar("Item")


class ReadAhead(Generic[Item]):
    """An iterator over the same items in the same order; a context manager.

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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
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
        """False: nobody reads any more."""
        while not self._stop.is_set():
            try:
                self._queue.put(batch, timeout=_POLL)
            except queue.Full:
                continue
            return True
        return False
