"""Opens each file of a bag once, for all parts of a reader."""

from __future__ import annotations

import io
import os
import weakref
from collections import deque
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, BinaryIO, cast

from slosh_bag.mcap_files.remote_path import RemotePath

_BUFFER = 1 << 16
_KEPT_OPEN = 8
"""Files of a bag that stay open between two readings; a split bag may have thousands."""


class SharedFile(type(Path())):  # type: ignore[misc]
    """A path whose streams share one open file but have their own positions.

    So all parts of a reader read the same file, even where its name is given to another one
    meanwhile.
    """

    _recent: deque[_Descriptor]
    _descriptor: weakref.ref[_Descriptor] | None = None

    def open(self, mode: str = "r", *others: Any, **named: Any) -> BinaryIO:
        """Returns a stream on the shared file in mode 'rb'; otherwise opens the file anew."""
        if mode != "rb" or others or named:
            return cast("BinaryIO", super().open(mode, *others, **named))
        descriptor = self._descriptor() if self._descriptor else None
        if descriptor is None:
            descriptor = _Descriptor(self)
            self._descriptor = weakref.ref(descriptor)
        if descriptor not in self._recent:
            self._recent.append(descriptor)
        return cast("BinaryIO", io.BufferedReader(_View(descriptor), _BUFFER))


def shared_files(paths: Iterable[Path]) -> Sequence[Path]:
    """Returns paths that share open files; they are closed with the last stream."""
    recent: deque[_Descriptor] = deque(maxlen=_KEPT_OPEN)
    files = [path if isinstance(path, RemotePath) else SharedFile(path) for path in paths]
    for file in files:
        if isinstance(file, SharedFile):
            file._recent = recent
    return files


class _Descriptor:
    """An open file descriptor that is closed when nothing refers to it any more."""

    def __init__(self, path: Path) -> None:
        self.number = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        weakref.finalize(self, os.close, self.number)


class _View(io.RawIOBase):
    """A read-only stream over a shared open file, with its own position."""

    def __init__(self, descriptor: _Descriptor) -> None:
        self._descriptor, self._at = descriptor, 0

    def readable(self) -> bool:
        """Returns True, since the stream can always be read."""
        return True

    def seekable(self) -> bool:
        """Returns True, since the position can always be set."""
        return True

    def tell(self) -> int:
        """Returns the stream's position [bytes]."""
        return self._at

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Sets the stream's position and returns it."""
        start = {
            os.SEEK_SET: 0,
            os.SEEK_CUR: self._at,
            os.SEEK_END: os.fstat(self._descriptor.number).st_size if whence == os.SEEK_END else 0,
        }[whence]
        if start + offset < 0:
            raise OSError(f"position {start + offset} lies before the file's start")
        self._at = start + offset
        return self._at

    def readinto(self, buffer: Any) -> int:
        """Fills a buffer from the stream and returns the number of bytes read."""
        count = os.preadv(self._descriptor.number, [buffer], self._at)
        self._at += count
        return count
