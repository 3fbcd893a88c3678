"""Writes into the pages what the code says: commands, parameters, effects.

`tools/run python tools/generated_text.py` rewrites all pages; a test compares them.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

import effect_pages

from slosh_bringup.cli.main import all_groups, build_parser
from slosh_bringup.processes import known_nodes
from slosh_model.effects.registry import EFFECTS
from slosh_msgs_py.node.parameters import ParameterSpec

DOCS = Path(__file__).resolve().parent.parent / "docs"
START = "<!-- generated: tools/run python tools/generated_text.py -->\n\n"
END = "\n<!-- end generated -->\n"
PAGES = {
    "call": "interfaces.md",
    "calibrate": "calibration.md",
    "cell": "robot.md",
    "certificates": "robot.md#controllers",
    "demo": "start.md",
    "doctor": "start.md",
    "explain": "effects/index.md",
    "export": "files.md#export-of-topics",
    "import": "files.md#tables-of-other-programs",
    "ingest": "robot.md#recording",
    "migrate": "deployment.md#upgrade",
    "modes": "physics.md#containers-with-a-contour",
    "motion": "identify.md#motions",
    "motion-map": "shape.md#motion-maps",
    "mounting": "input_checks.md#a-second-source",
    "new": "start.md",
    "node": "robot.md#start",
    "plc": "robot.md#controllers",
    "query": "robot.md#recording",
    "recover": "files.md#unfinished-and-damaged-bags",
    "simulate": "files.md#motion-table-csv-csvgz",
    "store": "robot.md#recording",
}
"""Pages of commands that have no page of their own name."""


def main() -> int:
    """Rewrites the generated text of all pages."""
    for name, text in parts().items():
        page = DOCS / name
        page.write_text(filled(page.read_text(encoding="utf-8"), text()), encoding="utf-8")
    return 0


def parts() -> Mapping[str, Callable[[], str]]:
    """By page, relative to docs: what makes its generated text."""
    pages: dict[str, Callable[[], str]] = {
        f"effects/{name}.md": partial(effect_pages.part, effect)
        for name, effect in EFFECTS.items()
    }
    return pages | {
        "commands.md": commands,
        "effects/index.md": effect_pages.table,
        "interfaces.md": parameters,
    }


def filled(text: str, generated: str) -> str:
    """Returns a page with its generated text.

    Raises:
        ValueError: the page lacks the lines between which it stands.
    """
    head, start, rest = text.partition(START)
    _, end, tail = rest.partition(END)
    if not start or not end:
        raise ValueError(f"the page needs the lines {START.strip()} and {END.strip()}")
    return f"{head}{START}{generated}{END}{tail}"


def commands() -> str:
    """Lists all commands with purpose and options, in the order of `slosh --help`."""
    parts = []
    for group, names in all_groups().items():
        lines = "\n".join(
            "<br>".join([f"- {linked(name)}: {text}", *(f"`{line}`" for line in usages(name))])
            for name, text in names.items()
        )
        parts.append(f"## {group.capitalize()}\n\n{lines}\n")
    return "\n".join(parts)


def linked(name: str) -> str:
    """Formats a command's name as a link to its page."""
    return f"[`slosh {name}`]({PAGES.get(name, f'{name}.md')})"


def usages(name: str) -> Iterator[str]:
    """Yields the arguments and options of a command, or of each kind that it has."""
    parser = _kinds(build_parser(name))[name]
    for kind, inner in _kinds(parser).items() or [("", parser)]:
        words = " ".join(inner.format_usage().split())
        options = words.removeprefix(f"usage: {inner.prog} [-h]")
        yield f"{kind}{options}".strip()


def _kinds(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Returns the subcommands of a parser."""
    found: dict[str, argparse.ArgumentParser] = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found |= action.choices
    return found


def parameters() -> str:
    """Lists the parameters of each node, from their declarations."""
    parts = []
    for name, module in sorted(known_nodes().items()):
        specs = importlib.import_module(module).PARAMETERS
        lines = "\n".join(map(line, specs))
        parts.append(f"### `{name}`\n\n{lines}\n")
    return "\n".join(parts)


def line(spec: ParameterSpec) -> str:
    """Formats one ROS parameter: name, default, meaning, what it may be."""
    meaning = spec.description
    if spec.choices:
        meaning += f"; one of {', '.join(spec.choices)}"
    if spec.bounds:
        meaning += f"; {spec.bounds[0]:g} … {spec.bounds[1]:g}"
    if not spec.read_only:
        meaning += "; dynamic"
    default = f" (`{spec.default!r}`)" if spec.default != "" else ""
    return f"- `{spec.name}`{default}: {meaning}"


if __name__ == "__main__":
    sys.exit(main())
