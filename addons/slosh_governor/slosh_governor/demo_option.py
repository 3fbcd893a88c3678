"""The option `--governor` of `slosh demo`."""

from __future__ import annotations

import argparse
from dataclasses import replace

from slosh_bringup.cli.demo import Demo
from slosh_bringup.errors import SloshBringupError
from slosh_governor.tuning import TUNING
from slosh_msgs_py import topics

CELL = "slosh_governor.nodes.governed_cell_node"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the option to the argument parser of `slosh demo`."""
    parser.add_argument(
        "--governor", action="store_true",
        help="send the motion's velocity as commands to the governor node, and move the container "
        "by its output, which keeps the sloshing height below 20 mm",
    )  # fmt: skip


def changed(arguments: argparse.Namespace, demo: Demo) -> Demo:
    """Returns the demonstration with the governor, if the option is given.

    Raises:
        SloshBringupError: it does not fit the motion or another option.
    """
    if not arguments.governor:
        return demo
    if arguments.force:
        raise SloshBringupError(
            "--governor and --force: the force sensor is simulated for a known motion; give one"
        )
    from slosh_governor.governed_cup import commanded_velocity  # it loads SciPy

    commanded_velocity(demo.motion)
    added = {**demo.setup.added, "govern": topics.TWIST}
    setup = replace(
        demo.setup, added=added, parameters_of={"governor": {"starts_at_rest": "true"}}
    )
    return demo._replace(setup=setup, given={**demo.given, "govern": str(TUNING.rate)}, cell=CELL)
