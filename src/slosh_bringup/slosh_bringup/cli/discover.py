"""`slosh discover`: finds the effect that explains why model and measurement differ."""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from slosh_base.files import check_free, naming, new_folder, write_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.bag_work import add_work_options, named_error, work_of
from slosh_bringup.cli.progress import item_progress, share_bar
from slosh_bringup.cli.table_options import add_table_options, table_options
from slosh_bringup.cli.teller import Teller
from slosh_bringup.discovery_task import (
    Discovered,
    discovery_task,
    each_recording,
    examine,
    remove_unfinished_discoveries,
)
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.finished_work import NOTES
from slosh_discovery.discovering import PAGE, DiscoveryRequest, check_paths
from slosh_discovery.discovery_report.words import shown_confidence
from slosh_report.json_values import plain
from slosh_report.page.units import DASH
from slosh_report.text import printed
from slosh_report.text_table import aligned

if TYPE_CHECKING:
    from slosh_bringup.many_files import ItemOutcome

Outcome: TypeAlias = "ItemOutcome[DiscoveryRequest, Discovered]"

SUMMARY: Final = "discoveries.json"
HEADS: Final = ("recording", "verdict", "effects", "confidence", "explained")
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
        "--each", action="store_true",
        help="run a separate discovery for each recording or table of DATA, with its own result "
        "folder; repeat the command to continue an interrupted run",
    )  # fmt: skip
    add_work_options(
        parser,
        jobs="number of processes with --each, otherwise of threads (default: one per core)",
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True,
        help="folder for results, new or empty: model.yaml (and model_NAME.yaml for groups), "
        "discovery.json, report.html, motions that tell candidate effects apart; with --each "
        "a folder of these for each recording, and discoveries.json",
    )  # fmt: skip
    parser.add_argument(
        "--json", action="store_true", help="print discovery.json instead of the text"
    )
    add_table_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Runs the discovery, writes and prints the results and returns the exit code.

    It is 1 where an input is doubtful, 2 where a recording of several cannot be examined.
    """
    request = make_request(arguments)
    check_paths(request.data, request.holdout, request.output)
    if arguments.each:
        return _examine_each(request, arguments)
    tell = Teller("discover")
    # Made before the work: long work must not end at a folder that takes no file.
    with new_folder(request.output) as folder, share_bar("discover") as progress:
        _, document = examine(request, folder, tell, progress, arguments.jobs)
    print(printed(document, arguments.json), end="")
    if not arguments.json:
        print(f"\nreport {plain_line(request.output / PAGE)}")
    return tell.exit_code


def _examine_each(request: DiscoveryRequest, arguments: argparse.Namespace) -> int:
    """Runs a discovery for each recording separately; continues if one fails."""
    from slosh_bringup.many_files import map_files

    requests = each_recording(request)
    recordings = [one.data[0] for one in requests]
    check_paths(recordings, request.holdout, request.output)
    division = work_of(recordings, arguments, worth=0.0)
    work = map_files(discovery_task, requests, **division._asdict())
    if not (request.output / NOTES).is_dir():
        check_free(request.output)
    with naming(request.output):
        request.output.mkdir(parents=True, exist_ok=True)
    outcomes: list[Outcome] = []
    try:
        with (
            item_progress("discover", len(requests), "recordings") as progress,
            closing(work),
        ):
            for outcome in work:
                progress.add()
                _tell(outcome)
                outcomes.append(outcome)
    finally:
        if arguments.scheduler is None or len(outcomes) == len(requests):
            remove_unfinished_discoveries(requests)  # else a cluster's processes still write
    outcomes.sort(key=lambda outcome: outcome.index)
    document = json.dumps([_row(outcome) for outcome in outcomes], indent=2) + "\n"
    write_text(request.output / SUMMARY, document)
    print(document if arguments.json else _table(outcomes), end="")
    found = [outcome.value for outcome in outcomes if outcome.value is not None]
    return 2 if len(found) < len(outcomes) else int(any(one.doubtful for one in found))


def _tell(outcome: Outcome) -> None:
    """Prints a recording's notes, or why its discovery failed, on standard error."""
    found, path = outcome.value, outcome.item.data[0]
    lines = (
        [named_error(path, outcome.error)]
        if found is None
        else [f"{found.name}: note: {line}" for line in found.notes]
        + [f"{found.name}: warning: {line}" for line in found.warnings]
        + [f"{found.name}: examined before"] * found.before
    )
    for line in lines:
        print(plain_line(f"slosh discover: {line}"), file=sys.stderr)


def _row(outcome: Outcome) -> dict[str, Any]:
    """Returns a recording's result for JSON, without values that differ in a repeated run."""
    recording = str(outcome.item.data[0])
    if outcome.value is None:
        return {"recording": recording, "error": outcome.error}
    row: dict[str, Any] = plain(outcome.value)
    del row["before"]
    return {"recording": recording, **row}


def _table(outcomes: Sequence[Outcome]) -> str:
    """Formats a table with verdict, effects, confidence and explained error by recording."""
    rows = [HEADS]
    for outcome in outcomes:
        one = outcome.value
        if one is None:
            rows.append((outcome.item.output.name, "not examined", "", "", ""))
            continue
        closed = f"{one.closed:.0%}" if math.isfinite(one.closed) else DASH
        confidence = shown_confidence(one.confidence)
        rows.append((one.name, one.verdict, " + ".join(one.effects) or DASH, confidence, closed))
    return "\n".join(aligned(rows, "<<<>>")) + "\n"


def make_request(arguments: argparse.Namespace) -> DiscoveryRequest:
    """Creates the discovery request from the command-line options.

    Raises:
        SloshBringupError: they do not fit together.
    """
    if arguments.model is None and not arguments.from_bag:
        raise SloshBringupError("no model: give --model, or --from-bag to use the recorded one")
    if arguments.scheduler is not None and not arguments.each:
        raise SloshBringupError("--scheduler needs --each: one search is not divided")
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
