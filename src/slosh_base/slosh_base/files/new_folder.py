"""Fills folders under a temporary name, so that they are complete or absent."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from slosh_base.files.errors import SloshFileError
from slosh_base.files.new_file import PREFIX, naming, unfinished_name, wait_for_disk


@contextmanager
def new_folder(folder: Path, *, replace: bool = False) -> Iterator[Path]:
    """Yields a temporary folder whose contents are moved to `folder` when the block ends.

    Where an error or Ctrl-C leaves the block, nothing has happened. Of two runs into one folder
    one is refused.

    Args:
        folder: must be new or empty.
        replace: it may hold files, which are replaced as a whole.

    Yields:
        an empty folder of the same name.

    Raises:
        SloshFileError: the folder holds something, or is none.
        OSError: it cannot be written; it bears `folder`.
    """
    with naming(folder):
        made = _make(folder)
    aside = folder / unfinished_name()
    room = aside / folder.resolve().name
    try:
        with _naming_inside(folder, aside):
            room.mkdir(parents=True)
            # What another run is about to replace is not this one's to remove.
            old = [path for path in folder.iterdir() if not (replace and is_unfinished(path))]
            old = [path for path in old if path != aside]
            if not replace:
                _check_empty(folder, old)
            yield room
            _move(room, folder, old)
    finally:
        shutil.rmtree(aside, ignore_errors=True)
        _remove_empty(made)


def check_free(folder: Path) -> None:
    """Raises an error if the output folder is not empty.

    Raises:
        SloshFileError: the folder holds something, or is none.
        OSError: it cannot be read.
    """
    if os.path.lexists(folder):
        if not folder.is_dir():
            raise SloshFileError(f"{folder}: exists already and is not a folder; choose another")
        _check_empty(folder, list(folder.iterdir()))


def is_unfinished(path: Path) -> bool:
    """Whether a file or folder has the temporary name of an unfinished write."""
    return path.name.startswith(PREFIX)


def remove_unfinished(folder: Path, suffixes: tuple[str, ...] = ("",)) -> None:
    """Removes temporary files that killed processes have left in a folder.

    Args:
        folder: where they wrote.
        suffixes: of the files that were to be written; '': folders, and files without a suffix.
    """
    if not folder.is_dir():
        return
    for path in filter(is_unfinished, folder.iterdir()):
        if path.suffix not in suffixes:
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def _check_empty(folder: Path, content: list[Path]) -> None:
    if content:
        names = sorted(path.name for path in content)
        more = ", ..." if len(names) > 1 else ""
        raise SloshFileError(
            f"{folder}: exists already and holds {names[0]}{more}; choose another folder or "
            "remove it"
        )


def _make(folder: Path) -> list[Path]:
    """Creates a folder with its parents; returns the new ones, innermost first."""
    made: list[Path] = []
    try:
        for path in [*reversed(folder.parents), folder]:
            if not path.is_dir():
                with suppress(FileExistsError):  # another run was faster
                    path.mkdir()
                    made.insert(0, path)
                if not path.is_dir():
                    raise SloshFileError(f"{path}: is not a folder; choose another")
    except BaseException:
        _remove_empty(made)
        raise
    return made


def _remove_empty(folders: list[Path]) -> None:
    for path in folders:
        with suppress(OSError):  # not empty: it holds what was to be there
            path.rmdir()


def _move(room: Path, folder: Path, old: list[Path]) -> None:
    """Moves the temporary folder's contents to the final folder, replacing old contents."""
    new = sorted(room.iterdir())
    for path in room.rglob("*"):
        if path.is_file():
            wait_for_disk(path)
    for path in new:
        os.replace(path, folder / path.name)
    for name in {path.name for path in old} - {path.name for path in new}:
        (folder / name).unlink()


@contextmanager
def _naming_inside(folder: Path, aside: Path) -> Iterator[None]:
    """Replaces temporary file names in OSErrors by the final folder's name."""
    try:
        yield
    except OSError as error:
        named = error.filename
        if error.errno is None or not (named is None or Path(str(named)).is_relative_to(aside)):
            raise
        raise OSError(error.errno, error.strerror, str(folder)) from None
