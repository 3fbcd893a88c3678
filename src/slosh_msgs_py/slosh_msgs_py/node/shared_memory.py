"""Fast DDS's shared memory: whether this process hears others through it, and what is left over.

A process that starts in place of a killed one takes over its port. While the others still find
the dead port out, Fast DDS fails to open it, goes on without, and yet announces it: nobody reaches
the process any more, for as long as it lives. What is open tells: each process holds a lock file
of its own segment, and one of its port.

A killed process also leaves its segment behind, tens of megabytes of memory. Its lock is free
then, as the system lets go of it with the process.

One thing the system does not let go of: the mutex of a port, a semaphore by name. Whoever is
killed while holding it leaves it locked, and every later process that gets this port hangs in its
start for ever, where no signal reaches it.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path

_SEGMENT = re.compile(r"/fastrtps_[0-9a-f]{16}_el")
_PORT = re.compile(r"/fastrtps_port(\d+)_el")
_OWN_SEGMENT = re.compile(r"fastrtps_[0-9a-f]{16}")
_MUTEX = re.compile(r"sem\.fast\w+_port\d+_mutex")
_SAMPLE = 0.05  # s
_LONGEST_HELD = 3.0
"""A living process holds a port's mutex for microseconds; for a second where it waits for an
answer of whoever had the port before [s]."""
_YOUNG = 10.0
"""A segment is made before its lock is taken; one that is younger is left alone [s]."""
_FIRST_PORT = 7400
"""Of RTPS; those below serve all participants of the machine together."""


def is_deaf(open_files: Path = Path("/proc/self/fd")) -> bool:
    """True where shared memory is in use and its port is not open.

    Args:
        open_files: folder with a link to each open file; where there is none, nothing is known,
            and the answer is no.
    """
    try:
        links = [_target(link) for link in open_files.iterdir()]
    except OSError:
        return False
    in_use = any(_SEGMENT.search(link) for link in links)
    ports = [int(found[1]) for link in links if (found := _PORT.search(link))]
    return in_use and not any(port >= _FIRST_PORT for port in ports)


def remove_leftovers(folder: Path = Path("/dev/shm"), now: float | None = None) -> int:
    """Deletes the segments of this user's processes that are no more.

    Args:
        folder: where the segments are.
        now: the system's time [s].

    Returns:
        bytes that were freed.
    """
    old = (time.time() if now is None else now) - _YOUNG
    freed = 0
    for lock in folder.glob("fastrtps_*_el"):
        segment = lock.with_name(lock.name.removesuffix("_el"))
        with contextlib.suppress(OSError):  # in use, another's, or gone by now
            if _OWN_SEGMENT.fullmatch(segment.name) and lock.stat().st_mtime < old:
                freed += _remove_free(segment, lock)
    return freed


def free_dead_ports(folder: Path = Path("/dev/shm"), patience: float = _LONGEST_HELD) -> list[str]:
    """Deletes the ports that killed processes have left locked.

    Without such a one it takes milliseconds, with one `patience`. Whoever comes next makes the
    port anew. Of a port on which somebody alive listens only the mutex goes.

    Args:
        folder: where they are.
        patience: how long one has to stay locked to count as left [s].

    Returns:
        names of the ports.
    """
    locked = {path for path in folder.glob("sem.*_mutex") if _MUTEX.fullmatch(path.name)}
    deadline = time.monotonic() + patience
    while locked := {path for path in locked if _is_locked(path)}:
        if time.monotonic() >= deadline:
            break
        time.sleep(_SAMPLE)
    freed = []
    for path in sorted(locked):
        port = folder / path.name.removeprefix("sem.").removesuffix("_mutex")
        with contextlib.suppress(OSError):  # another's, or gone by now
            # Its own state is as locked as the mutex: who opened it would hang in there.
            if not _is_listened_to(port):
                port.unlink(missing_ok=True)
            path.unlink()
            freed.append(port.name)
    return freed


def _is_listened_to(port: Path) -> bool:
    """Whether a living process holds the lock of a port's listener."""
    try:
        with _held(port.with_name(f"{port.name}_el")):
            return False
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True


def _is_locked(mutex: Path) -> bool:
    """Whether a semaphore's count, the low half of its first eight bytes, is zero."""
    try:
        head = mutex.read_bytes()[:8]
    except OSError:
        return False
    return len(head) == 8 and int.from_bytes(head, sys.byteorder) & 0xFFFFFFFF == 0


def _remove_free(segment: Path, lock: Path) -> int:
    """Deletes a segment whose lock nobody holds; returns its size.

    Raises:
        OSError: somebody holds it, or it is not ours.
    """
    with _held(lock):
        size = segment.stat().st_size
        segment.unlink()
        lock.unlink()
    return size


@contextlib.contextmanager
def _held(lock: Path) -> Iterator[None]:
    """Holds a lock file.

    Raises:
        BlockingIOError: somebody else holds it.
        OSError: there is none, or it is not ours.
    """
    descriptor = os.open(lock, os.O_RDWR | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except OSError:  # the folder's own listing, closed by now
        return ""
