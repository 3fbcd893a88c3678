"""Index page with a row for each replayed bag."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from slosh_bringup.errors import SloshBringupError
from slosh_bringup.many_files import ItemOutcome
from slosh_bringup.replay.task import Replayed, Task
from slosh_report.run_report import RunVerdict
from slosh_report.run_report.index import MARK, IndexRow, index_document
from slosh_report.text import write_document

INDEX = "index.html"
_HEAD = 4096
"""Bytes at a page's beginning in which its mark stands."""


def check_index(folder: Path, tasks: Sequence[Task]) -> None:
    """Raises an error if the index would overwrite a page that is not an index.

    Raises:
        SloshBringupError: one would be, an earlier one or a bag's of this replay.
    """
    if any(task.name == Path(INDEX).stem for task in tasks):
        raise SloshBringupError(
            f"{folder / INDEX}: would be the page of a bag and of all bags; rename the bag"
        )
    page = folder / INDEX
    if page.exists() and not _is_index(page):
        raise SloshBringupError(f"{page}: is not an index of replays; choose another folder (-o)")


def write_index(folder: Path, outcomes: Sequence[ItemOutcome[Task, Replayed]]) -> None:
    """Writes the index page FOLDER/index.html with a row per bag.

    Raises:
        OSError: it cannot be written; it bears the path.
    """
    rows = [_row(each) for each in outcomes]
    write_document(folder / INDEX, index_document("Replayed bags", rows))


def _is_index(page: Path) -> bool:
    if not page.is_file():
        return False
    with page.open("rb") as file:
        return MARK.encode() in file.read(_HEAD)


def _row(outcome: ItemOutcome[Task, Replayed]) -> IndexRow:
    item = outcome.value
    if item is None:
        return IndexRow(outcome.item.name, None, reason=outcome.error)
    row, checked = item.headline, item.checked
    verdict = RunVerdict.NO_EXPECTATION
    if checked is not None:
        verdict = RunVerdict.PASSED if checked.passed else RunVerdict.FAILED
    return IndexRow(
        item.name,
        verdict,
        model=row.name if row else "",
        sigma=row.sigma if row else math.nan,
        epsilon=row.epsilon if row else math.nan,
        peak=item.peak,
        images=item.counts["images"],
        events=item.counts["events"],
        dropped=item.counts["dropped"],
        estimates=item.estimates,
        reason=next(iter(checked.failures), "") if checked else "",
    )
