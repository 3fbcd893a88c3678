"""The report of a live run, written however the run ended."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from slosh_bag.black_box.event_bags import event_bags
from slosh_bag.errors import SloshBagError
from slosh_base.files import write_text
from slosh_bringup.live.run_data import HEIGHTS, RunData, read_run
from slosh_bringup.live.run_result import RunResult, evaluate
from slosh_bringup.live.shortfall import shortfall, slowness
from slosh_bringup.replay.by_journal import checked_by_journal
from slosh_bringup.replay.frames import bag_topics
from slosh_bringup.replay.page import make_report
from slosh_replay.in_force import in_force, last_starts
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import ReplayResult, replay_bag
from slosh_replay.replay.checking import RECORDED, check_result
from slosh_replay.replay.report import Surroundings
from slosh_report.run_report import (
    Fact,
    KeyFigure,
    RunReport,
    RunVerdict,
    Status,
    render_report,
    report_document,
)

REPORT, RESULT = "report.html", "result.json"
MOST_NAMED = 10
"""Bags of events that one line names."""
NOTHING = "nothing was measured, because "


@dataclass(frozen=True, slots=True)
class LiveResult:
    """Results of a live run.

    Attributes:
        figures: of what was recorded; None: the bag cannot be read.
        replayed: the recording through the cores; None: it cannot be.
        reasons: why nothing was compared, one line each; empty: something was.
        warnings: what went wrong beside that, one line each.
        in_force: limits, topics, model and calibration, as text by what it is about.
        failures: those of the warnings for which a run has failed although it was compared.
    """

    figures: RunResult | None = None
    replayed: ReplayResult | None = None
    reasons: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    in_force: Mapping[str, str] = field(default_factory=dict)
    failures: tuple[str, ...] = ()

    @property
    def nothing(self) -> str:
        """The reasons why there are no results, in one sentence; empty if there are results."""
        return NOTHING + "; ".join(self.reasons) if self.reasons else ""

    def document(self) -> dict[str, Any]:
        """Returns the results of the live run for JSON."""
        figures = self.figures.document() if self.figures else {}
        return {
            **figures,
            "nothing_because": list(self.reasons),
            "problems": list(self.warnings),
            "in_force": dict(self.in_force),
        }


@dataclass(frozen=True, slots=True)
class LiveReport:
    """HTML page and numeric results of a live run.

    Attributes:
        result: the figures.
        page: the report, as HTML.
        text: the figures, as JSON.
    """

    result: LiveResult
    page: str
    text: str

    def write(self, folder: Path) -> None:
        """Writes the report's page and JSON file; recreates the folder if it was deleted.

        Raises:
            OSError: that is not possible; it bears the file's path.
        """
        folder.mkdir(parents=True, exist_ok=True)
        write_text(folder / REPORT, self.page)
        write_text(folder / RESULT, self.text)


def make_live_report(
    bag: Path,
    title: str,
    problems: tuple[str, ...] = (),
    *,
    began: bool = True,
    events: bool = False,
) -> LiveReport:
    """Creates the report of a live run by reading and replaying its bag.

    Args:
        bag: what was recorded, if anything was.
        title: of the report.
        problems: what went wrong while it ran, one line each; of a run without measurements they
            are the first reasons.
        began: whether the nodes were ready; if not, the problems are the only reasons.
        events: whether events alone were recorded.
    """
    bags = event_bags(bag)
    if bags or (events and began):
        result = LiveResult(warnings=(*problems, _events_line(bag, bags)))
        report = _recorded_report(title, None, result)
    else:
        result, report = _evaluated(bag, title, problems, began)
    document = {**result.document(), **report_document(report)}
    return LiveReport(result, render_report(report), json.dumps(document, indent=2) + "\n")


def _events_line(folder: Path, bags: Sequence[Path]) -> str:
    """Describes the recorded event bags in one line, with the command that replays them."""
    if not bags:
        return "no event was recorded"
    names = ", ".join(bag.name for bag in bags[-MOST_NAMED:])
    more = "..., " if len(bags) > MOST_NAMED else ""
    return f"{len(bags)} bags of events: {more}{names}; to replay them: slosh replay {folder}"


def latency_figure(run: RunResult) -> KeyFigure:
    """Returns the key figure for the latency from an image's exposure to its comparison [ms]."""
    median, greatest = run.latency.get("monitor", (math.nan, math.nan))
    note = "image to comparison, median"
    if math.isfinite(greatest):
        note += f"; at most {1e3 * greatest:.0f} ms"
    return KeyFigure("latency", median, "ms", note)


def _evaluated(
    bag: Path, title: str, problems: tuple[str, ...], began: bool
) -> tuple[LiveResult, RunReport]:
    try:
        run = RecordedRun(bag)
        data, starts = read_run(run), last_starts(run)
    except SloshBagError as error:
        unread = (f"nothing was recorded: {error}",) if began else ()
        result = LiveResult(reasons=(*problems, *unread))
        return result, _recorded_report(title, None, result)
    figures = evaluate(data)
    failures = tuple(filter(None, (figures.lost_line, data.mixed)))
    problems = tuple(filter(None, (*problems, slowness(data), *failures)))
    reasons: tuple[str, ...] = ()
    if not figures.compared:
        missing = shortfall(data, starts) if began else ()
        reasons = (*problems, *missing) if missing or not began else ()
    result = LiveResult(figures, None, reasons, problems, in_force(starts), failures)
    try:
        replayed = checked_by_journal(replay_bag(run), run)
    except SloshBagError as error:
        if not reasons:  # they tell that nothing drove the models
            line = f"not replayed: {error}"
            told, failed = (*problems, line), (*failures, line)
            result = replace(result, warnings=told, failures=failed)
        return result, _recorded_report(title, data, result)
    if not reasons:
        differs = check_result(replayed, RECORDED).failures
        result = replace(result, failures=(*failures, *differs), warnings=(*problems, *differs))
    return replace(result, replayed=replayed), _replayed_report(title, run, result, replayed)


def _replayed_report(
    title: str, run: RecordedRun, result: LiveResult, replayed: ReplayResult
) -> RunReport:
    """Creates the report from a replay of the recorded run, with data of the live run."""
    around = Surroundings(title=title, facts=_facts(result))
    if result.figures is not None:
        figures = (latency_figure(result.figures),)
        around = replace(around, key_figures=figures)
    report = make_report(run, replayed, around)
    told = tuple(result.failures)
    warnings = (*result.warnings, *(line for line in report.warnings if not line.endswith(told)))
    return replace(report, warnings=warnings, status=_status(result, report.status))


def _recorded_report(title: str, data: RunData | None, result: LiveResult) -> RunReport:
    """Creates the report from the heights that the monitor compared live, without a replay."""
    stamps = data.stamps if data else np.empty(0, dtype=np.int64)
    columns = data.columns if data else dict.fromkeys(HEIGHTS, np.empty(0))
    order = np.argsort(stamps)
    t = np.asarray((stamps[order] - stamps[order[:1]]) * 1e-9, dtype=np.float64)
    return RunReport(
        title=title,
        t=t,
        measured=columns["measured"][order],
        linear=columns["estimated_linear"][order],
        nonlinear=columns["estimated_nonlinear"][order],
        status=_status(result, Status()),
        facts=_facts(result),
        topics=bag_topics(data.run, float(t[-1]) if len(t) else 0.0) if data else (),
        warnings=(*result.warnings, *(data.warnings if data else ())),
    )


def _status(result: LiveResult, otherwise: Status) -> Status:
    if result.reasons:
        return Status(RunVerdict.FAILED, (result.nothing,))
    return Status(RunVerdict.FAILED, result.failures) if result.failures else otherwise


def _facts(result: LiveResult) -> tuple[Fact, ...]:
    now = datetime.now(UTC)
    made = f"{now:%Y-%m-%d %H:%M:%S} UTC on {platform.node()}, slosh {version('slosh_bringup')}"
    facts = [Fact("made", made)]
    facts += [Fact(label, text) for label, text in result.in_force.items()]
    if result.figures is not None:
        lost = str(sum(result.figures.lost.values()))
        facts.append(Fact("messages lost", lost))
        facts += [Fact(*row) for row in result.figures.rows.items()]
    return tuple(facts)
