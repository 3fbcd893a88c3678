"""Runs a live cell for `slosh demo` and `slosh cell`, writes the report and prints results."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import NoReturn

from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.progress import STOPPING, Tell, can_draw, say
from slosh_bringup.live.cell_setup import EVENTS
from slosh_bringup.live.report import REPORT, LiveReport, LiveResult, make_live_report
from slosh_bringup.live.run import BAG, LiveRun, check_files, run_nodes
from slosh_bringup.live.run_folder import new_run
from slosh_bringup.live.run_result import print_replay, table
from slosh_bringup.stop_request import StopRequest
from slosh_bringup.watch import HOST, PORT

_STDERR = 2


def add_watch(parser: argparse.ArgumentParser) -> None:
    """Adds the option `--watch`, which serves the operator's web page."""
    parser.add_argument(
        "--watch", nargs="?", type=_port, const=PORT, metavar="PORT",
        help=f"serve a live web page of the cell on this machine (default PORT: {PORT})",
    )  # fmt: skip


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= 65535):
        raise argparse.ArgumentTypeError(f"{text!r} is not a port from 1 to 65535")
    return int(text)


class LiveScreen:
    """Terminal output of a live run; the terminal may be closed before the run ends.

    Args:
        progress: shows the elapsed time.
        stop: hears of a terminal that has gone.
    """

    def __init__(self, progress: Tell, stop: StopRequest) -> None:
        self._progress = progress
        self._stop = stop
        self._elapsed = 0.0

    def show(self, elapsed: float, text: str, status: str = "") -> None:
        """Replaces the previous status line with the elapsed time [s] and the cell's state."""
        self._elapsed = elapsed
        shown = (can_draw(sys.stderr) and status) or text
        self._try(lambda: self._progress(elapsed, shown))

    def stopped(self) -> None:
        """Shows that the run is stopping."""
        self.show(self._elapsed, STOPPING)

    def tell(self, line: str) -> None:
        """Prints a line that stays on the screen above the status line."""
        self._try(lambda: say(plain_line(line)))

    def _try(self, write: Callable[[], object]) -> None:
        try:
            write()
        except OSError as error:
            self._stop.written_in_vain(error)


def run_live(
    run: LiveRun,
    bar: AbstractContextManager[Tell],
    stop: StopRequest,
    *,
    as_json: bool = False,
) -> int:
    """Runs a cell to its end, writes the report and prints the main results.

    Args:
        run: what is run; its own folder is made below the one that it names.
        bar: shows the elapsed time while it runs.
        stop: asks for the end; it takes the signals from the command's first moment on.
        as_json: print the figures as JSON.

    Returns:
        exit code: 0; 1 where nothing was compared, messages are lost, two cells were mixed, the
            recording cannot be replayed, or a node ended; 2 where a node refused its input.
    """
    check_files(run.setup)
    _check_port(run.watch)
    folder = new_run(run.folder, datetime.now(), lambda line: _say(run, line))
    run = replace(run, folder=folder)
    _say(run, f"this run is in {folder}")
    with bar as progress:
        screen = LiveScreen(progress, stop)
        outcome = run_nodes(run, screen, stop)
        if stop.reason or outcome.problem:
            screen.stopped()
    problems = tuple(filter(None, (outcome.problem,)))
    with stop.finishing(lambda: _leave(run)):
        why = f"{stop.reason}, " if stop.reason else ""
        again = "; press Ctrl-C again to skip it" if stop.reason else ""
        screen.tell(f"{why}all nodes have ended; writing the report{again}")
        report = make_live_report(
            run.folder / BAG, run.title, problems, began=outcome.began,
            events=run.setup.record == EVENTS,
        )  # fmt: skip
    result = report.result
    unwritten = _write(run, report)
    print_json(result, folder) if as_json else print_result(result, folder)
    for line in (result.nothing,) if result.reasons else result.warnings:
        _say(run, line)
    return outcome.exit_code or int(bool(result.reasons or result.failures or unwritten))


def _write(run: LiveRun, report: LiveReport) -> bool:
    """Writes the report; if that fails, prints the reason and returns True."""
    try:
        report.write(run.folder)
    except OSError as error:
        _say(run, f"no report: {error.filename}: {error.strerror}")
        return True
    return False


def _check_port(port: int | None) -> None:
    """Raises SloshBringupError if the watch page's TCP port is already in use."""
    if port is not None:
        from slosh_bringup.watch.server import listen

        listen(HOST, port).close()


def _leave(run: LiveRun) -> NoReturn:
    """Ends the process at once, without writing a report."""
    line = (
        f"slosh {run.command}: report skipped; the recording is complete; to write the report: "
        f"slosh replay {run.folder / BAG} -o {run.folder}\n"
    )
    # Not through sys.stderr, which the signal may have found in the midst of a write.
    with contextlib.suppress(OSError):
        os.write(_STDERR, line.encode())
    os._exit(1)


def print_result(result: LiveResult, folder: Path) -> None:
    """Prints the main results of a live run and its folder."""
    if result.figures is not None:
        print(table(result.figures))
    if result.replayed is not None:
        print_replay(result.replayed)
    if (folder / BAG).exists():
        print(f"bag                 {plain_line(folder / BAG)}")
    if (folder / REPORT).exists():
        print(f"report              {plain_line(folder / REPORT)}")


def print_json(result: LiveResult, folder: Path) -> None:
    """Prints the results of a live run as JSON."""
    replay = json.loads(result.replayed.to_json()) if result.replayed else None
    print(json.dumps({"folder": str(folder), **result.document(), "replay": replay}))


def _say(run: LiveRun, line: str) -> None:
    print(plain_line(f"slosh {run.command}: {line}"), file=sys.stderr)
