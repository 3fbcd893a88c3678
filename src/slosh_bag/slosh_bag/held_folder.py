"""Marks the folder of a running recording, so that no other process deletes it."""

from __future__ import annotations

import contextlib
import fcntl
import os
from pathlib import Path


class HeldFolder:
    """A lock on a folder that ends with `release`, or when the process ends for any reason.

    Args:
        folder: that exists; where the file system knows no locks it is not marked.
    """

    def __init__(self, folder: Path) -> None:
        self._number = -1
        with contextlib.suppress(OSError):
            self._number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            fcntl.flock(self._number, fcntl.LOCK_SH)  # `is_held` looks for a moment only

    def release(self) -> None:
        """Releases the lock on the folder."""
        if self._number >= 0:
            os.close(self._number)
            self._number = -1


def is_held(folder: Path) -> bool:
    """Returns whether a recorder of this machine is writing to a folder."""
    try:
        number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(number)
    return False
