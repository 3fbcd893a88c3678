"""What this process writes belongs to its user: nobody else may change it."""

from __future__ import annotations

import os
import stat

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def keep_others_from_writing() -> None:
    """Makes no file or folder from now on that group or others may write, whatever the umask.

    Holds for this process and those that it starts.
    """
    # There is no other way to ask for it than to set it.
    os.umask(os.umask(0o077) | OTHERS_WRITE)
