"""Checks a ROS parameter file against the parameters of the nodes that read it.

ROS ignores what fits no node and no parameter. A limit that is mistyped would be no limit.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

import yaml

from slosh_base.files.errors import SloshFileError
from slosh_base.files.nearest import nearest
from slosh_base.files.yaml_document import FLOAT_TAG, INT_TAG, brief, read_yaml, shown
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.processes import kind_of, known_nodes, module_of

LEAF = "ros__parameters"
OF_EVERY_NODE = ("use_sim_time", "start_type_description_service")
"""What rclpy itself reads, beside `qos_overrides`."""
GIVEN_ELSEWHERE = {
    "camera": ("calibration", "container"),
    "estimator": ("model",),
    "monitor": ("cameras",),
    "recorder": ("output",),
}
"""What `slosh cell`, `slosh demo` and the launch file give the nodes over any file."""
_WILDCARDS = {"**": r"(/\w+)*", "*": r"/\w+"}


class _Entry(NamedTuple):
    """A parameter in a file: its line number, node pattern and name."""

    line: int
    pattern: str
    name: str


def check_parameter_file(path: Path, namespace: str, further: Collection[str] = ()) -> None:
    """Checks that every entry of the file sets a declared parameter of a known node.

    Args:
        path: the file.
        namespace: of the nodes.
        further: names of nodes beside `known_nodes`, such as camera_left.

    Raises:
        SloshBringupError: no such file, no parameter file, a node or a parameter that nobody has,
            or one that is given elsewhere; one line.
    """
    names = (*known_nodes(), *further)
    nodes = {f"{namespace.rstrip('/')}/{name}": kind_of(name) for name in names}
    for line, pattern, parameter in _entries(path):
        reached = [name for full, name in nodes.items() if _fits(pattern, full)]
        if not reached:
            raise SloshBringupError(
                f"{path}:{line}: {brief(pattern)}: no such node (known: {', '.join(nodes)}; "
                "/**/NAME matches every namespace)"
            )
        if any(parameter in GIVEN_ELSEWHERE.get(name, ()) for name in reached):
            raise SloshBringupError(
                f"{path}:{line}: {brief(pattern)}: {parameter} has no effect here: it comes from "
                "the cell file, the command line or the launch file's arguments"
            )
        known = set().union(*map(parameter_names, reached))
        if parameter not in known and not parameter.startswith("qos_overrides."):
            raise SloshBringupError(
                f"{path}:{line}: {brief(pattern)}: unknown parameter {shown(parameter)} "
                f"({_suggestion(parameter, known)})"
            )


def parameter_names(node: str) -> set[str]:
    """Returns the names of the parameters that a node declares."""
    specs = importlib.import_module(module_of(node)).PARAMETERS
    return {*OF_EVERY_NODE, *(spec.name for spec in specs)}


def _entries(path: Path) -> Iterator[_Entry]:
    """Yields the parameters in a file, with nested names joined by dots."""
    try:
        root = read_yaml(path).root
    except SloshFileError as error:
        raise SloshBringupError(str(error)) from None
    if root is not None:  # an empty file sets nothing
        yield from _of_nodes(path, root, "")


def _of_nodes(path: Path, node: yaml.Node, prefix: str) -> Iterator[_Entry]:
    for key, value in _items(path, node, f"node names with {LEAF}"):
        if key.value != LEAF:
            yield from _of_nodes(path, value, f"{prefix}/{key.value.strip('/')}")
        elif prefix:
            yield from _of_parameters(path, value, prefix, "")
        else:
            raise SloshBringupError(f"{path}:{_line(key)}: {LEAF} needs a node's name above it")


def _of_parameters(path: Path, node: yaml.Node, pattern: str, prefix: str) -> Iterator[_Entry]:
    for key, value in _items(path, node, "names of parameters"):
        if isinstance(value, yaml.SequenceNode) and {INT_TAG, FLOAT_TAG} <= {
            item.tag for item in value.value
        }:
            raise SloshBringupError(
                f"{path}:{_line(key)}: {brief(key.value)}: ROS does not accept a list of "
                "integers and floats; write 0.0 for 0"
            )
        if isinstance(value, yaml.MappingNode):
            yield from _of_parameters(path, value, pattern, f"{prefix}{key.value}.")
        else:
            yield _Entry(_line(key), pattern, f"{prefix}{key.value}")


def _items(path: Path, node: yaml.Node, wanted: str) -> list[tuple[yaml.Node, yaml.Node]]:
    if not isinstance(node, yaml.MappingNode) or not all(
        isinstance(key, yaml.ScalarNode) for key, _ in node.value
    ):
        raise SloshBringupError(f"{path}:{_line(node)}: a mapping from {wanted} is needed here")
    return list(node.value)


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1


def _fits(pattern: str, node: str) -> bool:
    """Whether a ROS node-name pattern matches a full node name; ** matches any namespaces."""
    words = pattern[1:].split("/")
    expression = "".join(_WILDCARDS.get(word, "/" + re.escape(word)) for word in words)
    return re.fullmatch(expression, node) is not None


def _suggestion(name: str, known: Collection[str]) -> str:
    near = nearest(name, known)
    return f"meant {near}?" if near else f"known: {', '.join(sorted(known))}"
