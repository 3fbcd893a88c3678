"""`slosh export`: writes topics of a bag as CSV or Parquet, or its motion as a motion table."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from pathlib import Path

from slosh_bag.interchange.export import check_targets, export_targets, export_topics, is_table
from slosh_bag.mcap_files.bag_folder import files_of
from slosh_bag.reader import BagReader, TopicInfo
from slosh_base.files import check_apart, check_outside
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.input_options import add_input_options, wanted_input
from slosh_bringup.cli.parser import old_name
from slosh_bringup.cli.progress import Progress, Unit
from slosh_bringup.errors import SloshBringupError
from slosh_motion.tables.motion_table import SUFFIXES, is_motion_table, write_motion_table
from slosh_replay.tables.bag_table import NO_HEIGHTS, TableSettings, read_bag_table
from slosh_report.text_table import aligned


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh export` to the argument parser."""
    parser.add_argument("bag", type=Path, metavar="BAG", help="folder of the bag, or MCAP file")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        help="output: FILE.csv, FILE.csv.gz, FILE.parquet, or a folder",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace existing files")
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--list", action="store_true", help="list topics, types and numbers of messages"
    )
    what.add_argument(
        "--motion",
        action="store_true",
        help="export the container's motion and the measured heights as a motion table",
    )
    topics = what.add_argument(
        "--topic", dest="topics", nargs="+", action="extend", default=[],
        metavar="TOPIC", help="export only these topics, one file each",
    )  # fmt: skip
    old_name(parser, topics, "--topics")
    parser.add_argument(
        "--format",
        choices=["csv", "parquet"],
        default="parquet",
        help="format of the files in a folder (default %(default)s)",
    )
    parser.add_argument("--json", action="store_true", help="print the --list output as JSON")
    motion = parser.add_argument_group("motion table")
    add_input_options(motion)
    motion.add_argument(
        "--measured",
        metavar="TOPIC",
        help="topic of the measured heights (default: "
        f"free_surface), or {NO_HEIGHTS} for no heights",
    )
    motion.add_argument(
        "--absolute",
        action="store_true",
        help="write seconds since 1970 in the column t (default: the time since the start)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Lists a bag's topics, or exports them to files."""
    if arguments.list:
        unused = [
            option
            for option, value in (
                ("--urdf", arguments.urdf),
                ("--tool-frame", arguments.tool_frame),
                ("--input", arguments.input),
            )
            if value is not None
        ]
        if unused:
            raise SloshBringupError(f"{unused[0]}: is not used with --list; leave it out")
        print(listing(BagReader(arguments.bag).topics(), as_json=arguments.json))
        return 0
    if arguments.output is None:
        raise SloshBringupError(
            "-o is missing: give FILE.csv, FILE.parquet or a folder; or use --list"
        )
    return export_motion(arguments) if arguments.motion else export_tables(arguments)


def listing(topics: dict[str, TopicInfo], *, as_json: bool) -> str:
    """Formats the topics of a bag, one line each or as JSON."""
    if as_json:
        entries = [
            {"topic": name, "type": info.message_type, "messages": info.count}
            for name, info in sorted(topics.items())
        ]
        return json.dumps(entries, indent=2)
    rows = [(name, info.message_type, str(info.count)) for name, info in sorted(topics.items())]
    return "\n".join(aligned(rows, "<<>")) if rows else ""


def export_motion(arguments: argparse.Namespace) -> int:
    """Exports a bag's motion as a motion table."""
    output: Path = arguments.output
    if not is_motion_table(output):
        raise SloshBringupError(f"{output}: a motion table must be named {' or '.join(SUFFIXES)}")
    check_apart([output], files_of(arguments.bag))
    check_targets([output], overwrite=arguments.overwrite)
    wanted = wanted_input(arguments)
    settings = TableSettings(
        kind=None if wanted is None else wanted.kind, measured=arguments.measured,
        absolute=arguments.absolute, inputs=wanted,
    )  # fmt: skip
    with Progress("export", None, Unit("messages")) as progress:
        given = read_bag_table(arguments.bag, settings, progress.add)
    write_motion_table(output, given.table)
    tell(given.notes)
    heights = f", heights from {given.measured}" if given.measured else ", no heights"
    print(
        f"{plain_line(output)}: {len(given.table.t)} rows from "
        f"{plain_line(f'{given.source}{heights}')}; t = 0 is the stamp {given.origin_ns} ns"
    )
    return 0


def export_tables(arguments: argparse.Namespace) -> int:
    """Exports the selected topics of a bag, one file per topic."""
    if not is_table(arguments.output):
        check_outside(arguments.output, [arguments.bag])
    reader = BagReader(arguments.bag)
    targets = export_targets(
        arguments.bag, reader, arguments.topics, arguments.output, arguments.format
    )
    total = sum(target.messages for target in targets.values())
    with Progress("export", total, Unit("messages")) as progress:
        result = export_topics(
            reader, targets, overwrite=arguments.overwrite, progress=progress.add
        )
    tell(result.notes)
    for path, rows in result.rows.items():
        print(plain_line(f"{path}: {rows} rows"))
    return 0


def tell(notes: Iterable[str]) -> None:
    """Prints, on standard error, notes about data missing from the exported files."""
    for note in notes:
        print(plain_line(f"slosh export: {note}"), file=sys.stderr)
