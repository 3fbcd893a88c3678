"""Bags that an importer writes are whole or not there."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from slosh_bag.errors import SloshBagError


@contextmanager
def removed_on_failure(bag: Path) -> Iterator[None]:
    """Removes a bag's folder where an error leaves the block; refuses one that holds files.

    Raises:
        SloshBagError: the folder holds files already.
    """
    if bag.exists() and (not bag.is_dir() or any(bag.iterdir())):
        raise SloshBagError(f"{bag}: exists already; choose another folder or remove it")
    try:
        yield
    except BaseException:
        shutil.rmtree(bag, ignore_errors=True)
        raise
