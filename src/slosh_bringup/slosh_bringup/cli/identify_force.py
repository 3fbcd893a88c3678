"""`slosh identify --force`: identifies the first sloshing mode from a measured force."""

from __future__ import annotations

import argparse
from typing import Any

from slosh_base.files import new_folder, write_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.input_options import add_input_options, wanted_input
from slosh_bringup.cli.table_options import table_options
from slosh_bringup.cli.teller import Teller
from slosh_bringup.errors import SloshBringupError
from slosh_discovery.discover_data.force_reading import ForceSource, read_force
from slosh_discovery.force.document import force_document, identified_model
from slosh_discovery.force.workflow import identify_force
from slosh_discovery.identifying import DOCUMENT, MODEL, PAGE
from slosh_model.model_text import format_model, read_model
from slosh_report.text import printed, write_document


def add_arguments(parser: Any) -> None:
    """Adds the options of `slosh identify --force` to the argument parser."""
    group = parser.add_argument_group("force in place of heights")
    group.add_argument(
        "--force", action="store_true",
        help="identify natural frequency, damping ratio and sloshing mass from the force under "
        "the container: a bag with a wrench, or a table with fx, fy, fz [N]",
    )  # fmt: skip
    group.add_argument(
        "--wrench", metavar="TOPIC", default="",
        help="topic of the measured force (needed if the bag has several): WrenchStamped, Wrench, "
        "or Twist if the driver publishes the force as the linear part of a Twist",
    )  # fmt: skip
    add_input_options(group)


def run(arguments: argparse.Namespace) -> int:
    """Identifies the first sloshing mode from the measured force; writes and prints the result."""
    if len(arguments.data) != 1:
        raise SloshBringupError("--force takes one bag or table")
    if arguments.model is None:
        raise SloshBringupError("--force needs the container and the liquid: give --model")
    tell = Teller("identify")
    model = read_model(arguments.model)
    source = ForceSource(arguments.wrench, wanted_input(arguments), table_options(arguments))
    found = identify_force(read_force(arguments.data[0], source, tell), model)
    identified = identified_model(model, found)
    document = force_document(found, model, identified)
    if arguments.output is not None:
        with new_folder(arguments.output) as folder:
            write_text(folder / MODEL, format_model(identified))
            write_document(folder / PAGE, document, folder / DOCUMENT)
    print(printed(document, arguments.json), end="")
    if arguments.output is not None and not arguments.json:
        print(f"\nreport {plain_line(arguments.output / PAGE)}")
    return tell.exit_code
