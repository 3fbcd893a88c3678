"""`slosh recover`: recovers the intact messages of a damaged or unfinished bag."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from slosh_bag.mcap_files.bag_folder import ordered_files
from slosh_bag.reader import BagReader
from slosh_bag.recover import Recovery, recover_bag
from slosh_base.files import check_free, check_outside
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.progress import IN_MEGABYTES, MESSAGES, Progress
from slosh_replay.split import split_bag
from slosh_report.text_table import aligned


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh recover` to the argument parser."""
    parser.add_argument("bag", type=Path, metavar="BAG", help="folder of the bag, or MCAP file")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="folder of the new bag, new or empty"
    )
    parser.add_argument(
        "--split",
        action="store_true",
        help="split an intact bag where the input's time stamps jump back: one new bag per part",
    )
    parser.add_argument("--json", action="store_true", help="print what was recovered as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Writes the recovered bag and reports on standard error what was lost."""
    if arguments.split:
        return _split(arguments)
    files, _ = ordered_files(arguments.bag, damaged=True)
    check_outside(arguments.output, [arguments.bag])
    check_free(arguments.output)
    size = sum(file.stat().st_size for file in files)
    with Progress("recover", size, IN_MEGABYTES) as progress:
        recovery = recover_bag(arguments.bag, arguments.output, progress.add)
    for note in recovery.notes:
        print(plain_line(f"slosh recover: {note}"), file=sys.stderr)
    print(as_json(recovery) if arguments.json else as_text(recovery))
    return 0


def _split(arguments: argparse.Namespace) -> int:
    check_outside(arguments.output, [arguments.bag])
    check_free(arguments.output)
    total = sum(topic.count or 0 for topic in BagReader(arguments.bag).topics().values())
    with Progress("cut", total, MESSAGES) as progress:
        parts = [str(part) for part in split_bag(arguments.bag, arguments.output, progress.add)]
    print(
        json.dumps({"bags": parts}, indent=2)
        if arguments.json
        else "\n".join(map(plain_line, parts))
    )
    return 0


def as_json(recovery: Recovery) -> str:
    """Formats the result of a recovery as JSON."""
    return json.dumps(
        {"bag": str(recovery.bag), "messages": recovery.counts, "notes": list(recovery.notes)},
        indent=2,
    )


def as_text(recovery: Recovery) -> str:
    """Formats the result of a recovery as text."""
    rows = [(topic, str(count)) for topic, count in sorted(recovery.counts.items())]
    return "\n".join([*aligned(rows, "<>"), plain_line(recovery.bag)])
