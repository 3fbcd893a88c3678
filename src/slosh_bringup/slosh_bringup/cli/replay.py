"""`slosh replay`: the estimator's and the monitor's cores over bags, no DDS, no clock."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from slosh_bag.errors import SloshBagError
from slosh_bag.manifest import NAME, Expectation, read_manifest, write_manifest
from slosh_bag.reader import bag_files
from slosh_bag.replay.result import accuracy_table
from slosh_bringup.cli.progress import item_progress
from slosh_bringup.junit import Case, write_junit
from slosh_bringup.many_files import Outcome, map_files
from slosh_bringup.replaying import NOT_STATED, RECORDED, Replayed, Task, replay_task, unique_names
from slosh_estimator.model_file import read_model

DONE, FAILED, WRONG_INPUT = 0, 1, 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument(
        "bags", type=Path, nargs="+", metavar="BAG",
        help="bag, or folder of bags; with a manifest.yaml in it, those that it names",
    )  # fmt: skip
    parser.add_argument("--model", type=Path, help="model.yaml; without it the recorded model")
    parser.add_argument(
        "-o", "--output", type=Path, help="gets a page, the figures and a bag of outputs per bag"
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.add_argument(
        "--check", action="store_true",
        help="exit 1 unless each bag gives what its manifest.yaml states or, without one, its "
        "own estimates again, bit for bit",
    )  # fmt: skip
    parser.add_argument("--junit", type=Path, metavar="FILE", help="the checks as JUnit XML")
    parser.add_argument(
        "--write-manifest", action="store_true",
        help="state in manifest.yaml what the replays give now; what each bag shows is kept",
    )  # fmt: skip
    parser.add_argument("--jobs", type=int, help="processes; without it one per core")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster to run on")


def run(arguments: argparse.Namespace) -> int:
    """Replays the bags; one that cannot be replayed is told and does not stop the others."""
    tasks = make_tasks(arguments)
    if arguments.model:
        read_model(arguments.model)  # a mistake in it is told once, not once per bag
    outcomes: list[Outcome[Task, Replayed]] = []
    with item_progress("replay", len(tasks), "bag") as progress:
        for outcome in map_files(
            replay_task, tasks, jobs=arguments.jobs, scheduler=arguments.scheduler
        ):
            outcomes.append(outcome)
            progress.update()
    replayed = [outcome.value for outcome in outcomes if outcome.value is not None]
    tell(outcomes)
    if arguments.json:
        print(json.dumps([item.document for item in replayed], indent=2))
    else:
        print_tables(replayed)
    if arguments.junit:
        write_junit(arguments.junit, "slosh replay", [_cases(outcome) for outcome in outcomes])
    if arguments.write_manifest:
        return _write_manifests(outcomes)
    if arguments.check:
        good = sum(item.checked is not None and item.checked.passed for item in replayed)
        print(f"{good} of {len(tasks)} bags as expected", file=sys.stderr)
        return DONE if good == len(tasks) else FAILED
    return DONE if replayed else WRONG_INPUT


def make_tasks(arguments: argparse.Namespace) -> list[Task]:
    """What is to be replayed.

    Raises:
        SloshBagError: there is no bag, or a manifest cannot be read.
    """
    found: dict[Path, Expectation | None] = {}
    for path in arguments.bags:
        found.update(_stated(path) if path.is_dir() else {path: _of_parent(path)})
    if arguments.write_manifest:
        found = dict.fromkeys(found)
    unchecked = RECORDED if arguments.check else None
    return [
        Task(bag, name, arguments.model, arguments.output, expected or unchecked)
        for (bag, expected), name in zip(found.items(), unique_names(list(found)), strict=True)
    ]


def _stated(folder: Path) -> dict[Path, Expectation | None]:
    """A bag, or the bags of a folder, with what a manifest states of them."""
    if any(folder.glob("*.mcap")) and not (folder / NAME).is_file():
        bag_files(folder)  # tells at once what is wrong with it
        return {folder: _of_parent(folder)}
    manifest = folder / NAME
    stated = read_manifest(manifest) if manifest.is_file() else {}
    bags = {path.parent for path in folder.glob("**/*.mcap") if path.parent != folder}
    bags |= set(folder.glob("*.mcap")) | {folder / name for name in stated}
    if not bags:
        raise SloshBagError(f"{folder}: no .mcap file in this folder or below it")
    if not stated:
        return dict.fromkeys(sorted(bags))
    return {
        bag: stated.get(bag.relative_to(folder).as_posix(), NOT_STATED) for bag in sorted(bags)
    }


def _of_parent(bag: Path) -> Expectation | None:
    """What the manifest beside a bag states of it; None: there is none."""
    manifest = bag.resolve().parent / NAME
    return read_manifest(manifest).get(bag.name) if manifest.is_file() else None


def tell(outcomes: Sequence[Outcome[Task, Replayed]]) -> None:
    """Errors, warnings and failed checks, one line each."""
    for outcome in outcomes:
        if outcome.value is None:
            print(f"slosh replay: {outcome.error}", file=sys.stderr)
            continue
        item = outcome.value
        expected = outcome.item.expected
        for warning in item.warnings:
            if expected is None or not any(text in warning for text in expected.warnings):
                print(f"slosh replay: warning: {warning}", file=sys.stderr)
        for failure in item.checked.failures if item.checked else ():
            print(f"slosh replay: {item.name}: {failure}", file=sys.stderr)


def print_tables(replayed: Sequence[Replayed]) -> None:
    """σ and ε by bag and model; what was recorded against what came out."""
    groups: dict[tuple[str, ...], list[Replayed]] = {}
    for item in replayed:
        groups.setdefault(tuple(row.name for row in item.accuracy), []).append(item)
    for names, group in groups.items():
        if names:
            print(accuracy_table(group))
    for item in replayed:
        counts = ", ".join(f"{count} {name}" for name, count in item.counts.items())
        verdict = (
            ""
            if item.checked is None
            else "; " + ("as expected" if item.checked.passed else "NOT AS EXPECTED")
        )
        told = item.checked is not None and not item.checked.passed  # among the failures
        lines = () if told else item.lines
        print("\n".join(f"{item.name}: {line}" for line in (*lines, counts + verdict)))


def _cases(outcome: Outcome[Task, Replayed]) -> tuple[str, list[Case]]:
    name = outcome.item.name
    if outcome.value is None:
        return name, [Case("replay", error=outcome.error)]
    checked = outcome.value.checked
    points = checked.points if checked else ()
    return name, [Case("replay"), *(Case(point.name, failure=point.failure) for point in points)]


def _write_manifests(outcomes: Sequence[Outcome[Task, Replayed]]) -> int:
    """States what the replays gave, in the manifest of each folder of bags."""
    by_folder: dict[Path, dict[str, Expectation]] = {}
    for outcome in outcomes:
        if outcome.value is not None:
            bag = outcome.item.bag
            by_folder.setdefault(bag.parent, {})[bag.name] = outcome.value.expectation
    for folder, expectations in by_folder.items():
        write_manifest(folder / NAME, expectations)
        print(f"{folder / NAME}: {len(expectations)} bags", file=sys.stderr)
    return DONE if all(outcome.value is not None for outcome in outcomes) else FAILED
