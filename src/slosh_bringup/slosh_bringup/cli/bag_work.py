"""Options of the commands that work on many bags in several processes or on a Dask cluster."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from slosh_bag.mcap_files.remote_path import is_url

WORTH_PROCESSES: Final = 100_000_000
"""Bags of this size together are worked on in several processes; to start these takes seconds."""


JOBS: Final = "number of processes (default: one per core; one for small bags)"


def add_work_options(parser: argparse.ArgumentParser, jobs: str = JOBS) -> None:
    """Adds the options `--jobs` (number of processes) and `--scheduler` (Dask cluster).

    Args:
        parser: of the command.
        jobs: help of `--jobs`.
    """
    parser.add_argument("--jobs", type=int, metavar="N", help=jobs)
    parser.add_argument(
        "--scheduler", metavar="ADDRESS",
        help="address of a running Dask scheduler whose workers work on the bags",
    )  # fmt: skip


class BagWork(NamedTuple):
    """How work on bags is distributed among processes; arguments of `map_files`.

    Attributes:
        jobs: number of processes on this machine; None: one for each core, or a scheduler's.
        scheduler: address of a Dask scheduler; None: processes on this machine.
        sizes: of the bags [bytes]; 0: not asked for, as it is far away.
    """

    jobs: int | None
    scheduler: str | None
    sizes: list[float]


def work_of(
    bags: Sequence[Path], arguments: argparse.Namespace, worth: float = WORTH_PROCESSES
) -> BagWork:
    """Returns how the work on bags is distributed, from the command-line options.

    Args:
        bags: folders or files.
        arguments: with the options that `add_work_options` adds.
        worth: size of all bags from which several processes are worth their start [bytes].
    """
    jobs: int | None = arguments.jobs
    open_choice = jobs is None and arguments.scheduler is None
    sizes = [_size(bag) if open_choice or not is_url(str(bag)) else 0.0 for bag in bags]
    if open_choice and sum(sizes) < worth:
        jobs = 1
    return BagWork(jobs, arguments.scheduler, sizes)


def named_error(bag: Path, error: str) -> str:
    """Describes in one line why a bag could not be processed, with the bag's path."""
    return error if str(bag) in error else f"{bag}: {error}"


def _size(bag: Path) -> float:
    """Returns the total size of a bag's readable files [bytes]."""
    files = (bag, *bag.glob("*.mcap"))
    return float(sum(path.stat().st_size for path in files if path.is_file()))
