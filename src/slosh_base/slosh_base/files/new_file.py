"""Writes files under a temporary name and renames them when they are complete."""

from __future__ import annotations

import contextlib
import errno
import gzip
import io
import os
import re
import secrets
import stat
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, BinaryIO, TextIO

PREFIX = ".slosh-"
"""How the names of unfinished files and folders begin."""
_DESCRIPTOR = re.compile(r"/dev/(?:(stdout)|(stderr)|fd/(\d+))|/proc/self/fd/(\d+)")

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


class NewFile:
    """A file that is written under a temporary name until it is complete.

    Until `finish` the old file of that name is as it was; `discard` leaves it so. As a context
    manager it finishes, or discards where an error or Ctrl-C leaves the block.

    A link is followed, its target is replaced. The new file has the mode and owner of the old one;
    without an old one the mode is what umask says. What is no regular file (a pipe, a terminal,
    /dev/null) and what the process was given open (/dev/stdout) is written as it is.

    Args:
        path: the file.
        sync: whether it is on the disk before it takes its name; without, a machine that loses
            its power soon afterwards may have neither the old nor the new one.

    Attributes:
        path: the file.
        part: what is to be written; it has the suffix of `path`.

    Raises:
        OSError: the file cannot be made or replaced; it bears `path`.
    """

    def __init__(self, path: Path, *, sync: bool = True) -> None:
        self.path = self.part = path
        self._sync = sync
        self._target: Path | None = None
        with naming(path):
            old = _status(path)
            if _DESCRIPTOR.fullmatch(str(path)) or not (old is None or _is_replaceable(old)):
                return
            if old is not None and not os.access(path, os.W_OK):
                raise OSError(errno.EACCES, os.strerror(errno.EACCES))
            self._target = Path(os.path.realpath(path))
            self.part = self._target.with_name(unfinished_name(path.suffix))
            try:
                _make(self.part, old)
            except BaseException:
                self.discard()
                raise

    def __enter__(self) -> NewFile:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            self.finish()
        else:
            self.discard()

    def open(self) -> BinaryIO:
        """Opens the temporary file for writing; OSErrors name the final path."""
        with naming(self.path):
            given = _DESCRIPTOR.fullmatch(str(self.path)) if self._target is None else None
            if given is None:
                return io.BufferedWriter(_Stream(self.part, self.path))
            # Opened anew, a redirected standard output would be cut to nothing.
            sys.stdout.flush()
            stdout, _, *numbers = given.groups()
            number = next((int(text) for text in numbers if text), 1 if stdout else 2)
            return io.BufferedWriter(_Stream(os.dup(number), self.path))

    def finish(self) -> None:
        """Completes the file and renames it to its final name.

        Raises:
            OSError: that is not possible; the old file is as it was.
        """
        target, self._target = self._target, None
        if target is None:
            return
        try:
            with naming(self.path):
                if self._sync:
                    wait_for_disk(self.part)
                os.replace(self.part, target)
        except BaseException:
            self.part.unlink(missing_ok=True)
            raise

    def discard(self) -> None:
        """Deletes the unfinished temporary file."""
        if self._target is not None:
            self._target = None
            self.part.unlink(missing_ok=True)


class _Stream(io.FileIO):
    """A binary file whose errors name the path that the user gave."""

    def __init__(self, file: Path | int, path: Path) -> None:
        self._path = path
        super().__init__(file, "wb")

    def write(self, data: Any, /) -> Any:
        with naming(self._path):
            return super().write(data)


@contextmanager
def new_text(path: Path) -> Iterator[TextIO]:
    """Opens a UTF-8 text file that appears under its name when it is complete.

    A file whose name ends in .gz is packed; the same text gives the same file.

    Raises:
        OSError: the file cannot be written; it bears the path.
    """
    with NewFile(path) as new, new.open() as file, ExitStack() as stack:
        binary: Any = file
        if path.suffix == ".gz":
            packed = gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=0)
            binary = stack.enter_context(packed)
        yield stack.enter_context(io.TextIOWrapper(binary, "utf-8", newline=""))


def write_bytes(path: Path, content: bytes, *, sync: bool = True) -> None:
    """Writes a binary file completely or not at all; `sync` waits for the disk.

    Raises:
        OSError: it cannot be written; it bears the path.
    """
    with NewFile(path, sync=sync) as new, new.open() as stream:
        stream.write(content)


def write_text(path: Path, text: str, *, sync: bool = True) -> None:
    """Writes a UTF-8 text file completely or not at all; `sync` waits for the disk.

    Raises:
        OSError: it cannot be written; it bears the path.
    """
    write_bytes(path, text.encode(), sync=sync)


def new_link(path: Path, target: Path) -> None:
    """Creates a symbolic link, or changes an existing one atomically.

    Raises:
        OSError: it cannot be made; it bears the path.
    """
    aside = path.with_name(unfinished_name())
    with naming(path):
        aside.symlink_to(target)
        try:
            os.replace(aside, path)
        except BaseException:
            aside.unlink()
            raise


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Replaces the file name in OSErrors by the path that the user knows."""
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None


def unfinished_name(suffix: str = "") -> str:
    """Returns a unique temporary name for a file that is being written."""
    return f"{PREFIX}{secrets.token_hex(6)}{suffix}"


def wait_for_disk(path: Path) -> None:
    """Waits until a file's or folder's data is stored on disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _status(path: Path) -> os.stat_result | None:
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _is_replaceable(old: os.stat_result) -> bool:
    """Whether an existing file is a regular file; raises an error for a folder.

    Raises:
        OSError: a folder.
    """
    if stat.S_ISDIR(old.st_mode):
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
    return stat.S_ISREG(old.st_mode)


def _make(part: Path, old: os.stat_result | None) -> None:
    """Creates an empty temporary file; copies owner and permissions of an existing file."""
    with part.open("xb") as file:
        if old is not None:
            with contextlib.suppress(OSError):  # only root can give a file away
                os.fchown(file.fileno(), old.st_uid, old.st_gid)
            os.fchmod(file.fileno(), stat.S_IMODE(old.st_mode))


def keep_others_from_writing() -> None:
    """Sets the umask so that other users cannot write to new files and folders.

    Holds for this process and those that it starts.
    """
    # There is no other way to ask for it than to set it.
    os.umask(os.umask(0o077) | OTHERS_WRITE)
