"""Merges the messages of overlapping chunks in the order of their log times."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunks import (
    RECORD_HEADER,
    Chunk,
    DamageError,
    read_loose,
    whole_chunk,
)
from slosh_bag.unpacking import MOST_UNPACKED


class ChunkSpan(NamedTuple):
    """Position, size and start time of a chunk in a file.

    Attributes:
        start_ns: least log time in it [ns].
        position, stored: where it begins in the file, and how many bytes it takes.
    """

    start_ns: int
    position: int
    stored: int


def in_log_order(
    path: Path, spans: list[ChunkSpan], select: Callable[[Chunk], Chunk]
) -> Iterator[tuple[Chunk, int]]:
    """Yields the messages of a file by log time, then by position in the file.

    A chunk is unpacked when its time has come, and forgotten after its last message: memory is
    that of the chunks that overlap.

    Args:
        path: the file.
        spans: its chunks.
        select: what is wanted of a chunk.

    Yields:
        A chunk, and the index of the next message in it.

    Raises:
        SloshBagError: the file is no longer what it was.
    """
    waiting = sorted(spans, reverse=True)
    heap: list[tuple[int, int, int, Chunk]] = []
    open_bytes = 0
    with path.open("rb") as stream:
        while waiting or heap:
            while waiting and (not heap or waiting[-1].start_ns <= heap[0][0]):
                span = waiting.pop()
                stream.seek(span.position)
                chunk = select(_again(path, span, stream.read(span.stored)))
                if len(chunk):
                    open_bytes += len(chunk.raw)
                    if open_bytes > MOST_UNPACKED:
                        raise SloshBagError(
                            f"{path}: chunks of more than {MOST_UNPACKED} bytes cover the time "
                            f"{span.start_ns * 1e-9:.3f} s; sort its messages by time first"
                        )
                    heapq.heappush(heap, (int(chunk.log_ns[0]), chunk.position, 0, chunk))
            if not heap:
                continue
            _, position, row, chunk = heapq.heappop(heap)
            yield chunk, row
            if row + 1 < len(chunk):
                heapq.heappush(heap, (int(chunk.log_ns[row + 1]), position, row + 1, chunk))
            else:
                open_bytes -= len(chunk.raw)


def gathered(rows: Sequence[tuple[Chunk, int]]) -> Chunk:
    """Combines messages of several chunks to one chunk, in the given order.

    Args:
        rows: chunks, and the index of a message in each; at least one.
    """
    data = [
        chunk.raw[int(chunk.start[row]) : int(chunk.start[row]) + int(chunk.length[row])]
        for chunk, row in rows
    ]
    length = np.array([len(one) for one in data], dtype=np.int64)
    columns = (
        np.array([getattr(chunk, name)[row] for chunk, row in rows], dtype=np.int64)
        for name in ("channel", "log_ns", "publish_ns")
    )
    channel, log_ns, publish_ns = columns
    first = rows[0][0]
    return Chunk(
        first.position, 0, b"".join(data), channel, log_ns, publish_ns,
        np.cumsum(length) - length, length, (), (), checked=first.checked,
    )  # fmt: skip


def _again(path: Path, span: ChunkSpan, content: bytes) -> Chunk:
    """Reads a chunk again and checks that it has not changed since it was first read."""
    try:
        if content[:1] != b"\x06":
            return read_loose(span.position, content)
        return whole_chunk(span.position, content[RECORD_HEADER:])
    except DamageError:
        raise SloshBagError(f"{path}: changed while it was read") from None
