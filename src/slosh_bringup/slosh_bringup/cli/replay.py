"""`slosh replay`: the estimator's and the monitor's cores over bags, no DDS, no clock."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from tqdm import tqdm

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import bag_files
from slosh_bag.replay import replay_bag
from slosh_bag.replay_report import Surroundings, replay_report
from slosh_bag.replay_result import ReplayResult, accuracy_table
from slosh_discovery.report import render_report
from slosh_estimator.model_file import read_model
from slosh_model.model import Model
from slosh_model.model_text import format_model


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.add_argument("bags", type=Path, nargs="+", metavar="BAG", help="bag, or folder of bags")
    parser.add_argument(
        "--model", type=Path, help="model.yaml; without it the bag's own container"
    )
    parser.add_argument("-o", "--output", type=Path, help="gets a report and the figures per bag")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.add_argument("--check", action="store_true", help="fail where a bag cannot be replayed")


def run(arguments: argparse.Namespace) -> int:
    """Replays the bags; one that cannot be replayed is told and does not stop the others."""
    model = read_model(arguments.model) if arguments.model else None
    bags = [bag for path in arguments.bags for bag in find_bags(path)]
    results = []
    for bag in tqdm(bags, desc="replay", unit="bag", disable=len(bags) == 1):
        try:
            result = replay_bag(bag, model)
        except SloshBagError as error:
            print(f"slosh replay: {error}", file=sys.stderr)
            continue
        for warning in result.warnings:
            print(f"slosh replay: warning: {warning}", file=sys.stderr)
        if arguments.output:
            write_result(arguments.output, result, model)
        results.append(result)
    if arguments.json:
        print(json.dumps([json.loads(result.to_json()) for result in results], indent=2))
    else:
        print(accuracy_table(results), end="")
    failed = len(results) < len(bags)
    if failed and not arguments.check:
        return 0 if results else 2
    return 1 if failed else 0


def find_bags(path: Path) -> list[Path]:
    """A bag, or the bags in a folder.

    Raises:
        SloshBagError: there is none.
    """
    if path.is_dir() and not any(path.glob("*.mcap")):
        bags = sorted({file.parent for file in path.glob("**/*.mcap")})
        if not bags:
            raise SloshBagError(f"{path}: no .mcap file in this folder or below it")
        return bags
    bag_files(path)  # tells at once what is wrong with it
    return [path]


def write_result(folder: Path, result: ReplayResult, model: Model | None) -> None:
    """Writes DIR/<bag>.html and DIR/<bag>.json."""
    folder.mkdir(parents=True, exist_ok=True)
    around = Surroundings(
        subtitle=f"replay, driven by {result.source}",
        model_text=format_model(model) if model else "",
    )
    page = render_report(replay_report(result, around))
    (folder / f"{result.name}.html").write_text(page, encoding="utf-8")
    (folder / f"{result.name}.json").write_text(result.to_json(series=True) + "\n")
