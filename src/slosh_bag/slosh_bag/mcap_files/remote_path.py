"""Paths of bags in storage that fsspec reaches, such as s3://bucket/bag; read in parts."""

from __future__ import annotations

import errno
import importlib
import io
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple, cast

BLOCK: Final = 2**16
"""What is fetched beyond each range that is asked for [bytes]: a chunk's index lies behind it."""
_MARK: Final = "://"


class RemoteStatus(NamedTuple):
    """Size [bytes] and time of the last change [ns since 1970] of a remote file."""

    st_size: int
    st_mtime_ns: int


def bag_path(path: str | Path) -> Path:
    """Returns a bag's path: a local path, or a RemotePath for a URL of storage."""
    if isinstance(path, Path):
        return path
    return RemotePath(path) if is_url(path) else Path(path)


def is_url(text: str) -> bool:
    """Returns whether a text names storage that is reached by fsspec."""
    return _MARK in text


class RemotePath(type(Path())):  # type: ignore[misc]
    """A path in storage that fsspec reaches, with the reading methods of `pathlib.Path`.

    Raises:
        OSError: of each method that asks: the storage does not answer, or refuses.
    """

    def __str__(self) -> str:
        protocol, *names = self.parts
        return f"{protocol}//{'/'.join(names)}"

    def open(self, mode: str = "rb", *_: Any, **__: Any) -> BinaryIO:
        """Opens the file for reading; each read requests only the bytes that are needed."""
        with telling(self):
            files, key = self._files()
            stream = files.open(key, mode, block_size=BLOCK, cache_type="readahead")
        return cast("BinaryIO", _Stream(self, stream))

    def stat(self, **_: Any) -> RemoteStatus:
        """Returns size and time of the last change of the file."""
        with telling(self):
            files, key = self._files()
            found = files.info(key)
        time = found.get("LastModified") or found.get("mtime") or found.get("created") or 0
        seconds = time.timestamp() if isinstance(time, datetime) else float(time)
        return RemoteStatus(int(found["size"] or 0), round(1e9 * seconds))

    def is_dir(self) -> bool:
        """Returns whether the path is a folder: whether files exist below this path."""
        with telling(self):
            files, key = self._files()
            return bool(files.isdir(key))

    def is_file(self) -> bool:
        """Returns whether the path is that of an existing file."""
        with telling(self):
            files, key = self._files()
            return bool(files.isfile(key))

    def exists(self, **_: Any) -> bool:
        """Returns whether the path is an existing file or folder."""
        with telling(self):
            files, key = self._files()
            return bool(files.exists(key))

    def glob(self, pattern: str, **_: Any) -> Iterator[RemotePath]:
        """Yields the files below the path that match a pattern."""
        with telling(self):
            files, key = self._files()
            found = files.glob(f"{key}/{pattern}")
        return (RemotePath(files.unstrip_protocol(one)) for one in found)

    def iterdir(self) -> Iterator[RemotePath]:
        """Yields the files and folders directly below the path."""
        return self.glob("*")

    def resolve(self, **_: Any) -> RemotePath:
        """Returns the path itself, since remote paths are absolute and have no links."""
        return self

    absolute = resolve

    def _files(self) -> tuple[Any, str]:
        core = importlib.import_module("fsspec.core")
        files, key = core.url_to_fs(str(self))
        return files, str(key)


class _Stream(io.RawIOBase):
    """A stream whose errors are OSErrors that name the file."""

    def __init__(self, path: RemotePath, stream: Any) -> None:
        self._path, self._stream = path, stream

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return int(self._stream.tell())

    def seek(self, offset: int, whence: int = 0) -> int:
        return int(self._stream.seek(offset, whence))

    def readinto(self, buffer: Any) -> int:
        with telling(self._path):
            data = self._stream.read(len(buffer))
        buffer[: len(data)] = data
        return len(data)

    def close(self) -> None:
        if not self.closed:
            self._stream.close()
        super().close()


@contextmanager
def telling(place: object) -> Iterator[None]:
    """Converts a storage library's exceptions in a `with` block to one-line OSErrors.

    Raises:
        OSError: with the place and the reason; FileNotFoundError stays one.
    """
    try:
        yield
    except ImportError as error:
        remedy = "pip install -r requirements/storage.txt"
        raise OSError(errno.ENOPKG, f"{_line(error)} ({remedy})", str(place)) from None
    except FileNotFoundError:
        raise FileNotFoundError(errno.ENOENT, "no such file or folder", str(place)) from None
    except OSError as error:
        raise OSError(
            error.errno or errno.EIO, error.strerror or _line(error), str(place)
        ) from None
    except ValueError as error:
        raise OSError(errno.EINVAL, _line(error), str(place)) from None
    except Exception as error:
        if type(error).__module__.partition(".")[0] in ("slosh_bag", "builtins"):
            raise
        raise OSError(errno.EIO, _line(error), str(place)) from None


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
