"""Adds the motions of recordings to the fleet store, each unchanged recording once."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_folder import bag_files
from slosh_base.files.file_state import state_of
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
