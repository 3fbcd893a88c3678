"""`slosh discover`: finds the effect that explains why model and measurement differ."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from slosh_base.files import new_folder
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.progress import share_bar
from slosh_bringup.cli.table_options import add_table_options, table_options
from slosh_bringup.cli.teller import Teller
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.replay.frames import pictures_at
from slosh_discovery.discover import discover
from slosh_discovery.discovering import (
    PAGE,
    DiscoveryRequest,
    check_paths,
    make_report,
    prepare,
    write_results,
)
from slosh_discovery.discovery_report import discovery_text
from slosh_replay.recorded_run import RecordedRun

GROUP_NAME = re.compile(r"[\w-]{1,40}")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh discover` to the argument parser."""
    parser.add_argument(
        "data", type=Path, nargs="+", metavar="DATA",
        help="bag, motion table with measured heights, or folder of these",
    )  # fmt: skip
    parser.add_argument(
        "--model", type=Path,
        help="model.yaml to examine (default with --from-bag: the recorded model)",
    )  # fmt: skip
    parser.add_argument(
        "--holdout", type=Path, nargs="+", action="extend", metavar="DATA", default=[],
        help="motions that are used for validation only, not for the fit (default: every "
        "third motion, if there are three or more)",
    )  # fmt: skip
    parser.add_argument(
        "--group", action="append", metavar="NAME=PATTERN", default=[],
        help="motions of one set-up of sensors and rig: those whose name or DATA matches "
        "PATTERN (wildcards * and ?); several --group with the same NAME are combined",
    )  # fmt: skip
    parser.add_argument(
        "--from-bag", action="store_true",
        help="read DATA as recordings of whole days; the motions with the largest errors of "
        "the live estimate are used first",
    )  # fmt: skip
    parser.add_argument(
        "--motions",
        type=int,
        metavar="N",
        help="use at most N motions of DATA, the first ones (default: all)",
    )
    parser.add_argument(
        "--jobs", type=int, metavar="N", help="number of threads (default: one per core)"
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True,
        help="folder for results, new or empty: model.yaml (and model_NAME.yaml for groups), "
        "discovery.json, report.html, motions that tell candidate effects apart",
    )  # fmt: skip
    parser.add_argument(
        "--json", action="store_true", help="print discovery.json instead of the text"
    )
    add_table_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Runs the discovery, writes and prints the results and returns the exit code.

    It is 1 where an input is doubtful.
    """
    request = make_request(arguments)
    tell = Teller("discover")
    check_paths(request.data, request.holdout, request.output)
    # Made before the work: long work must not end at a folder that takes no file.
    with new_folder(request.output) as folder:
        prepared = prepare(request, tell)
        with share_bar("discover") as progress:
            finding = discover(
                prepared.fit, prepared.base, prepared.holdout,
                progress=progress, threads=arguments.jobs,
            )  # fmt: skip
        report = make_report(request, prepared, finding, _pictures)
        document = write_results(folder, report)
    if arguments.json:
        print(document, end="")
    else:
        print(discovery_text(report))
        print(f"\nreport {plain_line(request.output / PAGE)}")
    return tell.exit_code


def make_request(arguments: argparse.Namespace) -> DiscoveryRequest:
    """Creates the discovery request from the command-line options.

    Raises:
        SloshBringupError: they do not fit together.
    """
    if arguments.model is None and not arguments.from_bag:
        raise SloshBringupError("no model: give --model, or --from-bag to use the recorded one")
    for name in ("jobs", "motions"):
        value = getattr(arguments, name)
        if value is not None and value < 1:
            raise SloshBringupError(f"--{name} {value}: must be at least 1")
    return DiscoveryRequest(
        tuple(arguments.data), arguments.output, arguments.model, tuple(arguments.holdout),
        arguments.from_bag, arguments.motions, groups_of(arguments.group),
        table_options(arguments),
    )  # fmt: skip


def groups_of(options: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Parses the group options and returns the file patterns by group name.

    Raises:
        SloshBringupError: an option is no NAME=PATTERN, or a name that a file cannot have.
    """
    groups: dict[str, tuple[str, ...]] = {}
    for option in options:
        name, separator, pattern = option.partition("=")
        if not (GROUP_NAME.fullmatch(name) and separator and pattern):
            raise SloshBringupError(
                f"--group {option}: must be NAME=PATTERN, NAME of letters, digits, '_' and '-'"
            )
        groups[name] = (*groups.get(name, ()), pattern)
    return groups


def _pictures(bag: Path, stamps: Mapping[str, int]) -> dict[str, tuple[bytes, float]]:
    return pictures_at(RecordedRun(bag), stamps)
