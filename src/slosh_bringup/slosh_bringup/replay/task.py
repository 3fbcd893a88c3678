"""Replays one bag and writes the results."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from itertools import chain, count
from pathlib import Path
from typing import Any

import slosh_base
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_facts import read_facts
from slosh_bag.mcap_files.bag_folder import METADATA, bag_files
from slosh_base.files import is_unfinished, new_folder
from slosh_base.files.file_state import state_of
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.finished_work import FinishedWork
from slosh_bringup.replay.by_journal import checked_by_journal
from slosh_model.model_text import read_model
from slosh_motion.inputs.inputs import WantedInput
from slosh_motion.recorded.sources import event_lines
from slosh_replay.manifest import Expectation
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import ReplayResult, replay_bag
from slosh_replay.replay.checking import (
    CheckedReplay,
    Point,
    check_result,
    dropped,
    excesses,
    expectation_of,
)
from slosh_replay.replay.output_bag import FACTS, OutputBag
from slosh_replay.replay.report import highest, report_start, shown_models
from slosh_replay.replay.result import ModelAccuracy
from slosh_replay.replay.verification import Verification

PAGES = (".html", ".json")
"""What there is of a replay beside its bag of outputs."""


@dataclass(frozen=True, slots=True)
class Task:
    """A bag to replay, with its options.

    Attributes:
        bag: folder or file.
        name: of its results.
        model: file to replay with; None: the recorded model.
        cell: namespace of the topics; None: the bag's only or first cell.
        output: folder of the results; None: none are written.
        expected: what the replay must give; None: nothing.
        unstated: there is a manifest, and it does not name the bag.
        figures: whether all figures are told.
        estimator: which, from 1, where several are mixed on one topic.
        given: how the input is read; None: as the recorded estimator did.
    """

    bag: Path
    name: str
    model: Path | None = None
    cell: str | None = None
    output: Path | None = None
    expected: Expectation | None = None
    unstated: bool = False
    figures: bool = False
    given: WantedInput | None = None

    def absolute(self) -> Task:
        """Returns a copy of the task with absolute paths."""
        model, output = self.model, self.output
        return replace(
            self,
            bag=self.bag.absolute(),
            model=None if model is None else model.absolute(),
            output=None if output is None else output.absolute(),
        )


@dataclass(frozen=True, slots=True)
class Replayed:
    """Summary of a replayed bag; its size does not depend on the bag's length.

    Attributes:
        name: of the bag.
        accuracy: of each model.
        headline: that of them which the page puts on top; None: nothing was compared.
        peak: greatest measured height [m]; NaN: none.
        checked: against what was expected; None: nothing was.
        estimates: how recorded and replayed estimates compare, in short.
        differences: why the bag was written, and the same where they differ, one line each.
        unchecked: recorded messages that were not compared, one line each.
        warnings: about the bag.
        counts: images, dropped samples and excesses of limits.
        seconds: that the replay took [s].
        document: all figures, as JSON has them; empty: they were not asked for.
        expectation: what a manifest would state of it now.
        before: whether an earlier, interrupted run has replayed it, and nothing has changed since.
    """

    name: str
    accuracy: tuple[ModelAccuracy, ...]
    headline: ModelAccuracy | None
    peak: float
    checked: CheckedReplay | None
    estimates: str
    differences: tuple[str, ...]
    unchecked: tuple[str, ...]
    warnings: tuple[str, ...]
    counts: Mapping[str, int]
    seconds: float
    document: Mapping[str, Any]
    expectation: Expectation
    before: bool = False


def replay_task(task: Task) -> Replayed:
    """Replays one bag and writes the requested outputs, unless an earlier run has done so.

    Raises:
        SloshBagError: it cannot be replayed.
        SloshBringupError: a result cannot be written.
    """
    if task.output is None:
        return _replayed(task)
    finished, state = FinishedWork(task.output), _state(task)
    known = finished.find(task.name, state, Replayed)
    pages = [task.output / f"{task.name}{suffix}" for suffix in PAGES]
    if known is not None and all(path.exists() for path in (task.output / task.name, *pages)):
        return replace(known, before=True)
    found = _replayed(task)
    finished.note(task.name, state, found)
    return found


def _state(task: Task) -> str:
    """Returns a digest of all data and settings that affect a replay's result."""
    files = [*bag_files(task.bag), *([] if task.model is None else [task.model])]
    return state_of(files, repr(task), version("slosh_bringup"))


def _replayed(task: Task) -> Replayed:
    started = time.perf_counter()
    run = RecordedRun(task.bag)
    model = read_model(task.model) if task.model else None
    if task.output is None:
        result = replay_bag(run, model, given=task.given, cell=task.cell)
    else:
        _check_pages(task.output / task.name)
        with new_bag(task.output / task.name) as outputs:
            result = replay_bag(run, model, given=task.given, outputs=outputs, cell=task.cell)
    result = replace(result, name=task.name)
    found = result.verification
    differs = found is not None and not found.exact
    if task.model is None and task.given is None and (differs or task.expected is not None):
        result = checked_by_journal(result, run, task.cell)
    checked = _checked(result, task)
    if task.output is not None:
        # What draws takes longer to load than many a bag to replay.
        from slosh_bringup.replay.page import write_page

        write_page(task.output, run, result, checked)
    found = result.verification
    return Replayed(
        task.name,
        result.accuracy,
        _headline(result),
        highest(result.measured),
        checked,
        _in_short(found),
        (
            *event_lines(run.facts, report_start(result)),
            *(found.lines() if found and (not found.exact or found.unchecked) else ()),
        ),
        tuple(line for one in result.verified.values() for line in one.unchecked_lines),
        result.warnings,
        {
            "images": result.counters.get("images", 0),
            "dropped": dropped(result),
            "events": len(excesses(result.events)),
        },
        time.perf_counter() - started,
        _document(result, checked) if task.figures else {},
        replace(expectation_of(result), model=task.model),
    )


def _headline(result: ReplayResult) -> ModelAccuracy | None:
    nonlinear = shown_models(result)[1]
    return next((row for row in result.accuracy if row.name == nonlinear), None)


def _checked(result: ReplayResult, task: Task) -> CheckedReplay | None:
    if task.expected is None:
        return None
    checked = check_result(result, task.expected)
    if task.unstated:
        points = (Point("manifest", "the manifest does not list this bag"), *checked.points)
        checked = replace(checked, points=points)
    return checked


def _in_short(found: Verification | None) -> str:
    if found is None or not found.total:
        unchecked = sum(found.unchecked.values()) if found is not None else 0
        return f"{unchecked} not checked" if unchecked else "none recorded"
    if found.exact:
        return f"{found.identical} bit for bit"
    return f"{found.identical} of {found.total}"


def _document(result: ReplayResult, checked: CheckedReplay | None) -> dict[str, Any]:
    """Returns all results of a replay, and of its checks, for JSON."""
    points = None
    if checked is not None:
        points = [{"name": point.name, "failure": point.failure} for point in checked.points]
    return {**json.loads(result.to_json()), "checks": points}


def unique_names(bags: Sequence[Path]) -> list[str]:
    """Returns a unique name for each bag; adds parent folder names where needed."""
    paths = [path.resolve() for path in bags]
    stems = [path.with_name(path.name.removesuffix(".mcap")) for path in paths]
    alike = Counter(stems)
    parts = [
        (path if alike[stem] > 1 else stem).parts[1:]
        for path, stem in zip(paths, stems, strict=True)
    ]
    found: dict[int, str] = {}
    left, depth = list(range(len(parts))), 1
    while left:
        tails = Counter(parts[index][-depth:] for index in left)
        for index in left:
            own = parts[index]
            if tails[own[-depth:]] == 1 or depth >= len(own):
                found[index] = "-".join(own[-depth:])
        left, depth = [index for index in left if index not in found], depth + 1
    names: dict[str, None] = {}
    for index in range(len(parts)):
        # 'a-b' and 'a/b' still have one name.
        tries = chain([found[index]], (f"{found[index]}-{number}" for number in count(2)))
        names[next(name for name in tries if name not in names)] = None
    return list(names)


@contextmanager
def new_bag(folder: Path) -> Iterator[OutputBag]:
    """Writes the replay's output bag, which replaces an earlier one when it is complete.

    Raises:
        SloshBringupError: the folder holds something else; nothing of it is touched.
    """
    if not _may_replace(folder):
        raise SloshBringupError(
            f"{folder}: contains other files than a replay's output; choose another folder (-o)"
        )
    try:
        with new_folder(folder, replace=True) as room, OutputBag(room) as outputs:
            yield outputs
    except OSError as error:
        raise SloshBringupError(f"{error.filename or folder}: {error.strerror}") from None


def remove_unfinished(tasks: Sequence[Task]) -> None:
    """Removes temporary files of killed processes from the output folders."""
    for task in tasks:
        if task.output is not None:
            slosh_base.files.remove_unfinished(task.output, PAGES)
            slosh_base.files.remove_unfinished(task.output / task.name)
            with suppress(OSError):  # not empty: it holds a whole bag
                (task.output / task.name).rmdir()


def _check_pages(bag: Path) -> None:
    """Raises an error if an HTML page would be overwritten that no earlier replay wrote.

    Raises:
        SloshBringupError: they would be replaced.
    """
    if (bag / METADATA).is_file():
        return
    for page in (bag.with_name(f"{bag.name}{suffix}") for suffix in PAGES):
        if page.exists():
            raise SloshBringupError(
                f"{page}: is not from a replay, its bag is missing; choose another folder (-o)"
            )


def _may_replace(folder: Path) -> bool:
    """Whether the folder contains nothing but an earlier replay's output bag."""
    if not folder.exists() and not folder.is_symlink():
        return True
    if not folder.is_dir() or folder.is_symlink():
        return False
    content = [path for path in folder.iterdir() if not is_unfinished(path)]
    files = [path for path in content if path.name != METADATA]
    if not files:
        return not (folder / METADATA).exists()
    return all(path.suffix == ".mcap" and path.is_file() and _is_output(path) for path in files)


def _is_output(file: Path) -> bool:
    try:
        return read_facts(file)[0].get("content") == FACTS["content"]
    except (SloshBagError, OSError):
        return False
