"""Option that sets how far below the rim the liquid must stay."""

from __future__ import annotations

import argparse
import math

from slosh_bringup.cli.quantities import HEIGHT


def add_rim_distance(parser: argparse.ArgumentParser) -> None:
    """Adds the option `--rim-distance` to the argument parser."""
    parser.add_argument(
        "--rim-distance", type=HEIGHT, default=0.0, metavar="M",
        help="least vertical distance of the liquid to the rim [m], an alternative to --limit; "
        "the model must define the rim (default 0: the rim itself)",
    )  # fmt: skip


def rim_words(distance: float) -> str:
    """Describes how far below or above the rim the liquid reaches; empty if that is unknown."""
    if math.isnan(distance):
        return ""
    return f", {1e3 * abs(distance):.1f} mm {'below' if distance >= 0.0 else 'above'} the rim"
