"""Add-ons: packages that bring commands and nodes of their own, found by an entry point.

An add-on names a value of `AddOn` in the group `slosh.addons` of its setup.py. The core imports
none of them: it works without.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

from slosh_base.files.plain_text import plain_line

GROUP = "slosh.addons"


class Command(NamedTuple):
    """A subcommand of `slosh`: its group in the help, what it does, and its module.

    The module has `add_arguments(parser)` and `run(arguments)`, as those in slosh_bringup.cli.
    """

    group: str
    summary: str
    module: str


class AddOn(NamedTuple):
    """What an add-on brings.

    Attributes:
        commands: subcommands by their names.
        nodes: modules with a `main` by the names of their nodes.
    """

    commands: Mapping[str, Command] = {}
    nodes: Mapping[str, str] = {}


@cache
def add_ons() -> tuple[AddOn, ...]:
    """Returns the installed add-ons in the order of their names.

    One that cannot be imported is left out, with a line on standard error.
    """
    from importlib.metadata import entry_points  # most commands do without

    points = {point.name: point for point in entry_points(group=GROUP)}
    found = []
    for name, point in sorted(points.items()):
        try:
            found.append(point.load())
        except ImportError as error:
            print(plain_line(f"slosh: add-on {name} left out: {error}"), file=sys.stderr)
    return tuple(found)
