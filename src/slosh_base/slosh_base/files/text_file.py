"""Reads a text file that a user names: a regular one, of bounded size, in UTF-8."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from slosh_base.files.errors import TextFileError


def read_text(path: str | Path, longest: int) -> str:
    """The text of a file.

    Args:
        path: the file.
        longest: bytes of it, at most.

    Raises:
        TextFileError: it is not there, no regular file, too long, or not UTF-8.
    """
    try:
        content = _content(path, longest)
    except OSError as error:
        raise TextFileError(path, error.strerror or "cannot be read") from None
    except ValueError as error:  # of a path with a zero byte
        raise TextFileError(repr(str(path)), str(error)) from None
    if content is None:
        raise TextFileError(path, "not a regular file")
    if len(content) > longest:
        raise TextFileError(path, f"too large, more than {longest} bytes")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise TextFileError(path, f"is not UTF-8 text (line {line})") from None


def _content(path: str | Path, longest: int) -> bytes | None:
    """The first bytes of a regular file; None: it is none. Waits for nobody."""
    # A named pipe without a writer, or a terminal, would hold up an ordinary open().
    with open(path, "rb", opener=_open_at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            return None
        return file.read(longest + 1)


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC)
