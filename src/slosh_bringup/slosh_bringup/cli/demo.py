"""`slosh demo`: the simulated cell, all nodes, record, report."""

from __future__ import annotations

import argparse
import json
import sys
from datetime import datetime
from pathlib import Path

from slosh_bringup.cell.motions import MOTIONS, make_motion
from slosh_bringup.cell_setup import default_setup
from slosh_bringup.cli.progress import progress_bar
from slosh_bringup.live_run import (
    BAG,
    REPORT,
    check_files,
    run_nodes,
    write_results,
)
from slosh_bringup.processes import NodeProcess, config_folder
from slosh_bringup.run_folder import new_run
from slosh_bringup.run_result import print_replay, table

STARTING = 4.0  # s; what the nodes take to find each other, for the progress bar


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument("--motion", default="c3", help=f"one of {', '.join(sorted(MOTIONS))}")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/demo"),
        help="gets a dated folder for each run, and the link latest to the newest one",
    )  # fmt: skip
    parser.add_argument("--repeat", type=int, default=1, help="how often the motion is played")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Runs the demonstration; prints the figures and where the results are."""
    motion = make_motion(arguments.motion, 100.0)
    setup = default_setup()
    check_files(setup)
    folder = new_run(arguments.output, datetime.now(), tell)
    tell(f"this run is in {folder}")
    simulated = NodeProcess(
        "cell",
        [setup.parameters],
        {
            "motion": motion.name,
            "repeat": str(arguments.repeat),
            "model": str(config_folder() / "truth.yaml"),
            "calibration": str(setup.calibration),
        },
    )
    length = STARTING + arguments.repeat * motion.duration
    with progress_bar(f"motion {motion.name}", length, quiet=arguments.json) as progress:
        run_nodes(setup, folder, progress, simulated)
    run, replayed = write_results(folder, f"Simulated cell, motion {motion.name}")
    if arguments.json:
        print(
            json.dumps(
                {"folder": str(folder), **run.document(), "replay": json.loads(replayed.to_json())}
            )
        )
        return 0
    print(table(run))
    print_replay(replayed)
    print(f"bag                 {folder / BAG}")
    print(f"report              {folder / REPORT}")
    return 0


def tell(line: str) -> None:
    """Tells the user where the run is."""
    print(f"slosh demo: {line}", file=sys.stderr)
