"""`slosh recover`: a finished bag of all that is whole in an unfinished or damaged one."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from slosh_bag.mcap_files.bag_folder import ordered_files
from slosh_bag.recover import Recovery, recover_bag
from slosh_bringup.cli.progress import MEGABYTES, Progress
from slosh_files import check_free, check_outside


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument("bag", type=Path, metavar="BAG", help="bag's folder, or MCAP file")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="new bag's folder, new or empty"
    )
    parser.add_argument("--json", action="store_true", help="print what was recovered as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Writes the new bag; what could not be recovered is told on stderr."""
    files, _ = ordered_files(arguments.bag, damaged=True)
    check_outside(arguments.output, [arguments.bag])
    check_free(arguments.output)
    size = sum(file.stat().st_size for file in files)
    with Progress("recover", size, MEGABYTES) as progress:
        recovery = recover_bag(arguments.bag, arguments.output, progress.add)
    for note in recovery.notes:
        print(f"slosh recover: {note}", file=sys.stderr)
    print(as_json(recovery) if arguments.json else as_text(recovery))
    return 0


def as_json(recovery: Recovery) -> str:
    """What was recovered, for a program."""
    return json.dumps(
        {"bag": str(recovery.bag), "messages": recovery.counts, "notes": list(recovery.notes)},
        indent=2,
    )


def as_text(recovery: Recovery) -> str:
    """What was recovered, for people."""
    width = max(map(len, recovery.counts), default=0)
    lines = [f"{topic:<{width}}  {count:>8}" for topic, count in sorted(recovery.counts.items())]
    return "\n".join([*lines, str(recovery.bag)])
