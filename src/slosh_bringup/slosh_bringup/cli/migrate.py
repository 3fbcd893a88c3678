"""`slosh migrate`: rewrites files of older format versions in the current one."""

from __future__ import annotations

import argparse
from pathlib import Path

from slosh_base.files import write_text
from slosh_base.files.bounded_text import read_text
from slosh_base.files.file_version import FORMATS, migrated
from slosh_base.files.plain_text import plain_line
from slosh_base.files.yaml_document import LONGEST

EPILOG = """Files of older versions are read as they are; this makes them ready for the next one.
Only the key `version` and renamed keys change: comments, order and numbers stay."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh migrate` to the argument parser."""
    parser.epilog = EPILOG
    names = ", ".join(one.name for one in FORMATS)
    parser.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help=f"files to rewrite, such as {names}"
    )
    parser.add_argument(
        "--dry-run", action="store_true", help="only print which files would be rewritten"
    )


def run(arguments: argparse.Namespace) -> int:
    """Rewrites all given files, or none of them if one cannot be converted."""
    found = [
        (path, migrated(read_text(path, LONGEST), str(path)))
        for path in dict.fromkeys(arguments.files)
    ]
    done = "would be rewritten" if arguments.dry_run else "rewritten"
    for path, file in found:
        current = file.file_format.current
        if file.version == current:
            print(plain_line(f"{path}: {file.file_format.name}, version {current} already"))
            continue
        if not arguments.dry_run:
            write_text(path, file.text)
        print(
            plain_line(
                f"{path}: {file.file_format.name}, version {file.version} -> {current}: {done}"
            )
        )
    return 0
