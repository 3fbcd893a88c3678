"""Formats the parameters of all nodes as tables for docs/interfaces.md."""

from __future__ import annotations

import importlib

from slosh_bringup.processes import NODES
from slosh_msgs_py.node.parameters import ParameterSpec


def tables() -> str:
    """Formats one Markdown table per node, from the declarations of its parameters."""
    parts = []
    for name, module in sorted(NODES.items()):
        specs = importlib.import_module(module).PARAMETERS
        lines = "\n".join(map(line, specs))
        parts.append(
            f"\n### `{name}`\n\n| parameter | default | meaning |\n|---|---|---|\n{lines}\n"
        )
    return "".join(parts)


def line(spec: ParameterSpec) -> str:
    """Formats one ROS parameter as a Markdown table row."""
    meaning = spec.description
    if spec.choices:
        meaning += f"; one of {', '.join(spec.choices)}"
    if spec.bounds:
        meaning += f"; {spec.bounds[0]:g} … {spec.bounds[1]:g}"
    if not spec.read_only:
        meaning += "; dynamic"
    return f"| `{spec.name}` | `{escaped(repr(spec.default))}` | {escaped(meaning)} |"


def escaped(text: str) -> str:
    """Escapes vertical bars, which would end a Markdown table cell."""
    return text.replace("|", "\\|")
