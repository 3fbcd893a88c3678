"""Whether this process hears others through Fast DDS's shared memory.

A process that starts in place of a killed one takes over its port. While the others still find
the dead port out, Fast DDS fails to open it, goes on without, and yet announces it: nobody reaches
the process any more, for as long as it lives. What is open tells: each process holds a lock file
of its own segment, and one of its port.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

_SEGMENT = re.compile(r"/fastrtps_[0-9a-f]{16}_el")
_PORT = re.compile(r"/fastrtps_port(\d+)_el")
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


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except OSError:  # the folder's own listing, closed by now
        return ""
