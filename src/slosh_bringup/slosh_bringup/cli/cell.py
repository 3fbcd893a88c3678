"""`slosh cell`: runs all nodes on a robot's topics until Ctrl-C is pressed."""

from __future__ import annotations

import argparse
from pathlib import Path

from slosh_bringup.cli.live import add_watch, run_live
from slosh_bringup.cli.progress import clock
from slosh_bringup.live.cell_setup import read_setup
from slosh_bringup.live.run import LiveRun


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh cell` to the argument parser."""
    parser.add_argument(
        "--config",
        type=Path,
        required=True,
        help="configuration file of the cell (cell.yaml); see docs/robot.md",
    )
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/cell"),
        help="folder for results; each run gets a dated subfolder, and the link latest points "
        "to the newest one (default %(default)s)",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the results as JSON")
    add_watch(parser)


def run(arguments: argparse.Namespace) -> int:
    """Runs the nodes until stopped, then prints the main results and the results folder."""
    config: Path = arguments.config
    run = LiveRun(
        "cell", read_setup(config), arguments.output, f"Cell {config.stem}", watch=arguments.watch
    )
    bar = clock("recording, Ctrl-C to stop")
    return run_live(run, bar, arguments.stop, as_json=arguments.json)
