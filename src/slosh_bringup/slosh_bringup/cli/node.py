"""`slosh node`: runs a single node until Ctrl-C, as `ros2 run` does."""

from __future__ import annotations

import argparse
from pathlib import Path

from slosh_bringup.cli.node_process import run_until_stopped
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.processes import NodeProcess, known_nodes
from slosh_msgs_py.topics import NAMESPACE


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh node` to the argument parser."""
    names = sorted(known_nodes())
    parser.add_argument("name", choices=names, metavar="NAME", help=f"one of {', '.join(names)}")
    parser.add_argument(
        "-p", action="append", default=[], dest="assigned", metavar="NAME:=VALUE",
        help="a parameter, such as model:=model.yaml; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "-r", action="append", default=[], dest="remapped", metavar="TOPIC:=TOPIC",
        help="the robot's topic in place of a relative one, such as imu:=/arm/imu",
    )  # fmt: skip
    parser.add_argument(
        "--params-file", action="append", default=[], type=Path, metavar="FILE",
        help="ROS parameter file",
    )  # fmt: skip
    parser.add_argument(
        "--namespace", default=NAMESPACE, help=f"ROS namespace of the node (default {NAMESPACE})"
    )


def run(arguments: argparse.Namespace) -> int:
    """Runs the node; returns its exit code."""
    for path in arguments.params_file:
        if not path.is_file():
            raise SloshBringupError(f"{path}: there is no such parameter file")
    process = NodeProcess(
        arguments.name, arguments.params_file, _pairs(arguments.assigned, "-p"),
        _pairs(arguments.remapped, "-r"),
    )  # fmt: skip
    return run_until_stopped(process, arguments.namespace)


def _pairs(words: list[str], option: str) -> dict[str, str]:
    """Returns names and values of an option.

    Raises:
        SloshBringupError: a word is not NAME:=VALUE.
    """
    pairs = [word.partition(":=") for word in words]
    for word, (name, sign, _) in zip(words, pairs, strict=True):
        if not sign or not name:
            raise SloshBringupError(f"{option} {word!r:.60}: must be NAME:=VALUE")
    return {name: value for name, _, value in pairs}
