"""Works around Fast DDS reusing shared-memory ports of killed processes.

Whoever wrote to a killed process goes on writing into its port's memory until somebody finds out,
which takes as many seconds as there are processes, and never happens where it was killed between
two messages. A process that takes the port over hears nothing of them meanwhile. Where it was
killed in the midst of a message, those who find out take turns for ever at clearing it up, and
write no more at all, to nobody. They clear nothing up whose lock somebody holds: so the lock of a
dead port is held for as long as anybody has the port open. Then nobody takes it over, either. And
whoever knows of a kill closes the port: writers that look for one which does not answer wait a
second for it, and publish nothing meanwhile; what tells that it is broken they leave at once.
Those that have it open find in it that it is one no more. What they wrote to the dead stays in
their own memory until this is full: each of their messages costs a look at all of it, and between
what is left there a large one, an image, may find no place for a minute.
Such a mark also stands wherever a lock is held and the name is gone: who starts would tell of it
on standard output.

Another thing that is left is the port's mutex, a semaphore by name, which the system does not let
go of with the process. Every later process that gets this port would hang in its start for ever,
where no signal reaches it.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

_PORT = re.compile(r"fast\w+_port\d+")
_MUTEX = re.compile(r"sem\.fast\w+_port\d+_mutex")
_MAPPED = re.compile(r"(\d+) +[^ ]*/(fastrtps_port\d+)(?: \(deleted\))?$")
_SAMPLE = 0.05  # s
_LONGEST_HELD = 3.0
"""A living process holds a port's mutex for microseconds; for a second where it waits for an
answer of whoever had the port before [s]."""
_YOUNG = 2.0
"""A process that starts makes its port first, and takes its lock then [s]."""
_MOST = 64
"""Fast DDS tries a hundred ports, one after the other, and a domain has little more."""
_START = 60.0
"""A process that starts has found its own ports by then, also on a busy machine [s]."""
_BROKEN = (3).to_bytes(4, sys.byteorder) + bytes(4092)
"""A segment begins with its state; this one says that it could not be made, and nobody waits."""
_NUMBER_AT, _FLAGS_AT, _FLAGS, _IS_PORT = 276, 300, 0b111, 0b001
"""Where a port's memory has its number, four bytes, and a byte of flags, one of which says that it
is one; of Fast DDS 2.14, and checked."""
_FORGOTTEN = 30.0
"""Writers open a dead port now and then until they take its reader for gone, after 20 s [s]."""


class DeadPorts:
    """Locks the shared-memory ports of killed processes, so that they are not reused.

    Any number of processes may do so. It takes two hundredths of a second to look: nothing for a
    process that has to keep pace, once it does.

    Args:
        folder: where the ports are.
        processes: folder with a folder for each process.

    Attributes:
        names: of the ports that are held, in order.
    """

    def __init__(self, folder: Path = Path("/dev/shm"), processes: Path = Path("/proc")) -> None:
        self._folder, self._processes = folder, processes
        self._held: dict[str, int] = {}
        self._seen: dict[str, float] = {}
        self._lock = threading.Lock()
        self.names: tuple[str, ...] = ()

    def look(self, now: float | None = None, *, close: bool = False) -> tuple[str, ...]:
        """Reserves ports of recently killed processes; releases those that are no longer in use.

        Args:
            now: steady time [s].
            close: somebody has just been killed: close those that are new.

        Returns:
            names of the ports that are held.
        """
        now = time.monotonic() if now is None else now
        with self._lock:
            used = _ports_in_use(self._processes)
            self._seen.update(dict.fromkeys(used, now))
            for port in [port for port in self._held if now - self._seen[port] > _FORGOTTEN]:
                self._release(port)
            for port in sorted(used - self._held.keys()):
                if len(self._held) < _MOST and not self._is_for_all(port):
                    with contextlib.suppress(OSError):  # somebody listens, or it is another's
                        self._hold(port, close)
            self.names = tuple(sorted(self._held))
            return self.names

    def _hold(self, port: str, close: bool) -> None:
        """Locks a killed process's port; raises OSError if the port is in use."""
        path, lock = self._folder / port, self._folder / f"{port}_el"
        if _is_gone(path):
            self._held[port] = shared(lock)
            self._mark(path)
        elif close or not _is_young(path):
            self._held[port] = shared(lock, make=False)
            if close:
                self._mark(path, in_place=True)

    def _mark(self, path: Path, *, in_place: bool = False) -> None:
        """Marks a shared-memory port as closed for the processes that still write to it."""
        if in_place:
            _turn_away(path)
        aside = path.with_name(f"{path.name}_closed_{os.getpid()}")
        aside.write_bytes(_BROKEN)
        if in_place:
            aside.replace(path)
            return
        with contextlib.suppress(FileExistsError):
            os.link(aside, path)
        aside.unlink()

    def _release(self, port: str) -> None:
        """Releases a port, which becomes available if no other process holds it."""
        descriptor = self._held.pop(port)
        if is_alone(descriptor):
            path = self._folder / port
            if _is_closed(path):
                path.unlink(missing_ok=True)
        os.close(descriptor)

    def _is_for_all(self, port: str) -> bool:
        """Whether several processes may listen on a port, so that it must not be locked."""
        return (self._folder / f"{port}_sl").exists()

    def close(self) -> None:
        """Releases all shared-memory ports that this object has locked."""
        with self._lock:
            for port in list(self._held):
                self._release(port)
            self.names = ()


_AT_START = DeadPorts()


def hold_dead_ports() -> None:
    """Locks the ports of killed processes while this process starts, and a minute longer.

    To be called before it opens a port of its own. Who looks after the killed process holds its
    ports for longer.
    """
    _AT_START.look()
    letting_go = threading.Timer(_START, _AT_START.close)
    letting_go.daemon = True
    letting_go.start()


def held_dead_ports() -> tuple[str, ...]:
    """Returns the names of the shared-memory ports that this process locks at its start."""
    return _AT_START.names


def free_dead_ports(folder: Path = Path("/dev/shm"), patience: float = _LONGEST_HELD) -> list[str]:
    """Deletes shared-memory ports that killed processes have left behind.

    Without a locked one it takes milliseconds, with one `patience`. Whoever comes next makes the
    port anew. Of a port on which somebody alive listens only the mutex goes.

    Args:
        folder: where they are.
        patience: how long one has to stay locked to count as left [s].

    Returns:
        names of the ports.
    """
    for port in folder.glob("fast*_port*"):
        with contextlib.suppress(OSError):  # another's, or gone by now
            if _PORT.fullmatch(port.name) and _is_closed(port) and not _is_listened_to(port):
                port.unlink()
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
    """Whether a running process holds the lock of a port's listener."""
    try:
        with held(port.with_name(f"{port.name}_el")):
            return False
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True


def _turn_away(port: Path) -> None:
    """Marks an open port as closed in its shared memory."""
    with contextlib.suppress(OSError), port.open("r+b", buffering=0) as memory:
        head = memory.read(_FLAGS_AT + 1)
        number = int(port.name.rpartition("port")[2]).to_bytes(4, sys.byteorder)
        known = len(head) > _FLAGS_AT and head[_NUMBER_AT : _NUMBER_AT + 4] == number
        if known and head[_FLAGS_AT] | _FLAGS == _FLAGS:
            memory.seek(_FLAGS_AT)
            memory.write(bytes([head[_FLAGS_AT] & ~_IS_PORT]))


def _is_gone(port: Path) -> bool:
    """Whether a port's file is missing or has been marked as closed."""
    return not port.exists() or _is_closed(port)


def _is_young(port: Path) -> bool:
    """Whether a port is so new that its owner may not have locked it yet."""
    return time.time() - port.stat().st_mtime < _YOUNG


def _is_closed(port: Path) -> bool:
    """Whether a port's file has been marked as closed."""
    try:
        return port.stat().st_size == len(_BROKEN) and port.read_bytes() == _BROKEN
    except OSError:  # gone, or another's
        return False


def _is_locked(mutex: Path) -> bool:
    """Whether a semaphore is locked, i.e. its count is zero."""
    try:
        head = mutex.read_bytes()[:8]
    except OSError:
        return False
    return len(head) == 8 and int.from_bytes(head, sys.byteorder) & 0xFFFFFFFF == 0


def mapped_ports(maps: Path) -> set[tuple[int, str]]:
    """Returns number and name of the port files that a process has mapped.

    Args:
        maps: the process's list of its memory.

    Raises:
        OSError: it is another's, or it has ended.
    """
    text = maps.read_text(errors="replace")
    # Of a thousand lines a dozen are of ports: to search them all takes five times as long.
    of_ports = [line for line in text.split("\n") if "/fastrtps_port" in line]
    found = filter(None, map(_MAPPED.search, of_ports))
    return {(int(match[1]), match[2]) for match in found}


def _ports_in_use(processes: Path) -> set[str]:
    """Returns the names of the ports that this user's processes have mapped."""
    ports: set[str] = set()
    for maps in processes.glob("[0-9]*/maps"):
        with contextlib.suppress(OSError):
            ports.update(name for _, name in mapped_ports(maps))
    return ports


@contextlib.contextmanager
def held(lock: Path) -> Iterator[None]:
    """Locks a file exclusively within a `with` block.

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
    """Takes a shared lock on a file and returns its descriptor.

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
    """Makes a file's shared lock exclusive; returns False if another process shares it."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _locked(lock: Path, flags: int, how: int) -> int:
    """Locks a file without waiting; returns its descriptor."""
    descriptor = os.open(lock, flags | os.O_CLOEXEC, 0o666)
    try:
        fcntl.flock(descriptor, how | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor
