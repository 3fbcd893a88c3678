"""Option that sets how far below the rim the liquid must stay."""

from __future__ import annotations

import argparse

from slosh_bringup.cli.quantities import HEIGHT


def add_rim_distance(parser: argparse.ArgumentParser) -> None:
    """Adds the option `--rim-distance` to the argument parser."""
    parser.add_argument(
        "--rim-distance", type=HEIGHT, default=0.0, metavar="M",
        help="least vertical distance of the liquid to the rim [m], an alternative to --limit; "
        "the model must define the rim (default 0: the rim itself)",
    )  # fmt: skip
