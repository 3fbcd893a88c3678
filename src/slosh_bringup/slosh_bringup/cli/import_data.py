"""`slosh import`: public measured data to bags."""

from __future__ import annotations

import argparse
from pathlib import Path

from tqdm import tqdm

from slosh_bag.antisloshing import find_runs, import_antisloshing


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument("source", choices=["antisloshing"], help="which data set")
    parser.add_argument("folder", type=Path, help="the data set: holds heights/ and poses/")
    parser.add_argument("-o", "--output", type=Path, required=True, help="gets one bag per run")


def run(arguments: argparse.Namespace) -> int:
    """Writes the bags."""
    count = len(find_runs(arguments.folder))
    with tqdm(total=count, desc="import", unit="run") as bar:
        bags = import_antisloshing(
            arguments.folder, arguments.output, lambda run: bar.update() and None
        )
    print(f"{len(bags)} bags in {arguments.output}")
    return 0
