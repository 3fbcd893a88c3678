"""Runs a cell's nodes, records, and reports: the body of `slosh demo` and `slosh cell`."""

from __future__ import annotations

import json
import math
import shutil
import time
from collections.abc import Callable
from contextlib import nullcontext
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
from slosh_msgs_py.node.domain import own_domain

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
    claim = own_domain() if simulated else nullcontext()
    processes = setup.processes(folder / BAG) + ([simulated] if simulated else [])
    with (
        claim as domain,
        NodeGroup(setup.namespace, folder / LOGS, node_environment(domain)) as group,
    ):
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
    (folder / REPORT).write_text(render_report(report), encoding="utf-8")
    document = {**run.document(), **report_document(report)}
    (folder / RESULT).write_text(json.dumps(document, indent=2) + "\n")
    return run, replayed


def latency_figure(run: RunResult) -> KeyFigure:
    """From an image's exposure to its comparison, which only a live run has."""
    median, greatest = run.latency.get("monitor", (math.nan, math.nan))
    note = "image to comparison, median"
    if math.isfinite(greatest):
        note += f"; at most {1e3 * greatest:.0f} ms"
    return KeyFigure("latency", median, "ms", note)
