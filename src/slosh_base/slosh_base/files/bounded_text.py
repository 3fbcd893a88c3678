"""Reads text files of limited size, which may be compressed.

A line of a gigabyte is as many times that in memory, and some megabytes of gzip are gigabytes of
text. So text is counted as it is unpacked, before anything is made of it.
"""

from __future__ import annotations

import codecs
import gzip
import io
import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, TextIO, cast

from slosh_base.files.errors import SloshFileError, TextFileError

MOST_TEXT = 500_000_000
"""Of a table, unpacked, at most [bytes]."""
MOST_CELLS = 15_000_000
"""Of a table, at most: an hour of 1 kHz with 4 columns; counted by separators and lines."""
LONGEST_LINE = 100_000
"""At most [bytes]; a row of 400 columns has less than 10,000."""
_SLICE = 1 << 16
_ASCII = bytes(range(128))
_CONTROLS = bytes({*range(32)} - {*b"\t\r\n\f"})
MOST_BEYOND = 0.3
"""Share of bytes beyond ASCII in a text of the Windows code page, at most."""
_SEPARATORS = (b",", b";", b"\t", b"|")
_ADVICE = "is it a table? If so, split it"


@contextmanager
def bounded_text(path: Path, what: str) -> Iterator[TextIO]:
    """Opens a text file for reading; decompresses it if its name ends in .gz.

    It is UTF-8, UTF-16 as Excel's "Unicode text", or the Windows code page of western Europe, in
    which spreadsheets write '²', '°' and 'µ'.

    Args:
        path: the file.
        what: it should be, for messages, such as 'a motion table is CSV'.

    Raises:
        SloshFileError: the file cannot be read, is no text or damaged, or stands for too much; one
            line that names the file. Also what is read within the context raises it.
    """
    try:
        if path.is_file():  # what cannot be read twice is counted as it is read
            with _unpacked(path) as raw:
                counted = _Counted(path, raw)
                while counted.read(_SLICE):
                    pass
        with _unpacked(path) as raw:
            buffered = io.BufferedReader(_Counted(path, raw), _SLICE)
            encoding = _encoding(buffered.peek(_SLICE)[:_SLICE])
            yield io.TextIOWrapper(buffered, encoding=encoding, newline="")
    except (EOFError, zlib.error, gzip.BadGzipFile):
        raise SloshFileError(
            f"{path}: the gzip file is cut off or damaged; copy it again"
        ) from None
    except OSError as error:
        raise SloshFileError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SloshFileError(f"{path}: is not a text file; {what}") from None


def _encoding(head: bytes) -> str:
    """Guesses the encoding of a text from its first bytes."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for encoding, zeros in (("utf-16-le", head[1::2]), ("utf-16-be", head[::2])):
        # Without a mark: every second byte of western text is 0.
        if len(zeros) > 4 and zeros.count(0) > 0.9 * len(zeros):
            return encoding
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        beyond = len(head.translate(None, _ASCII))
        controls = any(byte in head for byte in _CONTROLS)
        return "cp1252" if not controls and beyond < MOST_BEYOND * len(head) else "utf-8"
    return "utf-8-sig"


def _unpacked(path: Path) -> BinaryIO:
    return cast(BinaryIO, gzip.open(path, "rb")) if path.suffix == ".gz" else path.open("rb")


class _Counted(io.RawIOBase):
    """A binary stream that counts what is read from a file and enforces limits."""

    def __init__(self, path: Path, raw: BinaryIO) -> None:
        self._path = path
        self._raw = raw
        self._size = self._cells = self._line = 0

    def readable(self) -> bool:
        """Returns True, since the stream can always be read."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Reads bytes into a buffer; raises an error if the file is too large.

        Raises:
            SloshFileError: there are too many of them.
        """
        part = self._raw.read(len(buffer))
        buffer[: len(part)] = part
        self._count(part)
        return len(part)

    def _count(self, part: bytes) -> None:
        ends = part.count(b"\n") + part.count(b"\r")
        self._size += len(part)
        self._cells += ends + sum(map(part.count, _SEPARATORS))
        lines = part.replace(b"\r", b"\n").split(b"\n") if ends else [part]
        longest = max(self._line + len(lines[0]), *map(len, lines[1:]), 0)
        self._line = len(lines[-1]) if ends else longest
        for number, most, unit in (
            (longest, LONGEST_LINE, "bytes in a line"),
            (self._size, MOST_TEXT, "bytes"),
            (self._cells, MOST_CELLS, "cells"),
        ):
            if number > most:
                raise SloshFileError(f"{self._path}: has more than {most} {unit}; {_ADVICE}")


def read_text(path: str | Path, longest: int, *, guess: bool = False) -> str:
    """Reads a text file; raises an error if it is too large.

    Args:
        path: the file.
        longest: bytes of it, at most.
        guess: read the encodings of `bounded_text` as well, in which spreadsheets write.

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
        return content.decode(_encoding(content[:_SLICE]) if guess else "utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise TextFileError(path, f"is not UTF-8 text (line {line})") from None


def _content(path: str | Path, longest: int) -> bytes | None:
    """Reads the first bytes of a file without blocking; returns None if it is no regular file."""
    # A named pipe without a writer, or a terminal, would hold up an ordinary open().
    with open(path, "rb", opener=_open_at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            return None
        return file.read(longest + 1)


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC)
