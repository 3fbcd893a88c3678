"""Add-ons: packages that bring commands, nodes and more of their own, found by an entry point.

An add-on names a value of `AddOn` in the group `slosh.addons` of its setup.py. The core imports
none of them: it works without. What needs ROS 2 or takes time to load is named by its module, and
imported where it is used.
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


class CellNode(NamedTuple):
    """A node that a cell starts where its cell file, or an argument of the launch file, says so.

    Attributes:
        node: its name, in `AddOn.nodes`.
        summary: what it does, for the list of launch arguments.
        choices: what may be given; empty: true or false.
        parameter: of the node, that is set to what is given; empty: none is.
        takes: parameters that it has from the cell's own settings: model, urdf, tool_frame.
        begins: whether it has `starts_at_rest`: a node that is restarted must not believe it.
    """

    node: str
    summary: str
    choices: tuple[str, ...] = ()
    parameter: str = ""
    takes: tuple[str, ...] = ()
    begins: bool = False


class AddOn(NamedTuple):
    """What an add-on brings.

    Attributes:
        commands: subcommands by their names.
        nodes: modules with a `main` by the names of their nodes.
        cell_nodes: those that a cell may start, by the key of the cell file.
        replay_rows: modules with a `ROW` of slosh_replay.journaled by the names of their nodes.
        figures: modules with `figure(message)`, which makes the figure of a topic's newest message
            for the operator's page (slosh_bringup.watch.state.Figure), by the topic's name.
        demo_options: modules with `add_arguments(parser)` and `changed(arguments, demo)`, which
            adds to what `slosh demo` runs (slosh_bringup.cli.demo.Demo).
        compiled: modules that import all of its compiled functions.
        mode_solver: module that computes the modes of containers: see slosh_shapes.solver.
    """

    commands: Mapping[str, Command] = {}
    nodes: Mapping[str, str] = {}
    cell_nodes: Mapping[str, CellNode] = {}
    replay_rows: Mapping[str, str] = {}
    figures: Mapping[str, str] = {}
    demo_options: tuple[str, ...] = ()
    compiled: tuple[str, ...] = ()
    mode_solver: str = ""


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


def cell_nodes() -> Mapping[str, CellNode]:
    """Returns the nodes of all add-ons that a cell may start, by the key of the cell file."""
    return {key: node for one in add_ons() for key, node in one.cell_nodes.items()}
