"""Fast DDS's shared memory: whether this process hears others through it, and what is left over.

A process that starts in place of a killed one takes over its port. While the others still find
the dead port out, Fast DDS fails to open it, goes on without, and yet announces it: nobody reaches
the process any more, for as long as it lives. What is open tells: each process holds a lock file
of its own segment, and one of its port.

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

from slosh_msgs_py.node.dead_ports import held_dead_ports
from slosh_msgs_py.node.lock_files import held

_SEGMENT = re.compile(r"/fastrtps_[0-9a-f]{16}_el")
_PORT = re.compile(r"/(fastrtps_port(\d+))_el")
_OWN_SEGMENT = re.compile(r"fastrtps_[0-9a-f]{16}")
_YOUNG = 10.0
"""A segment is made before its lock is taken; one that is younger is left alone [s]."""
_FIRST_PORT = 7400
"""Of RTPS; those below serve all participants of the machine together."""


def is_deaf(
    open_files: Path = Path("/proc/self/fd"), of_others: Collection[str] | None = None
) -> bool:
    """True where shared memory is in use and its port is not open.

    Args:
        open_files: folder with a link to each open file; where there is none, nothing is known,
            and the answer is no.
        of_others: names of ports that are held for dead processes; None: as this process does.
    """
    others = held_dead_ports() if of_others is None else of_others
    try:
        links = [_target(link) for link in open_files.iterdir()]
    except OSError:
        return False
    in_use = any(_SEGMENT.search(link) for link in links)
    found = [match for link in links if (match := _PORT.search(link))]
    own = [int(match[2]) for match in found if match[1] not in others]
    return in_use and not any(port >= _FIRST_PORT for port in own)


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


def _remove_free(segment: Path, lock: Path) -> int:
    """Deletes a segment whose lock nobody holds; returns its size.

    Raises:
        OSError: somebody holds it, or it is not ours.
    """
    with held(lock):
        size = segment.stat().st_size
        segment.unlink()
        lock.unlink()
    return size


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except OSError:  # the folder's own listing, closed by now
        return ""
