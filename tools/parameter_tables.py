"""Writes the nodes' parameter tables into docs/interfaces.md.

tools/run python tools/parameter_tables.py
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from slosh_bringup.processes import NODES
from slosh_msgs_py.node.parameters import ParameterSpec

PAGE = Path(__file__).resolve().parent.parent / "docs" / "interfaces.md"
START = "<!-- parameters -->"


def main() -> int:
    """Replaces everything after the marker."""
    head = PAGE.read_text(encoding="utf-8").split(START)[0]
    PAGE.write_text(f"{head}{START}\n{tables()}", encoding="utf-8")
    return 0


def tables() -> str:
    """A table per node, from its declarations."""
    parts = []
    for name, module in sorted(NODES.items()):
        specs = importlib.import_module(module).PARAMETERS
        lines = "\n".join(map(line, specs))
        parts.append(
            f"\n### `{name}`\n\n| parameter | default | meaning |\n|---|---|---|\n{lines}\n"
        )
    return "".join(parts)


def line(spec: ParameterSpec) -> str:
    """One parameter as a line of a Markdown table."""
    meaning = spec.description
    if spec.choices:
        meaning += f"; one of {', '.join(spec.choices)}"
    if not spec.read_only:
        meaning += "; dynamic"
    return f"| `{spec.name}` | `{escaped(repr(spec.default))}` | {escaped(meaning)} |"


def escaped(text: str) -> str:
    """Without bars that would end a cell."""
    return text.replace("|", "\\|")


if __name__ == "__main__":
    sys.exit(main())
