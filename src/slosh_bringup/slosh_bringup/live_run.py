"""Runs a cell's nodes, records, and reports: the body of `slosh demo` and `slosh cell`."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable
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
from slosh_camera.calibration import read_any_calibration
from slosh_discovery.report import Fact, KeyFigure, render_report, report_document
from slosh_estimator.model_file import read_model
from slosh_files import write_text

POLL = 0.1
# What a run writes into its folder.
BAG, LOGS, REPORT, RESULT = "bag", "logs", "report.html", "result.json"

Progress = Callable[[float, str], None]


def check_files(setup: CellSetup) -> None:
    """Reads the cell's files once, so that a mistake is told before any process starts."""
    read_model(setup.model)
    read_any_calibration(setup.calibration)


def run_nodes(
    setup: CellSetup,
    folder: Path,
    progress: Progress,
    simulated: NodeProcess | None = None,
) -> None:
    """Runs the nodes until the simulated cell is through or Ctrl-C.

    Args:
        setup: the cell.
        folder: where the bag and the logs go.
        progress: told the elapsed time [s] and what is going on, ten times a second.
        simulated: the simulated cell; None: a robot speaks.

    Raises:
        SloshBringupError: a node ended with an error.
    """
    # A demonstration keeps to itself; a cell talks to the robot on the user's domain.
    domain = 1 + os.getpid() % 100 if simulated else None
    environment = node_environment(domain)
    processes = setup.processes(folder / BAG) + ([simulated] if simulated else [])
    with NodeGroup(setup.namespace, folder / LOGS, environment) as group:
        for process in processes:
            group.start(process)
        started = time.monotonic()
        try:
            while simulated is None or "cell" not in group.ended():
                group.check()
                progress(time.monotonic() - started, "running")
                time.sleep(POLL)
            group.check()
        except KeyboardInterrupt:
            progress(time.monotonic() - started, "stopping")


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
    write_text(folder / REPORT, render_report(report))
    document = {**run.document(), **report_document(report)}
    write_text(folder / RESULT, json.dumps(document, indent=2) + "\n")
    return run, replayed


def latency_figure(run: RunResult) -> KeyFigure:
    """From an image's exposure to its comparison, which only a live run has."""
    median, greatest = run.latency.get("monitor", (math.nan, math.nan))
    note = "image to comparison, median"
    if math.isfinite(greatest):
        note += f"; at most {1e3 * greatest:.0f} ms"
    return KeyFigure("latency", median, "ms", note)
