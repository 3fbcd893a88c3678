"""`slosh demo`: the simulated cell, all nodes, record, report."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from slosh_bringup.cell.motions import MOTIONS, make_motion
from slosh_bringup.cell_setup import default_setup
from slosh_bringup.cli.progress import progress_bar
from slosh_bringup.live_run import (
    BAG,
    REPORT,
    check_files,
    prepare_folder,
    run_nodes,
    without_report,
    write_results,
)
from slosh_bringup.processes import NodeProcess, config_folder
from slosh_bringup.run_result import print_replay, table
from slosh_bringup.stop_request import StopRequest

STARTING = 4.0  # s; what the nodes take to find each other, for the progress bar


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument("--motion", default="c3", help=f"one of {', '.join(sorted(MOTIONS))}")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/demo"), help="result folder"
    )
    parser.add_argument("--repeat", type=int, default=1, help="how often the motion is played")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Runs the demonstration; prints the figures and where the results are."""
    motion = make_motion(arguments.motion, 100.0)
    setup = default_setup()
    check_files(setup)
    folder: Path = arguments.output
    prepare_folder(folder)
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
    with StopRequest() as stop:
        with progress_bar(f"motion {motion.name}", length, quiet=arguments.json) as progress:
            run_nodes(setup, folder, progress, stop, simulated)
        try:
            with stop.finishing():
                run, replayed = write_results(folder, f"Simulated cell, motion {motion.name}")
        except KeyboardInterrupt:
            return without_report("demo", folder)
    if arguments.json:
        print(json.dumps({**run.document(), "replay": json.loads(replayed.to_json())}))
        return 0
    print(table(run))
    print_replay(replayed)
    print(f"bag                 {folder / BAG}")
    print(f"report              {folder / REPORT}")
    return 0
