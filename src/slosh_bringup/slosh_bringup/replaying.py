"""Replays one bag and writes its page, its figures and its outputs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from slosh_bag.manifest import Expectation
from slosh_bag.replay import ReplayResult, replay_bag
from slosh_bag.replay.checking import (
    Checked,
    check_result,
    dropped,
    excesses,
    expectation_of,
)
from slosh_bag.replay.output_bag import OutputBag
from slosh_bag.replay.report import Surroundings, replay_report
from slosh_bag.replay.result import ModelAccuracy
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.replay_frames import bag_pictures, bag_topics
from slosh_discovery.report import RunReport, render_report, report_document
from slosh_estimator.model_file import read_model

UNCHECKED = Expectation()
RECORDED = Expectation(tolerance=0.0)
"""What a bag without a manifest must give: its own estimates again."""
NOT_STATED = Expectation(tolerance=0.0, warnings=("to be stated in the manifest",))
"""What a bag must give that lies beside a manifest which does not name it: it cannot."""


@dataclass(frozen=True, slots=True)
class Task:
    """A bag to replay.

    Attributes:
        bag: folder or file.
        name: of its results.
        model: file to replay with; None: the recorded model.
        output: folder of the results; None: none are written.
        expected: what the replay must give; None: nothing.
    """

    bag: Path
    name: str
    model: Path | None = None
    output: Path | None = None
    expected: Expectation | None = None


@dataclass(frozen=True, slots=True)
class Replayed:
    """What is told of a replayed bag: small, whatever the bag's length.

    Attributes:
        name: of the bag.
        accuracy: of each model.
        checked: against what was expected; None: nothing was.
        lines: how recorded and replayed estimates compare.
        warnings: about the bag.
        counts: images, dropped samples and excesses of limits.
        document: all figures, as JSON has them.
        expectation: what a manifest would state of it now.
    """

    name: str
    accuracy: tuple[ModelAccuracy, ...]
    checked: Checked | None
    lines: tuple[str, ...]
    warnings: tuple[str, ...]
    counts: Mapping[str, int]
    document: Mapping[str, Any]
    expectation: Expectation


def replay_task(task: Task) -> Replayed:
    """Replays a bag.

    Raises:
        SloshBagError: it cannot be replayed.
        SloshBringupError: a result cannot be written.
    """
    expected = task.expected or UNCHECKED
    model_file = task.model or expected.model
    model = read_model(model_file) if model_file else None
    if task.output is None:
        result = replay_bag(task.bag, model)
    else:
        with OutputBag(_new_folder(task.output / task.name)) as outputs:
            result = replay_bag(task.bag, model, outputs=outputs)
    result = replace(result, name=task.name)
    checked = check_result(result, expected) if task.expected is not None else None
    if task.output is not None:
        write_page(task.output, task.bag, result, checked)
    return Replayed(
        task.name,
        result.accuracy,
        checked,
        result.verification.lines() if result.verification else (),
        result.warnings,
        {
            "images": result.counters.get("images", 0),
            "dropped": dropped(result),
            "events": len(excesses(result.events)),
        },
        json.loads(result.to_json()),
        expectation_of(result),
    )


def write_page(folder: Path, bag: Path, result: ReplayResult, checked: Checked | None) -> None:
    """Writes FOLDER/<name>.html and FOLDER/<name>.json.

    Args:
        folder: of the results.
        bag: where the images and the topics are.
        result: the replay.
        checked: against what was expected.

    Raises:
        SloshBringupError: a file cannot be written.
    """
    report = make_report(bag, result, Surroundings(checked=checked))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{result.name}.html").write_text(render_report(report), encoding="utf-8")
        (folder / f"{result.name}.json").write_text(figures(report, result))
    except OSError as error:
        raise SloshBringupError(f"{folder}: {error.strerror}") from None


def figures(report: RunReport, result: ReplayResult) -> str:
    """The numbers of a page as JSON, in full precision, with the whole replay under `replay`."""
    document = {**report_document(report), "replay": json.loads(result.to_json(series=True))}
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def make_report(bag: Path, result: ReplayResult, around: Surroundings) -> RunReport:
    """What the page of a replay shows, with the bag's own images and topics.

    Args:
        bag: where these are.
        result: the replay.
        around: what else the page shows.
    """
    pictures, topics = bag_pictures(bag, result), bag_topics(bag, result.seconds)
    return replay_report(result, replace(around, frames=pictures, topics=topics))


def unique_names(bags: Sequence[Path]) -> list[str]:
    """A name for each bag: its own, with those of its parents where several bags share it."""
    parts = [path.resolve().with_suffix("").parts[1:] for path in bags]
    names = []
    for own in parts:
        depth = 1
        while depth < len(own) and sum(other[-depth:] == own[-depth:] for other in parts) > 1:
            depth += 1
        names.append("-".join(own[-depth:]))
    return names


def _new_folder(folder: Path) -> Path:
    """A folder of an earlier replay is replaced: only files that a replay writes are removed.

    Raises:
        SloshBringupError: it holds something else.
    """
    if folder.is_dir():
        strange = [path for path in folder.iterdir() if not _is_output(folder, path)]
        if strange:
            raise SloshBringupError(
                f"{folder}: holds {strange[0].name}, which is no replay's output; "
                "choose another folder"
            )
        for path in folder.iterdir():
            path.unlink()
    return folder


def _is_output(folder: Path, path: Path) -> bool:
    return path.name == "metadata.yaml" or (
        path.suffix == ".mcap" and path.name.startswith(folder.name)
    )
