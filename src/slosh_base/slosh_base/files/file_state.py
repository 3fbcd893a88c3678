"""Computes a digest by which a change of files is detected."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path


def state_of(files: Iterable[Path], *further: str) -> str:
    """Returns a digest (SHA-256) of the paths, sizes and times of files, and of further texts.

    Args:
        files: local files, or remote ones with the methods of a path.
        further: what else a result depends on, such as options.

    Raises:
        OSError: a file does not exist or cannot be asked; it bears the path.
    """
    digest = hashlib.sha256()
    for file in files:
        found = file.stat()
        digest.update(f"{file.resolve()}\n{found.st_size}\n{found.st_mtime_ns}\n".encode())
    for text in further:
        digest.update(f"{text}\n".encode())
    return digest.hexdigest()
