"""`slosh ingest`: adds the motions of recordings to a store for queries over months."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from slosh_base.files.plain_text import plain_line
from slosh_replay.fleet import PLACE

EPILOG = """Each motion becomes a row of Parquet files in STORE/cell=.../month=..., which appear
as a whole. A motion that is stored already counts once, whatever its bag is called. Other places
than a disk, such as s3://bucket/motions, need their fsspec library (pip install s3fs)."""


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
        "bags", nargs="+", type=Path, metavar="BAG", help="recordings with estimates"
    )
    add_store(parser)


def run(arguments: argparse.Namespace) -> int:
    """Stores the motions of each bag; goes on if one cannot be read."""
    from slosh_bag.errors import SloshBagError
    from slosh_replay.fleet.motions import motions_of
    from slosh_replay.fleet.store import FleetStore

    store = FleetStore(arguments.store)
    total = new = failed = 0
    for bag in arguments.bags:
        try:
            rows = motions_of(bag)
        except SloshBagError as error:
            print(plain_line(f"slosh ingest: {error}"), file=sys.stderr)
            failed += 1
            continue
        added = store.add(rows)
        total, new = total + added.motions, new + added.new
        told = "stored" if added.new else "stored before" if added.motions else "nothing to store"
        print(plain_line(f"{bag}: {added.motions} motions, {told}"))
    print(plain_line(f"{total} motions of {len(arguments.bags) - failed} bags in {store.url}"))
    return 2 if failed else 0
