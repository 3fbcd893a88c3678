"""Lock files as Fast DDS has them: whoever owns something holds its file alone while it lives."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def held(lock: Path) -> Iterator[None]:
    """Holds a lock file alone.

    Raises:
        BlockingIOError: somebody else holds it.
        OSError: there is none, or it is not ours.
    """
    descriptor = _locked(lock, os.O_RDWR, fcntl.LOCK_EX)
    try:
        yield
    finally:
        os.close(descriptor)


def shared(lock: Path, *, make: bool = True) -> int:
    """Holds a lock file together with others.

    Args:
        lock: its path.
        make: make it where there is none.

    Returns:
        the file's descriptor: the lock is held until it is closed.

    Raises:
        BlockingIOError: somebody holds it alone.
        OSError: there is none, or it is not ours.
    """
    return _locked(lock, os.O_RDWR | (os.O_CREAT if make else 0), fcntl.LOCK_SH)


def is_alone(descriptor: int) -> bool:
    """Whether nobody else holds the lock file that this one shares; then it is held alone."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _locked(lock: Path, flags: int, how: int) -> int:
    """The descriptor of a file that is locked now; it does not wait."""
    descriptor = os.open(lock, flags | os.O_CLOEXEC, 0o666)
    try:
        fcntl.flock(descriptor, how | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor
