"""Puts generated text into the pages as they are built: effects, parameters, commands.

A page holds a marker; `PARTS` says what takes its place.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

import command_table
import effect_pages
import parameter_tables

from slosh_model.effects.registry import EFFECTS


def parts() -> Mapping[str, Callable[[], str]]:
    """By page: what makes its generated text."""
    pages: dict[str, Callable[[], str]] = {
        f"effects/{name}": lambda effect=effect: effect_pages.part(effect)
        for name, effect in EFFECTS.items()
    }
    return pages | {
        "commands": command_table.tables,
        "effects/index": effect_pages.table,
        "interfaces": parameter_tables.tables,
    }


def fill(app: Sphinx, page: str, source: list[str]) -> None:
    """Replaces the marker of a page."""
    if page in PARTS:
        source[0] = filled(source[0], PARTS[page]())


def filled(text: str, generated: str) -> str:
    """The page with its generated text.

    Raises:
        ValueError: the page lacks the marker.
    """
    head, marker, rest = text.partition(MARKER)
    if not marker:
        raise ValueError(f"the page needs the line {MARKER}")
    return f"{head}{generated}{rest}"


MARKER = "<!-- generated -->\n"
PARTS = parts()


def setup(app: Sphinx) -> dict[str, bool]:
    """Registers the extension."""
    app.connect("source-read", fill)
    return {"parallel_read_safe": True}
