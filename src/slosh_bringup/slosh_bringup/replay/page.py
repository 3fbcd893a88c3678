"""HTML page and JSON file with the results of a replay."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Final, NamedTuple

from slosh_bag.reader import BagReader
from slosh_base.files import write_text
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.replay.containers import further_containers
from slosh_bringup.replay.frames import bag_pictures, bag_topics
from slosh_motion.recorded.sources import CellTopics, event_lines
from slosh_replay.in_force import described, in_force, last_starts, parameter_changes
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import ReplayResult
from slosh_replay.replay.checking import CheckedReplay
from slosh_replay.replay.report import (
    Surroundings,
    recorded_at,
    replay_report,
    report_start,
)
from slosh_report.run_report import Fact, RunReport, render_report, report_document

TOPIC: Final = "prediction_outcome"
MESSAGE_TYPE: Final = "slosh_msgs/msg/PredictionOutcome"


def write_page(
    folder: Path, run: RecordedRun, result: ReplayResult, checked: CheckedReplay | None
) -> None:
    """Writes the replay's page FOLDER/<name>.html and its results FOLDER/<name>.json.

    Args:
        folder: of the results.
        run: where the images and the topics are.
        result: the replay.
        checked: against what was expected.

    Raises:
        SloshBringupError: a file cannot be written.
    """
    around = Surroundings(checked=checked, facts=_facts(run, result))
    report = make_report(run, result, around)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_text(folder / f"{result.name}.html", render_report(report))
        write_text(folder / f"{result.name}.json", figures(report, result))
    except OSError as error:
        raise SloshBringupError(f"{error.filename or folder}: {error.strerror}") from None


def _facts(run: RecordedRun, result: ReplayResult) -> tuple[Fact, ...]:
    """Returns date, settings, model and program version of a replay; all are reproducible."""
    facts = {"recorded": recorded_at(result), **in_force(last_starts(run))}
    if result.model is not None:
        facts["model"] = described(result.model)
    facts["replayed by"] = f"slosh {version('slosh_bringup')}"
    return tuple(Fact(label, text) for label, text in facts.items())


def figures(report: RunReport, result: ReplayResult) -> str:
    """Returns the numbers of a replay's page as JSON, at full precision."""
    document = {**report_document(report), "replay": json.loads(result.to_json(series=True))}
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def make_report(run: RecordedRun, result: ReplayResult, around: Surroundings) -> RunReport:
    """Creates the report of a replay, with the bag's images, predictions and topics.

    Args:
        run: where these are.
        result: the replay.
        around: what else the page shows.
    """
    planned = [
        Fact(f"planned motion {motion.id}", motion.sentence)
        for motion in predicted_motions(run.reader)
    ]
    start_ns = report_start(result)
    notes = (*event_lines(run.facts, start_ns), *parameter_changes(run, start_ns))
    around = replace(around, facts=(*around.facts, *planned), notes=(*around.notes, *notes))
    pictures, topics = bag_pictures(run, result), bag_topics(run, result.seconds)
    report = replay_report(result, replace(around, frames=pictures, topics=topics))
    return replace(report, further=further_containers(run, result))


class PredictedMotion(NamedTuple):
    """A planned motion with its predicted, estimated and measured peak heights [m].

    Attributes:
        id: counts the planned trajectories.
        predicted, estimated, measured: highest heights [m].
        counted: whether what ran was what was planned.
    """

    id: int
    predicted: float
    estimated: float
    measured: float
    counted: bool

    @property
    def sentence(self) -> str:
        """Describes the predicted, estimated and measured peak heights in one sentence."""
        heights = (
            f"highest {1e3 * self.predicted:.1f} mm predicted, {1e3 * self.estimated:.1f} mm "
            f"estimated, {1e3 * self.measured:.1f} mm measured"
        )
        return heights if self.counted else f"{heights}; not the motion that was planned"


def predicted_motions(reader: BagReader) -> tuple[PredictedMotion, ...]:
    """Returns the planned motions that were recorded for the bag's first cell, in order.

    Raises:
        SloshBagError: the bag cannot be read.
    """
    topic = CellTopics(reader).topic(TOPIC, MESSAGE_TYPE)
    if topic is None:
        return ()
    outcomes = [reader.decode(message) for message in reader.messages({topic})]
    return tuple(
        PredictedMotion(one.id, one.predicted, one.estimated, one.measured, bool(one.counted))
        for one in outcomes
    )
