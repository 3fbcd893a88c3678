"""Finds and deletes the bags in the folder of a cell's runs.

`slosh cell -o DIR` writes each run to DIR/2026-11-22T10-15-00. Only bags of such runs are found:
what lies elsewhere is nobody's to delete.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path

from slosh_bag.black_box.event_bags import event_bags
from slosh_bag.errors import SloshBagError
from slosh_bag.held_folder import is_held
from slosh_bag.mcap_files.bag_metadata import NAME
from slosh_bag.recorder import RESERVE
from slosh_bag.store.retention import BagKind, StoredBag

RUN = re.compile(r"\d{4}-\d\d-\d\dT\d\d-\d\d-\d\d(-\d+)?", re.ASCII)
"""Name of a run's folder."""
MOMENT = 60.0
"""A bag that was written so recently counts as running, where a file system has no locks [s]."""


def runs_folder(bag: Path) -> Path | None:
    """Returns the folder of all runs of a cell, from one of its bags; None outside a run."""
    run = bag.absolute().parent
    return run.parent if RUN.fullmatch(run.name) else None


def stored_bags(runs: Path, now: float) -> list[StoredBag]:
    """Returns the bags of all runs of a cell, oldest first.

    Args:
        runs: the folder of the runs.
        now: the time [s since 1970].

    Raises:
        SloshBagError: there is no such folder, or it cannot be read.
    """
    try:
        found = [bag for folder in _folders(runs) for bag in _bags(folder, now)]
    except (FileNotFoundError, NotADirectoryError) as error:
        raise SloshBagError(
            f"{error.filename}: {error.strerror}; name the folder of a cell's runs, the one after "
            "-o of `slosh cell`: slosh store RUNS"
        ) from None
    except OSError as error:
        raise SloshBagError(f"{error.filename}: {error.strerror}") from None
    return sorted(found, key=lambda bag: (bag.written, bag.folder))


def delete(bag: StoredBag) -> None:
    """Deletes a bag's files, and its folder if nothing else is in it.

    Raises:
        SloshBagError: a file cannot be deleted, or a recorder writes to the bag.
    """
    if is_held(bag.folder) or is_held(bag.folder.parent):
        raise SloshBagError(f"{bag.folder}: is being recorded; not deleted")
    try:
        # The description last: a bag that is half deleted is found again.
        for file in [*_files(bag.folder), bag.folder / NAME, bag.folder / RESERVE]:
            file.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # somebody keeps notes there
            bag.folder.rmdir()
    except OSError as error:
        raise SloshBagError(f"{error.filename}: {error.strerror}; not deleted") from None


def _folders(runs: Path) -> Iterator[Path]:
    """Yields the folders of a cell's bags; links are not followed."""
    for run in sorted(runs.iterdir()):
        if RUN.fullmatch(run.name) and run.is_dir() and not run.is_symlink():
            for folder in sorted(run.iterdir()):
                if folder.is_dir() and not folder.is_symlink():
                    yield folder


def _bags(folder: Path, now: float) -> Iterator[StoredBag]:
    """Yields the folder itself if it is a bag, or else the event bags in the folder."""
    is_running = is_held(folder)
    own = _stored(folder, BagKind.COMPLETE, now, is_running)
    if own is not None:
        yield own
        return
    for inner in event_bags(folder):
        found = _stored(inner, BagKind.EVENT, now, is_running)
        if found is not None and not inner.is_symlink():
            yield found


def _stored(folder: Path, kind: BagKind, now: float, is_running: bool) -> StoredBag | None:
    files = _files(folder)
    if not files:
        return None
    written, size = 0.0, 0
    for file in files:
        with contextlib.suppress(FileNotFoundError):  # it goes away meanwhile
            state = file.stat()
            written, size = max(written, state.st_mtime), size + state.st_size
    if is_running or is_held(folder) or 0.0 <= now - written < MOMENT:
        kind = BagKind.RUNNING
    return StoredBag(folder, written, size, kind)


def _files(folder: Path) -> list[Path]:
    return sorted(file for file in folder.glob("*.mcap") if not file.is_symlink())
