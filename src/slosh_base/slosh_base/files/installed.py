"""Finds installed files of the packages other than modules."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def shared_folder(package: str) -> Path | None:
    """Returns the installed folder with a package's shared files, or None if there is none.

    Returns:
        None where the package is not installed.
    """
    sourced = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    for prefix in (*sourced, sys.prefix):
        folder = Path(prefix) / "share" / package
        if folder.is_dir():
            return folder
    return None
