"""`slosh replay`: runs the estimator and the monitor over recorded bags, without DDS."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slosh_bag.mcap_files.bag_folder import files_of
from slosh_bag.reader import bag_files
from slosh_base.files import check_apart, check_outside
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.bag_work import add_work_options, named_error, work_of
from slosh_bringup.cli.input_options import add_input_options, wanted_input
from slosh_bringup.cli.output_names import JUNIT, check_ending
from slosh_bringup.cli.parser import old_name
from slosh_bringup.cli.progress import item_progress
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.finished_work import FinishedWork
from slosh_bringup.many_files import ItemOutcome, map_files
from slosh_bringup.replay.junit import Case, Suite, write_junit
from slosh_bringup.replay.task import (
    PAGES,
    Replayed,
    Task,
    remove_unfinished,
    replay_task,
    unique_names,
)
from slosh_model.model_text import read_model
from slosh_replay.manifest import NAME, Expectation, read_manifest, write_manifest
from slosh_replay.replay.checking import RECORDED
from slosh_replay.replay.result import Judged, ModelAccuracy
from slosh_report.run_report import RunVerdict
from slosh_report.run_report.index import MARK, IndexRow, index_document
from slosh_report.text import write_document
from slosh_report.text_table import aligned

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
    rows = [_index_row(each) for each in outcomes]
    write_document(folder / INDEX, index_document("Replayed bags", rows))


def _is_index(page: Path) -> bool:
    if not page.is_file():
        return False
    with page.open("rb") as file:
        return MARK.encode() in file.read(_HEAD)


def _index_row(outcome: ItemOutcome[Task, Replayed]) -> IndexRow:
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


DONE, FAILED, WRONG_INPUT = 0, 1, 2
HEADS = ("bag", "images", "dropped", "events", "estimates", "verdict")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh replay` to the argument parser."""
    parser.add_argument(
        "bags", type=Path, nargs="+", metavar="BAG",
        help="bag or folder of bags; if the folder has a manifest.yaml, only the bags that it "
        "lists",
    )  # fmt: skip
    parser.add_argument(
        "--model", type=Path, help="model.yaml to use (default: the recorded model)"
    )
    cell = parser.add_argument(
        "--namespace", dest="cell", metavar="NAMESPACE",
        help="namespace of the cell to replay, if the bag contains several cells, e.g. /slosh",
    )  # fmt: skip
    old_name(parser, cell, "--cell")
    add_input_options(parser)
    parser.add_argument(
        "-o", "--output", type=Path,
        help="folder for results: for each bag an HTML page, a JSON file and a bag of outputs; "
        "index.html for all",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the results as JSON")
    aim = parser.add_mutually_exclusive_group()
    aim.add_argument(
        "--check", action="store_true",
        help="exit with 1 unless each bag gives the results in its manifest.yaml or, without "
        "one, reproduces its recorded estimates bit for bit",
    )  # fmt: skip
    aim.add_argument(
        "--write-manifest", action="store_true",
        help="write the results of this replay to manifest.yaml; descriptions of the bags and "
        "tolerances are kept",
    )  # fmt: skip
    parser.add_argument(
        "--junit",
        type=Path,
        metavar="FILE",
        help="file for the results of the checks, as JUnit XML",
    )
    add_work_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Replays the bags; reports a bag that fails and continues with the other bags."""
    check_ending(arguments.junit, "the checks' results", JUNIT)
    stated = find_bags(arguments.bags, arguments.output)
    if arguments.model:
        read_model(arguments.model)  # a mistake in it is told once, not once per bag
    tasks = make_tasks(stated, arguments)
    check_outputs(stated, tasks, arguments.junit)
    if arguments.output:
        check_index(arguments.output, tasks)
        arguments.output.mkdir(parents=True, exist_ok=True)
    outcomes = replay_all(tasks, arguments)
    tell(outcomes)
    if arguments.output and any(outcome.value is not None for outcome in outcomes):
        write_index(arguments.output, outcomes)
        if all(outcome.value is not None for outcome in outcomes):
            FinishedWork(arguments.output).forget()  # it was not interrupted: the next one is new
    if arguments.json:
        print(json.dumps([_document(outcome) for outcome in outcomes], indent=2))
    else:
        print_tables(outcomes)
    if arguments.junit:
        write_junit(arguments.junit, "slosh replay", [_suite(outcome) for outcome in outcomes])
    if arguments.write_manifest:
        return _write_manifests(stated, outcomes)
    if arguments.check:
        good = sum(bool(_passed(outcome)) for outcome in outcomes)
        print(f"{good} of {len(outcomes)} bags as expected", file=sys.stderr)
        return DONE if good == len(outcomes) else FAILED
    if all(outcome.value is None for outcome in outcomes):
        return WRONG_INPUT
    failed = any(outcome.value is None or _passed(outcome) is False for outcome in outcomes)
    return FAILED if failed else DONE


def make_tasks(stated: Sequence[StatedBag], arguments: argparse.Namespace) -> list[Task]:
    """Creates one replay task per bag, with its options and expected results."""
    tasks = []
    given = wanted_input(arguments)
    for bag, name in zip(stated, unique_names([bag.path for bag in stated]), strict=True):
        expected = bag.expected
        model = arguments.model or (expected.model if expected else None)
        if arguments.write_manifest or (arguments.model and not arguments.check):
            expected = None  # what is stated is of another model
        elif expected is None and (arguments.check or bag.unstated):
            expected = RECORDED
        unstated = bag.unstated and expected is not None
        task = Task(
            bag.path, name, model, arguments.cell, arguments.output, expected, unstated,
            arguments.json, given,
        )  # fmt: skip
        # A cluster's workers have working directories of their own.
        tasks.append(task.absolute() if arguments.scheduler else task)
    return tasks


def check_outputs(stated: Sequence[StatedBag], tasks: Sequence[Task], junit: Path | None) -> None:
    """Raises an error if an output would overwrite a bag, a model or a manifest.

    Raises:
        SloshFileError: one would.
    """
    bags = [task.bag for task in tasks]
    outputs = [junit]
    for task in tasks:
        if task.output is not None:
            check_outside(task.output / task.name, bags)
            outputs += [task.output / f"{task.name}{suffix}" for suffix in PAGES]
    models = [task.model for task in tasks]
    manifests = [bag.manifest for bag in stated]
    files = [file for bag in bags for file in files_of(bag)]
    check_apart(outputs, [*files, *models, *manifests])


def replay_all(
    tasks: Sequence[Task], arguments: argparse.Namespace
) -> list[ItemOutcome[Task, Replayed]]:
    """Runs the replay tasks and returns their outcomes in the order of the tasks."""
    outcomes: list[ItemOutcome[Task, Replayed]] = []
    division = work_of([task.bag for task in tasks], arguments)
    work = map_files(replay_task, tasks, **division._asdict())
    try:
        with item_progress("replay", len(tasks), "bags") as progress, closing(work):
            for outcome in work:
                outcomes.append(outcome)
                progress.add()
    except BaseException:
        if arguments.scheduler is None:  # the processes of a cluster finish what they are at
            remove_unfinished(tasks)
        raise
    return sorted(outcomes, key=lambda outcome: outcome.index)


def tell(outcomes: Sequence[ItemOutcome[Task, Replayed]]) -> None:
    """Prints errors, warnings and failed checks of the replays, one line each."""
    before = sum(outcome.value is not None and outcome.value.before for outcome in outcomes)
    if before:
        said = f"{before} of {len(outcomes)} bags were replayed by the interrupted run"
        print(f"slosh replay: {said}", file=sys.stderr)
    for outcome in outcomes:
        item, expected = outcome.value, outcome.item.expected
        if item is None:
            told = named_error(outcome.item.bag, outcome.error)
            print(plain_line(f"slosh replay: {told}"), file=sys.stderr)
            continue
        for warning in item.warnings:
            announced = (expected.warnings if expected else None) or ()
            if not any(text in warning for text in announced):
                print(plain_line(f"slosh replay: warning: {warning}"), file=sys.stderr)
        for line in told_of_check(item):
            print(plain_line(f"slosh replay: {item.name}: {line}"), file=sys.stderr)


def told_of_check(item: Replayed) -> list[str]:
    """Returns the failed checks of a replay, and what could not be checked, one line each."""
    if item.checked is None:
        return []
    failures = item.checked.failures
    return [*failures, *(line for line in item.unchecked if line not in failures)]


def print_tables(outcomes: Sequence[ItemOutcome[Task, Replayed]]) -> None:
    """Prints each bag's results: MAE and peak error ε by model, and estimates not reproduced."""
    rows = [HEADS, *(_row(outcome) for outcome in outcomes)]
    if not any(_passed(outcome) is not None for outcome in outcomes):
        rows = [row[:-1] for row in rows]
    print("\n".join(aligned(rows, "<>>><<")))
    replayed = [outcome.value for outcome in outcomes if outcome.value is not None]
    groups: dict[tuple[str, ...], list[Replayed]] = {}
    for item in replayed:
        groups.setdefault(tuple(row.name for row in item.accuracy), []).append(item)
    for names, group in groups.items():
        if names:
            print("\n" + "\n".join(accuracy_lines(group)))
    for item in replayed:
        if item.checked is None:  # else they are among the failures
            for line in item.differences:
                print(plain_line(f"{item.name}: {line}"))


def _row(outcome: ItemOutcome[Task, Replayed]) -> tuple[str, ...]:
    item = outcome.value
    if item is None:
        return outcome.item.name, "", "", "", "not replayed", "FAILED"
    verdict = {None: "", True: "as expected", False: "FAILED"}[_passed(outcome)]
    return (item.name, *map(str, item.counts.values()), item.estimates, verdict)


def _passed(outcome: ItemOutcome[Task, Replayed]) -> bool | None:
    """Whether a bag meets its expected results, or None if it has none."""
    if outcome.item.expected is None:
        return None
    item = outcome.value
    return item is not None and item.checked is not None and item.checked.passed


def _document(outcome: ItemOutcome[Task, Replayed]) -> dict[str, Any]:
    if outcome.value is None:
        return {"name": outcome.item.name, "error": outcome.error}
    return dict(outcome.value.document)


def _suite(outcome: ItemOutcome[Task, Replayed]) -> Suite:
    name, item = outcome.item.name, outcome.value
    if item is None:
        return Suite(name, [Case("replay", error=outcome.error)])
    points = item.checked.points if item.checked else ()
    cases = [Case(point.name, failure=point.failure) for point in points]
    return Suite(name, [Case("replay"), *cases], item.seconds)


def _write_manifests(
    stated: Sequence[StatedBag], outcomes: Sequence[ItemOutcome[Task, Replayed]]
) -> int:
    """Writes the replay results as new expected results to the bags' manifests."""
    manifests: dict[Path, dict[str, Expectation]] = {}
    for bag, outcome in zip(stated, outcomes, strict=True):
        if outcome.value is not None:
            manifests.setdefault(bag.manifest, {})[bag.key] = outcome.value.expectation
    for manifest, expectations in manifests.items():
        write_manifest(manifest, expectations)
        print(f"{manifest}: {len(expectations)} bags", file=sys.stderr)
    return DONE if all(outcome.value is not None for outcome in outcomes) else FAILED


def accuracy_lines(results: Sequence[Judged]) -> list[str]:
    """Formats MAE and relative peak error ε by bag and model, and mean values for several bags.

    Args:
        results: at least one; all with the same models.
    """
    names = [row.name for row in results[0].accuracy]
    clocks = any(row.clock is not None for result in results for row in result.accuracy)
    heads = ["", *(f"MAE {name}" for name in names), *(f"ε {name}" for name in names)]
    rows = [[*heads, "clock"] if clocks else heads]
    rows += [_cells(result.name, result.accuracy, clocks) for result in results]
    if len(results) > 1:
        by_model = list(zip(*(result.accuracy for result in results), strict=True))
        sigma = [_mean([row.sigma for row in model]) for model in by_model]
        size = [_mean([abs(row.epsilon) for row in model]) for model in by_model]
        mean = ["mean (of ε, its size)", *map(_mm, sigma), *(f"{100 * x:.1f}" for x in size)]
        rows.append([*mean, ""] if clocks else mean)
    units = "MAE in mm, ε in %" + (", offset of the measured clock in s" if clocks else "")
    return [*aligned(rows, "<>"), units]


def _cells(name: str, accuracy: Sequence[ModelAccuracy], clocks: bool) -> list[str]:
    sigma = [_mm(row.sigma) for row in accuracy]
    cells = [name, *sigma, *(f"{100 * row.epsilon:+.1f}" for row in accuracy)]
    if not clocks:
        return cells
    clock = accuracy[-1].clock
    if clock is None:
        return [*cells, ""]
    return [*cells, f"{clock.offset:.3f}" + ("" if clock.unambiguous else " (ambiguous)")]


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return sum(known) / len(known) if known else math.nan


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.2f}"


@dataclass(frozen=True, slots=True)
class StatedBag:
    """A bag to replay, with its expected results from a manifest.

    Attributes:
        path: folder or file.
        manifest: where it is or would be stated; the file may not exist.
        key: its name there.
        expected: what is stated; None: nothing.
        unstated: the folder's manifest names other bags and not this one.
    """

    path: Path
    manifest: Path
    key: str
    expected: Expectation | None = None
    unstated: bool = False


def find_bags(paths: Sequence[Path], output: Path | None = None) -> list[StatedBag]:
    """Finds the bags in the given paths and returns each of them once.

    Args:
        paths: bags, and folders of bags with or without a manifest.
        output: folder of results; bags in it are none that are meant.

    Raises:
        SloshBringupError: there is nothing at a path.
        SloshBagError: a folder holds no bag, or a manifest cannot be read.
    """
    found: dict[Path, StatedBag] = {}
    for path in paths:
        if not path.exists():
            raise SloshBringupError(f"{path}: no such file or folder")
        for bag in _of_folder(path, output) if _is_collection(path) else [_single(path)]:
            found.setdefault(bag.path.resolve(), bag)
    return list(found.values())


def _is_collection(path: Path) -> bool:
    """Whether a folder is a collection of bags, rather than a single bag."""
    return path.is_dir() and ((path / NAME).is_file() or not any(path.glob("*.mcap")))


def _single(path: Path) -> StatedBag:
    """Returns a single bag with its entry in the manifest of the parent folder."""
    manifest = path.resolve().parent / NAME
    stated = read_manifest(manifest) if manifest.is_file() else {}
    return StatedBag(path, manifest, path.resolve().name, stated.get(path.resolve().name))


def _of_folder(folder: Path, output: Path | None) -> list[StatedBag]:
    manifest = folder / NAME
    stated: Mapping[str, Expectation] = read_manifest(manifest) if manifest.is_file() else {}
    bags = {path.parent for path in folder.glob("**/*.mcap") if path.parent != folder}
    bags |= set(folder.glob("*.mcap"))
    if output is not None:
        bags = {bag for bag in bags if output.resolve() not in bag.resolve().parents}
    bags |= {folder / name for name in stated}
    if not bags:
        bag_files(folder)  # says what is there instead
    keys = {bag.relative_to(folder).as_posix(): bag for bag in sorted(bags)}
    return [
        StatedBag(bag, manifest, key, stated.get(key), manifest.is_file() and key not in stated)
        for key, bag in keys.items()
    ]
