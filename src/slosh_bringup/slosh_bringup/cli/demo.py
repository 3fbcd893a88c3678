"""`slosh demo`: runs the simulated cell with all nodes, records it and writes a report."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from slosh_base.addons import add_ons
from slosh_base.files import write_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cell.motion_source import REPEATS, TABLE_ENDINGS, load_motion
from slosh_bringup.cell.motions import MOTIONS, CellMotion
from slosh_bringup.cell.simulated_camera import write_simulated_camera
from slosh_bringup.cli.live import add_watch, run_live
from slosh_bringup.cli.progress import progress_bar
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import CellSetup, default_setup
from slosh_bringup.live.run import LiveRun
from slosh_bringup.processes import NodeProcess, config_folder
from slosh_model.model_text import read_model

CAMERA = "simulated_camera"
STARTING = 3.0  # s; from ready nodes to the motion and behind its end, for the progress bar


class Demo(NamedTuple):
    """What `slosh demo` runs; options of add-ons may change it.

    Attributes:
        setup: of the cell's nodes.
        given: parameters of the simulated cell.
        motion: that is played.
        cell: module of the simulated cell's node; empty: the core's own.
    """

    setup: CellSetup
    given: Mapping[str, str]
    motion: CellMotion
    cell: str = ""


def _further() -> list[Any]:
    """Returns the modules of add-ons with further options."""
    return [importlib.import_module(name) for one in add_ons() for name in one.demo_options]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh demo` to the argument parser."""
    parser.add_argument(
        "--motion", default="c3",
        help="motion to play: a motion table (.csv, .csv.gz), or one of "
        f"{', '.join(sorted(MOTIONS))} (default %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--model", type=Path, metavar="MODEL",
        help="model.yaml of another container and liquid; the camera sees cylinders and "
        "frusta, other shapes are simulated without one (default: the package's cup)",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/demo"),
        help="folder for results; each run gets a dated subfolder, and the link latest points "
        "to the newest one (default %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--repeat",
        type=int,
        default=1,
        help="number of times that the motion is played (default %(default)s)",
    )
    parser.add_argument(
        "--push", type=float, metavar="T",
        help="time [s] at which a push of the container by hand is simulated, which no robot "
        "sensor measures (default: no push)",
    )  # fmt: skip
    parser.add_argument(
        "--camera-stop", type=float, nargs=2, metavar=("FROM", "TO"),
        help="simulate a camera failure: no images from FROM to TO [s]",
    )  # fmt: skip
    parser.add_argument(
        "--force", action="store_true",
        help="simulate an opaque container on a force sensor, without a camera; its payload is "
        "identified first",
    )  # fmt: skip
    for option in _further():
        option.add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print the results as JSON")
    add_watch(parser)


def tell(line: str) -> None:
    """Prints an assumption about the inputs of `slosh demo` on standard error."""
    print(plain_line(f"slosh demo: note: {line}"), file=sys.stderr)


def _identified(output: Path, model: str) -> Path:
    """Identifies the payload of the simulated force sensor; returns the result file's path."""
    from slosh_bringup.cell.force_sensor import ForceSensor, calibration_record
    from slosh_discovery.force.document import force_data
    from slosh_discovery.force.workflow import identify_force
    from slosh_discovery.identifying import DOCUMENT
    from slosh_report.text import json_text

    truth = read_model(model)
    found = identify_force(calibration_record(truth, ForceSensor(), seed=2), truth)
    path = output / DOCUMENT
    output.mkdir(parents=True, exist_ok=True)
    write_text(path, json_text(force_data(found)))
    tell(f"payload identified from a simulated stroke: {path}")
    return path.resolve()


def run(arguments: argparse.Namespace) -> int:
    """Runs the demonstration, then prints the main results and the results folder."""
    if not REPEATS[0] <= arguments.repeat <= REPEATS[1]:
        raise SloshBringupError(
            f"--repeat {arguments.repeat}: must be from {REPEATS[0]} to {REPEATS[1]}"
        )
    name = arguments.motion
    motion = load_motion(name, 100.0, tell)
    # The node has a working folder of its own.
    played = str(Path(name).resolve()) if name.endswith(TABLE_ENDINGS) else name
    setup = default_setup()
    given = {"motion": played, "repeat": str(arguments.repeat)}
    if arguments.push is not None:
        given["push_at"] = str(arguments.push)
    if arguments.camera_stop is not None:
        given["camera_stop"] = str(arguments.camera_stop)
    if arguments.model is None:
        given |= {
            "model": str(config_folder() / "truth.yaml"), "calibration": str(setup.calibration)
        }  # fmt: skip
    else:
        given |= {"model": str(arguments.model.resolve())}
        container = read_model(arguments.model).container
        camera = write_simulated_camera(container, (arguments.output / CAMERA).resolve())
        if isinstance(camera, Path):
            given |= {"calibration": str(camera)}
        else:
            given |= {"camera": "false"}
            tell(f"no heights are measured: {camera}")
        setup = replace(
            setup, model=arguments.model.resolve(),
            calibration=camera if isinstance(camera, Path) else None,
        )  # fmt: skip
    demo = Demo(setup, given, motion)
    for option in _further():
        demo = option.changed(arguments, demo)
    setup, given = demo.setup, dict(demo.given)
    if arguments.force:
        setup = replace(
            setup, calibration=None, force=_identified(arguments.output, given["model"])
        )
        given |= {"camera": "false", "force_every": "2"}
    nodes = [process.name for process in setup.processes(Path())]
    given["wait_for"] = ",".join(nodes)
    simulated = NodeProcess("cell", [setup.parameters], given, module=demo.cell)
    length = STARTING + arguments.repeat * motion.duration
    title = f"Simulated cell, motion {motion.name}"
    run = LiveRun("demo", setup, arguments.output, title, simulated, arguments.watch)
    bar = progress_bar(f"motion {motion.name}", length, quiet=arguments.json)
    return run_live(run, bar, arguments.stop, as_json=arguments.json)
