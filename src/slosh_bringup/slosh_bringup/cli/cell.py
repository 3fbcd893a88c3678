"""`slosh cell`: all nodes on a real robot's topics, until Ctrl-C."""

from __future__ import annotations

import argparse
import sys
from datetime import datetime
from pathlib import Path

from slosh_bringup.cell_setup import read_setup
from slosh_bringup.cli.progress import clock
from slosh_bringup.live_run import (
    BAG,
    REPORT,
    check_files,
    run_nodes,
    write_results,
)
from slosh_bringup.run_folder import new_run
from slosh_bringup.run_result import print_replay, table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument("--config", type=Path, required=True, help="cell file, see docs/robot.md")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/cell"),
        help="gets a dated folder for each run, and the link latest to the newest one",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Runs the nodes until Ctrl-C, then prints the figures and where the results are."""
    setup = read_setup(arguments.config)
    check_files(setup)
    folder = new_run(arguments.output, datetime.now(), tell)
    tell(f"this run is in {folder}")
    with clock("recording, Ctrl-C to stop") as progress:
        run_nodes(setup, folder, progress)
    run, replayed = write_results(folder, f"Cell {arguments.config.stem}")
    print(table(run))
    print_replay(replayed)
    print(f"bag                 {folder / BAG}")
    print(f"report              {folder / REPORT}")
    return 0


def tell(line: str) -> None:
    """Tells the user where the run is."""
    print(f"slosh cell: {line}", file=sys.stderr)
