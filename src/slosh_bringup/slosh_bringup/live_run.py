"""Runs a cell's nodes, records, and reports: the body of `slosh demo` and `slosh cell`."""

from __future__ import annotations

import json
import math
import os
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from slosh_bag.errors import SloshBagError
from slosh_bag.replay import ReplayResult, replay_bag
from slosh_bag.replay.report import Surroundings
from slosh_bag.replay.settings import NodeStart
from slosh_bringup.cell_setup import CellSetup
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.in_force import (
    TELLING,
    in_force,
    in_force_lines,
    recorded_starts,
    settings_document,
)
from slosh_bringup.parameter_file import check_parameter_file
from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_bringup.replay_page import make_report
from slosh_bringup.run_data import read_run
from slosh_bringup.run_result import RunResult, evaluate
from slosh_bringup.stop_request import StopRequest
from slosh_camera.calibration import read_any_calibration
from slosh_discovery.report import Fact, KeyFigure, render_report, report_document
from slosh_estimator.model_file import read_model

POLL = 0.1
# What a run writes into its folder; only these are replaced by the next run.
BAG, LOGS = "bag", "logs"
REPORT, RESULT, SETTINGS = "report.html", "result.json", "settings.yaml"


def prepare_folder(folder: Path) -> None:
    """Makes room for a run: removes an earlier run's own files, nothing else.

    Raises:
        SloshBringupError: the folder cannot be used.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in (BAG, LOGS):
            shutil.rmtree(folder / name, ignore_errors=True)
        for name in (REPORT, RESULT, SETTINGS):
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise SloshBringupError(f"{folder}: {error.strerror}") from None


def check_files(setup: CellSetup) -> None:
    """Reads the cell's files once, so that a mistake is told before any process starts.

    Raises:
        ValueError: of the package that reads the file; one line.
    """
    read_model(setup.model)
    read_any_calibration(setup.calibration)
    check_parameter_file(setup.parameters, setup.namespace)


class Screen(Protocol):
    """Whoever watches a run."""

    def show(self, elapsed: float, text: str) -> None:
        """Is shown how long it has taken [s] and what is going on, ten times a second."""

    def tell(self, line: str) -> None:
        """Is told what has happened."""


@dataclass(frozen=True, slots=True)
class LiveRun:
    """What is run.

    Attributes:
        command: the subcommand.
        setup: the cell.
        folder: where the results go.
        title: of the report.
        simulated: the simulated cell; None: a robot speaks.
    """

    command: str
    setup: CellSetup
    folder: Path
    title: str
    simulated: NodeProcess | None = None


def run_nodes(run: LiveRun, screen: Screen, stop: StopRequest) -> None:
    """Runs the nodes until the simulated cell is through or a stop is asked for.

    Args:
        run: the cell, and where the bag, the logs and what is in force go.
        screen: of whoever watches.
        stop: asks for the end.

    Raises:
        SloshBringupError: a node ended with an error.
    """
    # With ROS, which a wrong option need not wait for.
    from slosh_bringup.nodes.cell_listener import CellListener

    # A demonstration keeps to itself; a cell talks to the robot on the user's domain.
    environment = node_environment(1 + os.getpid() % 100 if run.simulated else None)
    os.environ.update(environment)
    told = _Told(run.folder, screen.tell)
    with (
        NodeGroup(run.setup.namespace, run.folder / LOGS, environment) as group,
        CellListener(run.setup.namespace, told.add) as listener,
    ):
        for process in run.setup.processes(run.folder / BAG):
            group.start(process)
        if run.simulated is not None:
            group.start(run.simulated)
        started = time.monotonic()
        while not stop.reason and "cell" not in group.ended():
            group.check()
            screen.show(time.monotonic() - started, "running")
            listener.listen(POLL)
        if stop.reason:
            screen.show(time.monotonic() - started, "stopping")
        else:
            group.check()


class _Told:
    """What the nodes have told that they work with: printed and written once all have."""

    def __init__(self, folder: Path, tell: Callable[[str], None]) -> None:
        self._folder, self._tell = folder, tell
        self._starts: dict[str, NodeStart] = {}

    @property
    def all_told(self) -> bool:
        """Whether each node that works with something has told with what."""
        return self._starts.keys() >= set(TELLING)

    def add(self, start: NodeStart) -> None:
        """Takes what a node tells, at its start or later."""
        told, self._starts[start.node] = self.all_told, start
        write_whole({self._folder / SETTINGS: settings_document(self._starts)})
        if self.all_told and not told:
            self._tell("in force:")
            for line in in_force_lines(self._starts):
                self._tell(f"  {line}")


def write_results(folder: Path, title: str) -> tuple[RunResult, ReplayResult]:
    """Reads and replays the bag, and writes the report and the figures.

    Raises:
        SloshBringupError: what was recorded cannot be replayed.
    """
    bag = folder / BAG
    try:
        run = evaluate(read_run(bag))
        replayed = replay_bag(bag)
        starts = recorded_starts(bag)
    except SloshBagError as error:
        raise SloshBringupError(f"no report: {error} (logs in {folder / LOGS})") from None
    lost = Fact("messages lost on the way to the bag", str(sum(run.lost.values())))
    worked_with = in_force(starts)
    facts = (*(Fact(label, text) for label, text in worked_with.items()), lost)
    around = Surroundings(title=title, key_figures=(latency_figure(run),), facts=facts)
    report = make_report(bag, replayed, around)
    document = {**run.document(), "in_force": worked_with, **report_document(report)}
    texts = {REPORT: render_report(report), RESULT: json.dumps(document, indent=2) + "\n"}
    write_whole({folder / name: text for name, text in texts.items()})
    return run, replayed


def write_whole(texts: Mapping[Path, str]) -> None:
    """Writes files that are there whole or not at all, whenever the process ends."""
    parts = {path: path.with_name(f".{path.name}.part") for path in texts}
    try:
        for path, part in parts.items():
            part.write_text(texts[path], encoding="utf-8")
        for path, part in parts.items():
            part.replace(path)
    finally:
        for part in parts.values():
            part.unlink(missing_ok=True)


def latency_figure(run: RunResult) -> KeyFigure:
    """From an image's exposure to its comparison, which only a live run has."""
    median, greatest = run.latency.get("monitor", (math.nan, math.nan))
    note = "image to comparison, median"
    if math.isfinite(greatest):
        note += f"; at most {1e3 * greatest:.0f} ms"
    return KeyFigure("latency", median, "ms", note)
