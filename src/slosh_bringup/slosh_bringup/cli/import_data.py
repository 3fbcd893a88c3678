"""`slosh import`: converts public data sets, motion tables and other programs' bags to bags."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from slosh_bag.interchange.rosbag_import import RosbagImport, find_rosbags, import_rosbag
from slosh_base.files import check_free
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.parser import old_name
from slosh_bringup.cli.progress import Progress, Unit
from slosh_bringup.cli.table_options import add_table_options, table_options
from slosh_bringup.errors import SloshBringupError
from slosh_replay.tables.antisloshing import find_runs, import_antisloshing
from slosh_replay.tables.table_bag import import_table

EXIT_LOST = 1
"""Messages that a bag counts did not come, or a motion is doubtful."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds one subparser per kind of data, with its options."""
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)

    data_set = kinds.add_parser("antisloshing", help="the public AntiSloshing measurements")
    data_set.add_argument(
        "folder",
        type=Path,
        help="folder of the data set: heights/, poses/, and joints/ with the arm's URDF if any",
    )
    data_set.set_defaults(read=import_runs)

    table = kinds.add_parser("table", help="motion tables, .csv or .csv.gz")
    table.add_argument(
        "sources", type=Path, nargs="+", metavar="FILE", help="motion table (.csv, .csv.gz)"
    )
    add_table_options(table)
    table.set_defaults(read=import_tables)

    rosbag = kinds.add_parser("rosbag", help="ROS 1 bags, rosbag2's SQLite and MCAP files")
    rosbag.add_argument(
        "sources",
        type=Path,
        nargs="+",
        metavar="BAG",
        help="bag to convert: .bag, .db3, .mcap or folder",
    )
    topics = rosbag.add_argument(
        "--topic", dest="topics", nargs="+", action="extend", default=[],
        metavar="TOPIC", help="convert only these topics (default: all)",
    )  # fmt: skip
    old_name(rosbag, topics, "--topics")
    rosbag.add_argument(
        "--rename", nargs="+", action="extend", default=[], metavar="OLD=NEW",
        help="rename topics, e.g. /imu/data=/slosh/imu",
    )  # fmt: skip
    rosbag.set_defaults(read=import_rosbags)

    for kind in (data_set, table, rosbag):
        kind.add_argument(
            "-o",
            "--output",
            type=Path,
            required=True,
            help="folder for the bags, one bag per source",
        )
        kind.add_argument("--json", action="store_true", help="print the bags as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Runs `slosh import` for the kind of data that the user has chosen."""
    read: Callable[[argparse.Namespace], int] = arguments.read
    return read(arguments)


def import_runs(arguments: argparse.Namespace) -> int:
    """Runs `slosh import antisloshing`, which imports runs of a public data set."""
    count = len(find_runs(arguments.folder))
    with Progress("import", count, Unit("runs")) as progress:
        bags = import_antisloshing(arguments.folder, arguments.output, lambda run: progress.add())
    if arguments.json:
        print(json.dumps([{"bag": str(bag)} for bag in bags]))
    else:
        print(plain_line(f"{len(bags)} bags in {arguments.output}"))
    return 0


def import_tables(arguments: argparse.Namespace) -> int:
    """Runs `slosh import table`, which converts motion tables to bags."""
    options = table_options(arguments)
    facts, code = [], 0
    for source, bag in bag_folders(arguments.sources, arguments.output).items():
        with Progress(source.name, None, Unit("rows")) as progress:
            told = import_table(source, bag, progress.of, options)
        for doubt in told.doubts:
            print(plain_line(f"slosh import: warning: {source}: {doubt}"), file=sys.stderr)
            code = EXIT_LOST if doubt.wrong else code
        facts.append({"bag": str(told.bag), "rows": told.rows, "rounded": told.rounded})
        if arguments.json:
            continue
        rounded = f", {told.rounded} times rounded to whole nanoseconds" if told.rounded else ""
        print(plain_line(f"{told.bag}: {told.rows} rows{rounded}"))
    if arguments.json:
        print(json.dumps(facts))
    return code


def import_rosbags(arguments: argparse.Namespace) -> int:
    """Runs `slosh import rosbag`, which converts bags of other programs."""
    rename = renamed(arguments.rename)
    sources = [bag for path in arguments.sources for bag in find_rosbags(path)]
    code = 0
    facts = []
    for source, bag in bag_folders(sources, arguments.output).items():
        with Progress(source.name, None, Unit("messages")) as progress:
            told = import_rosbag(source, bag, arguments.topics, rename, progress.of)
        for note in (*told.notes, *told.lost):
            print(plain_line(f"slosh import: {source}: {note}"), file=sys.stderr)
        facts.append({"bag": str(told.bag), "messages": told.counts, "lost": list(told.lost)})
        if not arguments.json:
            print(summary(told))
        code = EXIT_LOST if told.lost else code
    if arguments.json:
        print(json.dumps(facts))
    return code


def summary(told: RosbagImport) -> str:
    """Formats the topics of a new bag, one line each."""
    total = sum(told.counts.values())
    topics = "".join(f"\n  {plain_line(topic)}: {count}" for topic, count in told.counts.items())
    return f"{plain_line(told.bag)}: {total} messages{topics}"


def bag_folders(sources: Sequence[Path], output: Path) -> dict[Path, Path]:
    """Chooses the output folder of each source bag, named after the source.

    Raises:
        SloshBringupError: two sources have one name.
        SloshFileError: a folder is not free.
    """
    folders: dict[Path, Path] = {}
    for source in sources:
        name = Path(os.path.abspath(source)).name  # of `..` or `.`, too
        if not source.is_dir():
            for suffix in (".gz", ".csv", ".bag", ".db3", ".mcap"):
                name = name.removesuffix(suffix)
        folder = output / name
        if folder in folders.values():
            raise SloshBringupError(f"{source}: another source would also become {folder}")
        check_free(folder)
        folders[source] = folder
    return folders


def renamed(pairs: Sequence[str]) -> Mapping[str, str]:
    """Parses OLD=NEW arguments to a mapping from old to new topic names.

    Raises:
        SloshBringupError: a text without '='.
    """
    names = {}
    for pair in pairs:
        old, equals, new = pair.partition("=")
        if not (old and equals and new):
            raise SloshBringupError(f"--rename {pair}: is not OLD=NEW")
        names[old] = new
    return names
