"""Checks whether Fast DDS's shared memory reaches this process, and removes leftovers.

A process that starts in place of a killed one takes over its port. While the others still find
the dead port out, Fast DDS fails to open it, goes on without, and yet announces it: nobody reaches
the process any more, for as long as it lives. What is open tells: each process holds a lock file
of its own segment, and one of its port. And a process that stood still for seconds passes for
dead: where its port was made anew meanwhile, others write to memory that it does not read.

A killed process also leaves its segment behind, tens of megabytes of memory. Its lock is free
then, as the system lets go of it with the process.

What killed processes leave of their ports is told in `dead_ports`.
"""

from __future__ import annotations

import contextlib
import os
import re
import time
from collections.abc import Collection
from pathlib import Path

from slosh_msgs_py.node.dead_ports import held, held_dead_ports, mapped_ports

_SEGMENT = re.compile(r"/fastrtps_[0-9a-f]{16}_el")
_PORT = re.compile(r"(.*/fastrtps_port(\d+))_el")
_OWN_SEGMENT = re.compile(r"fastrtps_[0-9a-f]{16}")
_YOUNG = 10.0
"""A segment is made before its lock is taken; one that is younger is left alone [s]."""
_FIRST_PORT = 7400
"""Of RTPS; those below serve all participants of the machine together."""


def is_deaf(process: Path = Path("/proc/self"), of_others: Collection[str] | None = None) -> bool:
    """Whether this process cannot receive messages over its shared-memory port.

    Args:
        process: folder with `fd`, a folder with a link to each open file, and `maps`, the memory
            of files; where they are not, nothing is known, and the answer is no.
        of_others: names of ports that are held for dead processes; None: as this process does.
    """
    others = held_dead_ports() if of_others is None else of_others
    try:
        links = [_target(link) for link in (process / "fd").iterdir()]
        mapped = {number for number, _ in mapped_ports(process / "maps")}
    except OSError:
        return False
    in_use = any(_SEGMENT.search(link) for link in links)
    locks = [match for link in links if (match := _PORT.fullmatch(link))]
    own = [match for match in locks if int(match[2]) >= _FIRST_PORT]
    return in_use and not any(
        Path(match[1]).name not in others and _number(Path(match[1])) in mapped for match in own
    )


def remove_leftovers(folder: Path = Path("/dev/shm"), now: float | None = None) -> int:
    """Deletes shared-memory segments of this user's ended processes.

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


def _remove_free(segment: Path, lock: Path) -> int:
    """Deletes a shared-memory segment whose lock is free; returns its size [bytes].

    Raises:
        OSError: somebody holds it, or it is not ours.
    """
    with held(lock):
        size = segment.stat().st_size
        segment.unlink()
        lock.unlink()
    return size


def _number(port: Path) -> int:
    """Returns the inode number of a port's file, or -1 if there is none."""
    try:
        return port.stat().st_ino
    except OSError:
        return -1


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except OSError:  # the folder's own listing, closed by now
        return ""
