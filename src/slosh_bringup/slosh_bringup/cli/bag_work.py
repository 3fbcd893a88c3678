"""Options of the commands that work on many bags in several processes or on a Dask cluster."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Final

WORTH_PROCESSES: Final = 100_000_000
"""Bags of this size together are worked on in several processes; to start these takes seconds."""


def add_work_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options `--jobs` and `--scheduler`: where, and in how many processes, to work."""
    parser.add_argument(
        "--jobs", type=int, metavar="N",
        help="number of processes (default: one per core; one for small bags)",
    )  # fmt: skip
    parser.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="address of a running Dask scheduler whose workers work on the bags",
    )  # fmt: skip


def chosen_jobs(bags: Sequence[Path], arguments: argparse.Namespace) -> int | None:
    """Returns the number of processes to use on this machine, or None for one per core."""
    jobs: int | None = arguments.jobs
    if jobs is None and arguments.scheduler is None and _size(bags) < WORTH_PROCESSES:
        return 1
    return jobs


def _size(bags: Sequence[Path]) -> int:
    """Returns the total size of all readable bags [bytes]."""
    files = [path for bag in bags for path in (bag, *bag.glob("*.mcap"))]
    return sum(path.stat().st_size for path in files if path.is_file())
