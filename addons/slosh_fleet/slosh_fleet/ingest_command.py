"""`slosh ingest`: adds the motions of recordings to a store for queries over months."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_folder import bag_files
from slosh_bag.mcap_files.remote_path import bag_path, is_url
from slosh_base.files.file_state import state_of
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.bag_work import add_work_options, named_error, work_of
from slosh_fleet.motions import PLACE
from slosh_fleet.motions.motions import motions_of
from slosh_fleet.motions.store import FleetStore


class Ingested(NamedTuple):
    """Result of adding the motions of one bag to the fleet store.

    Attributes:
        motions: number of motions in the bag.
        new: number of files that the store did not have.
        unread: whether the bag was not read, because the store has its motions.
    """

    motions: int
    new: int
    unread: bool


def ingest(bag: Path, store: FleetStore) -> Ingested:
    """Adds a bag's motions to the fleet store; skips a bag that has not changed since it was read.

    It may be interrupted at any moment and repeated: each file of the store appears as a whole,
    and the bag is noted as ingested only after its last file.

    Args:
        bag: the bag's folder or MCAP file.
        store: gets the motions.

    Raises:
        SloshBagError: the bag cannot be read or holds no estimates, or the store cannot be
            written.
    """
    state = _state(bag)
    known = store.noted(state)
    if known is not None:
        return Ingested(known, 0, unread=True)
    rows = motions_of(bag)
    added = store.add(rows)
    store.note(state, len(rows))
    return Ingested(len(rows), added.new, unread=False)


def _state(bag: Path) -> str:
    """Returns a digest of a bag's path, file sizes and times, to detect a changed bag."""
    try:
        return state_of(bag_files(bag))
    except OSError as error:
        raise SloshBagError(f"{error.filename}: {error.strerror}") from None


EPILOG = """Each motion becomes a row of Parquet files in STORE/cell=.../month=..., which appear
as a whole. A bag that has not changed since is not read again, so an interrupted run is continued
by repeating it; a motion that is stored already counts once, whatever its bag is called. Bags and
the store may be URLs, such as s3://bucket/motions (requirements/storage.txt); such bags are read
by ranges. The recorder does the same at its end where cell.yaml has `store_motions: STORE`."""


def add_store(parser: argparse.ArgumentParser) -> None:
    """Adds the option `--store`: the folder or URL of the stored motions."""
    parser.add_argument(
        "--store", default=PLACE, metavar="STORE",
        help="folder or fsspec URL of the stored motions (default %(default)s)",
    )  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh ingest` to the argument parser."""
    parser.epilog = EPILOG
    parser.add_argument(
        "bags", nargs="+", type=bag_path, metavar="BAG",
        help="recordings with estimates, or folders of them; also URLs such as s3://bucket/bag",
    )  # fmt: skip
    add_store(parser)
    add_work_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Stores the motions of each bag; continues if a bag cannot be read."""
    from slosh_bringup.cli.progress import item_progress
    from slosh_bringup.many_files import map_files

    store = FleetStore(arguments.store)
    bags, failed = _bags(arguments.bags)
    work = map_files(
        partial(ingest_task, _absolute(arguments.store)), [bag.absolute() for bag in bags],
        **work_of(bags, arguments)._asdict(),
    )  # fmt: skip
    total = done = 0
    with item_progress("ingest", len(bags), "bags") as progress, closing(work):
        for outcome in work:
            progress.add()
            if outcome.value is None:
                told = named_error(outcome.item, outcome.error)
                print(plain_line(f"slosh ingest: {told}"), file=sys.stderr)
                continue
            done, total = done + 1, total + outcome.value.motions
            print(plain_line(f"{bags[outcome.index]}: {_told(outcome.value)}"))
    print(plain_line(f"{total} motions of {done} bags in {store.url}"))
    return 2 if failed or done < len(bags) else 0


def ingest_task(url: str, bag: Path) -> Ingested:
    """Stores the motions of one bag; can run in another process.

    Raises:
        SloshBagError: the bag cannot be read, or the store cannot be written.
    """
    return ingest(bag, FleetStore(url))


def _bags(paths: Sequence[Path]) -> tuple[list[Path], bool]:
    """Returns the bags found at paths, each once, and whether one of the paths has no bag."""
    from slosh_bag.errors import SloshBagError
    from slosh_bringup.cli.replay import find_bags
    from slosh_bringup.errors import SloshBringupError

    found: dict[Path, Path] = {}
    failed = False
    for path in paths:
        try:
            for bag in find_bags([path]):
                found.setdefault(bag.path.resolve(), bag.path)
        except (SloshBagError, SloshBringupError) as error:
            print(plain_line(f"slosh ingest: {error}"), file=sys.stderr)
            failed = True
    return list(found.values()), failed


def _absolute(store: str) -> str:
    """Returns the absolute path of a store's folder, or the unchanged URL of a remote store."""
    return store if is_url(store) else str(Path(store).absolute())


def _told(found: Ingested) -> str:
    told = "stored before" if found.unread or not found.new else "stored"
    return f"{found.motions} motions, {told if found.motions else 'nothing to store'}"
