"""`slosh cell`: all nodes on a real robot's topics, until Ctrl-C."""

from __future__ import annotations

import argparse
from pathlib import Path

from slosh_bringup.cell_setup import read_setup
from slosh_bringup.cli.progress import clock
from slosh_bringup.live_run import (
    BAG,
    REPORT,
    check_files,
    prepare_folder,
    run_nodes,
    without_report,
    write_results,
)
from slosh_bringup.run_result import print_replay, table
from slosh_bringup.stop_request import StopRequest


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument("--config", type=Path, required=True, help="cell file, see docs/robot.md")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/cell"), help="result folder"
    )


def run(arguments: argparse.Namespace) -> int:
    """Runs the nodes until it is told to end; prints the figures and where the results are."""
    setup = read_setup(arguments.config)
    check_files(setup)
    folder: Path = arguments.output
    prepare_folder(folder)
    with StopRequest() as stop:
        with clock("recording, Ctrl-C to stop") as progress:
            run_nodes(setup, folder, progress, stop)
        try:
            with stop.finishing():
                run, replayed = write_results(folder, f"Cell {arguments.config.stem}")
        except KeyboardInterrupt:
            return without_report("cell", folder)
    print(table(run))
    print_replay(replayed)
    print(f"bag                 {folder / BAG}")
    print(f"report              {folder / REPORT}")
    return 0
