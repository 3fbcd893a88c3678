"""Runs a cell's nodes, records, and reports: the body of `slosh demo` and `slosh cell`."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from slosh_bag.errors import SloshBagError
from slosh_bag.replay import ReplayResult, replay_bag
from slosh_bag.replay.report import Surroundings
from slosh_bringup.cell_setup import CellSetup
from slosh_bringup.errors import SloshBringupError
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
BAG, LOGS, REPORT, RESULT = "bag", "logs", "report.html", "result.json"

Progress = Callable[[float, str], None]


def prepare_folder(folder: Path) -> None:
    """Makes room for a run: removes an earlier run's own files, nothing else.

    Raises:
        SloshBringupError: the folder cannot be used.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in (BAG, LOGS):
            shutil.rmtree(folder / name, ignore_errors=True)
        for name in (REPORT, RESULT):
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise SloshBringupError(f"{folder}: {error.strerror}") from None


def check_files(setup: CellSetup) -> None:
    """Reads the cell's files once, so that a mistake is told before any process starts."""
    read_model(setup.model)
    read_any_calibration(setup.calibration)


def run_nodes(
    setup: CellSetup,
    folder: Path,
    progress: Progress,
    stop: StopRequest,
    simulated: NodeProcess | None = None,
) -> None:
    """Runs the nodes until the simulated cell is through or a stop is asked for.

    Args:
        setup: the cell.
        folder: where the bag and the logs go.
        progress: told the elapsed time [s] and what is going on, ten times a second.
        stop: asks for the end.
        simulated: the simulated cell; None: a robot speaks.

    Raises:
        SloshBringupError: a node ended with an error.
    """
    # A demonstration keeps to itself; a cell talks to the robot on the user's domain.
    domain = 1 + os.getpid() % 100 if simulated else None
    environment = node_environment(domain)
    processes = setup.processes(folder / BAG) + ([simulated] if simulated else [])
    tell = stop.guarded(progress)
    with NodeGroup(setup.namespace, folder / LOGS, environment) as group:
        for process in processes:
            group.start(process)
        started = time.monotonic()
        while not stop.reason and (simulated is None or "cell" not in group.ended()):
            group.check()
            tell(time.monotonic() - started, "running")
            time.sleep(POLL)
        if stop.reason:
            tell(time.monotonic() - started, "stopping")
        else:
            group.check()


def write_results(folder: Path, title: str) -> tuple[RunResult, ReplayResult]:
    """Reads and replays the bag, and writes the report and the figures.

    Raises:
        SloshBringupError: what was recorded cannot be replayed.
    """
    bag = folder / BAG
    try:
        run = evaluate(read_run(bag))
        replayed = replay_bag(bag)
    except SloshBagError as error:
        raise SloshBringupError(f"no report: {error} (logs in {folder / LOGS})") from None
    lost = Fact("messages lost on the way to the bag", str(sum(run.lost.values())))
    around = Surroundings(title=title, key_figures=(latency_figure(run),), facts=(lost,))
    report = make_report(bag, replayed, around)
    document = {**run.document(), **report_document(report)}
    texts = {REPORT: render_report(report), RESULT: json.dumps(document, indent=2) + "\n"}
    write_whole({folder / name: text for name, text in texts.items()})
    return run, replayed


def without_report(command: str, folder: Path) -> int:
    """Says where a run is whose report the user did not wait for; returns the exit code."""
    bag = folder / BAG
    print(
        f"slosh {command}: no report, as asked; the recording is whole: "
        f"slosh replay {bag} -o {folder}",
        file=sys.stderr,
    )
    return 1


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
