"""`slosh identify`: identifies a model's parameters from measured motions."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from slosh_base.files import new_folder
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli import identify_force
from slosh_bringup.cli.progress import share_bar
from slosh_bringup.cli.quantities import FRACTION, length
from slosh_bringup.cli.table_options import add_table_options, table_options
from slosh_bringup.cli.teller import Teller
from slosh_bringup.errors import SloshBringupError
from slosh_discovery.discovering import check_paths
from slosh_discovery.identify import Strategy, identify
from slosh_discovery.identify.parameters import DEFAULT
from slosh_discovery.identifying import (
    PAGE,
    IdentificationRequest,
    make_report,
    prepare,
    write_results,
)
from slosh_report.text import printed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh identify` to the argument parser."""
    parser.add_argument(
        "data", type=Path, nargs="+", metavar="DATA",
        help="bag, motion table with measured heights, or folder of these",
    )  # fmt: skip
    parser.add_argument(
        "--model", type=Path,
        help="model.yaml to start from (default with --from-bag: the recorded model)",
    )  # fmt: skip
    parser.add_argument(
        "--strategy", choices=[strategy.value for strategy in Strategy],
        default=Strategy.MOSM.value,
        help="mosm: one model for all operating points (default); sosm: also one model for "
        "each operating point",
    )  # fmt: skip
    parser.add_argument(
        "--fit", metavar="NAME,…", default=",".join(DEFAULT),
        help="parameters to identify: natural_frequency, damping_ratio, p (factor "
        "of the acceleration), "
        "fill_height, EFFECT.PARAMETER (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--holdout", type=Path, nargs="+", action="extend", metavar="DATA", default=[],
        help="motions that are used for validation only, not for the fit",
    )  # fmt: skip
    parser.add_argument(
        "--from-bag", action="store_true", help="read DATA as recordings and use their model"
    )
    parser.add_argument(
        "--ratio", type=FRACTION, default=0.4, metavar="B",
        help="share of a cycle in which the container moves; used to compute the operating "
        "speed (default: 0.4)",
    )  # fmt: skip
    parser.add_argument(
        "--tolerance", type=length(0.1), default=0.0005, metavar="M",
        help="largest mean deviation of the liquid surface from a straight line [m] at which it "
        "counts as straight; the fastest motion that keeps to it sets the acceleration and jerk "
        "up to which the model is valid (default: 0.0005)",
    )  # fmt: skip
    parser.add_argument(
        "--beside", type=Path, nargs="+", action="extend", metavar="DIR", default=[],
        help="identification results of other containers, shown in the same report",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", type=Path,
        help="folder for results, new or empty: model.yaml, identification.json, report.html",
    )  # fmt: skip
    parser.add_argument(
        "--json", action="store_true", help="print identification.json instead of the text"
    )
    identify_force.add_arguments(parser)
    add_table_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Runs the identification; returns 1 if an input looks faulty."""
    if arguments.force:
        return identify_force.run(arguments)
    request = make_request(arguments)
    tell = Teller("identify")
    check_paths(request.data, request.holdout, request.output)
    # Made before the work: long work must not end at a folder that takes no file.
    with new_folder(request.output) as folder:
        notes: list[str] = []
        try:
            prepared = prepare(request, notes.append)
        finally:
            for note in notes:
                tell(note)
        with share_bar("identify") as progress:
            found = identify(
                prepared.fit, prepared.base, request.names, strategy=request.strategy,
                holdout=prepared.holdout, ratio=request.ratio, tolerance=request.tolerance,
                progress=progress,
            )  # fmt: skip
        report = make_report(request, prepared, notes, found)
        document = write_results(folder, report)
    print(printed(document, arguments.json), end="")
    if not arguments.json:
        print(f"\nreport {plain_line(request.output / PAGE)}")
    return tell.exit_code


def make_request(arguments: argparse.Namespace) -> IdentificationRequest:
    """Creates the identification request from the command-line options.

    Raises:
        SloshBringupError: they do not fit together.
    """
    if arguments.output is None:
        raise SloshBringupError("no folder for the results: give -o DIR")
    if arguments.wrench or arguments.input or arguments.urdf or arguments.tool_frame:
        raise SloshBringupError("--wrench, --input, --urdf and --tool-frame need --force")
    if arguments.model is None and not arguments.from_bag:
        raise SloshBringupError("no model: give --model, or --from-bag to use the recorded one")
    if not 0.0 < arguments.ratio <= 1.0:
        raise SloshBringupError(f"--ratio {arguments.ratio:g}: must lie in (0, 1]")
    if not (math.isfinite(arguments.tolerance) and arguments.tolerance > 0.0):
        raise SloshBringupError(f"--tolerance {arguments.tolerance:g}: must be positive")
    return IdentificationRequest(
        data=tuple(arguments.data),
        output=arguments.output,
        model=arguments.model,
        holdout=tuple(arguments.holdout),
        names=tuple(name.strip() for name in arguments.fit.split(",") if name.strip()),
        strategy=Strategy(arguments.strategy),
        ratio=arguments.ratio,
        tolerance=arguments.tolerance,
        beside=tuple(arguments.beside),
        tables=table_options(arguments),
    )
