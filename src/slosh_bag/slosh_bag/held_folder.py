"""Marks the folder of a running recording, so that no other process writes in it or deletes it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from pathlib import Path
from typing import Final

from slosh_bag.errors import SloshBagError

PATIENCE: Final = 0.5
"""So long a recorder tries: `is_held` looks for a moment only [s]."""
_PAUSE = 0.01


class HeldFolder:
    """A lock on a folder that ends with `release`, or when the process ends for any reason.

    Args:
        folder: that exists; where the file system knows no locks it is not marked.

    Raises:
        SloshBagError: another recorder of this machine writes in it.
    """

    def __init__(self, folder: Path) -> None:
        self._number = -1
        with contextlib.suppress(OSError):
            self._number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            if not _locked(self._number):
                self.release()
                raise SloshBagError(
                    f"{folder}: another recorder writes in it; choose another folder, or stop "
                    "that one"
                )

    @classmethod
    def made(cls, folder: Path) -> HeldFolder:
        """Creates a folder if there is none, and locks it.

        Raises:
            SloshBagError: it cannot be made, or another recorder of this machine writes in it.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except FileExistsError:
            raise SloshBagError(
                f"{folder}: exists already; choose another folder or remove it"
            ) from None
        except OSError as error:
            raise SloshBagError(f"{folder}: {error.strerror}") from None
        return cls(folder)

    def release(self) -> None:
        """Releases the lock on the folder."""
        if self._number >= 0:
            os.close(self._number)
            self._number = -1


def _locked(number: int) -> bool:
    """Locks an open folder; returns whether nobody else holds it.

    Raises:
        OSError: the file system knows no locks.
    """
    end = time.monotonic() + PATIENCE
    while True:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > end:
                return False
            time.sleep(_PAUSE)
        else:
            return True


def is_held(folder: Path) -> bool:
    """Returns whether a recorder of this machine is writing to a folder."""
    try:
        number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(number, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(number)
    return False
