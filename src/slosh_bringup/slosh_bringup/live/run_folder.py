"""Makes a separate folder for each run of a cell; earlier runs are never changed."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from itertools import chain, count
from pathlib import Path

from slosh_base.files import new_link

LATEST = "latest"
"""Link to the newest run, beside the runs."""


def new_run(output: Path, now: datetime, tell: Callable[[str], object]) -> Path:
    """Creates a new folder for a run and points the link to the latest run at it.

    Args:
        output: where the runs lie; made where it is missing.
        now: the run's start, local time; its folder is named after it.
        tell: gets a line where the link cannot be made.

    Returns:
        the folder, new and empty: of runs that start at once each has its own.

    Raises:
        OSError: it cannot be made.
    """
    output.mkdir(parents=True, exist_ok=True)
    name = f"{now:%Y-%m-%dT%H-%M-%S}"
    for suffix in chain([""], (f"-{number}" for number in count(2))):
        run = output / f"{name}{suffix}"
        try:
            run.mkdir()
        except FileExistsError:
            continue
        break
    _point(output / LATEST, run, tell)
    return run


def _point(link: Path, run: Path, tell: Callable[[str], object]) -> None:
    if link.exists() and not link.is_symlink():
        tell(f"{link}: is not a link and is left unchanged")
        return
    try:
        new_link(link, Path(run.name))
    except OSError as error:
        tell(f"{link}: cannot be a link to the newest run here: {error.strerror}")
