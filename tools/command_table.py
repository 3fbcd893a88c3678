"""Formats the list of commands as tables for docs/commands.md."""

from __future__ import annotations

from pathlib import Path

from slosh_bringup.cli.main import GROUPS

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGES = {
    "certificates": "robot.md#controllers",
    "demo": "start.md",
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
    "plc": "robot.md#controllers",
    "query": "robot.md#recording",
    "recover": "files.md#unfinished-and-damaged-bags",
    "simulate": "files.md#motion-table-csv-csvgz",
    "store": "robot.md#recording",
}
"""Pages of commands that have no page of their own name."""


def tables() -> str:
    """Formats one Markdown table for each group of commands, in the order of `slosh --help`."""
    parts = []
    for group, commands in GROUPS.items():
        lines = "\n".join(f"| {linked(name)} | {text} |" for name, text in commands.items())
        parts.append(f"\n## {group.capitalize()}\n\n| command | purpose |\n|---|---|\n{lines}\n")
    return "".join(parts)


def linked(name: str) -> str:
    """Formats a command's name, as a link to the command's page if there is one."""
    page = PAGES.get(name, f"{name}.md")
    shown = f"`slosh {name}`"
    return f"[{shown}]({page})" if (DOCS / page.partition("#")[0]).exists() else shown
