"""Finds the packages' installed files that are not modules."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def shared_folder(package: str) -> Path | None:
    """Returns a package's share folder, in a sourced workspace or below Python's prefix (wheels).

    Returns:
        None where the package is not installed.
    """
    sourced = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    for prefix in (*sourced, sys.prefix):
        folder = Path(prefix) / "share" / package
        if folder.is_dir():
            return folder
    return None
