"""Tests that the generated text in the pages is that of the code."""

import importlib
import re
import sys
from pathlib import Path

import pytest

from slosh_bringup.cli.main import all_commands
from slosh_bringup.processes import known_nodes
from slosh_model.effects.registry import EFFECTS

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
ANEW = "run tools/run python tools/generated_text.py"


def loaded():
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        return importlib.import_module("generated_text")
    finally:
        sys.path.remove(str(ROOT / "tools"))


TOOL = loaded()
PARTS = TOOL.parts()


@pytest.mark.parametrize("name", PARTS)
def test_a_page_holds_what_the_code_says(name):
    text = (DOCS / name).read_text(encoding="utf-8")
    assert text == TOOL.filled(text, PARTS[name]()), ANEW


def test_all_commands_nodes_and_effects_are_in_the_pages():
    commands = (DOCS / "commands.md").read_text(encoding="utf-8")
    assert re.findall(r"^- \[`slosh ([a-z-]+)`\]", commands, re.M) == list(all_commands())
    assert "`[--rate R] [--start S]" in commands
    assert all(f"<br>`{kind} " in commands for kind in ("antisloshing", "table", "rosbag"))
    assert TOOL.PAGES.keys() <= all_commands().keys()
    interfaces = (DOCS / "interfaces.md").read_text(encoding="utf-8")
    assert re.findall(r"^### `(\w+)`$", interfaces, re.M) == sorted(known_nodes())
    line = r"- `max_gap` \(`0.05`\): .+ \[s\]; 0.001 … 1; dynamic"
    assert re.search(line, interfaces)
    index = (DOCS / "effects" / "index.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| \[`(\w+)`\]", index, re.M) == list(EFFECTS)


def test_no_page_has_a_hole():
    for page in DOCS.rglob("*.md"):
        if "_build" not in page.parts:
            text = page.read_text(encoding="utf-8")
            assert not text.rstrip().endswith("<!-- generated -->"), page
            for marker in re.findall(r"^<!-- .*generated.*$", text, re.M):
                assert f"{marker}\n\n" in (TOOL.START, "<!-- end generated -->\n\n"), page
            assert text.count(TOOL.START) == (page.relative_to(DOCS).as_posix() in PARTS), page


def test_a_page_without_a_place_for_the_text_is_an_error():
    assert TOOL.filled(f"a\n{TOOL.START}old\n{TOOL.END}z\n", "new\n") == (
        f"a\n{TOOL.START}new\n{TOOL.END}z\n"
    )
    for text in ("a\n", f"a\n{TOOL.START}old\n", f"a\n{TOOL.END}"):
        with pytest.raises(ValueError, match="needs the lines"):
            TOOL.filled(text, "new\n")
