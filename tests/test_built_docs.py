"""Tests that the built pages load nothing from outside; formulae and search work offline."""

import importlib
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

from slosh_bringup.cli.main import COMMANDS
from slosh_bringup.processes import NODES
from slosh_model.effects.registry import EFFECTS

ROOT = Path(__file__).resolve().parent.parent
pytestmark = pytest.mark.timeout(300)
# What a browser fetches by itself; a link that is clicked may lead anywhere.
LOADED = {
    "script": "src", "img": "src", "iframe": "src", "source": "src", "object": "data",
    "link": "href",
}  # fmt: skip


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Builds the documentation pages anew; returns their folder."""
    folder = tmp_path_factory.mktemp("html")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    done = subprocess.run(
        [*command, str(ROOT / "docs"), str(folder)],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


class Addresses(HTMLParser):
    """Collects the addresses that a page loads, and its formulae."""

    def __init__(self, page):
        super().__init__()
        self.loaded, self.formulae = [], 0
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.formulae += tag == "math"
        # Of links those to where other pages are load nothing.
        if tag in LOADED and given.get("rel") not in ("index", "search", "next", "prev"):
            self.loaded.append(given.get(LOADED[tag]) or "")


def test_nothing_is_loaded_from_outside(built):
    pages = sorted(built.rglob("*.html"))
    assert len(pages) > 60
    for page in pages:
        for address in Addresses(page).loaded:
            assert not re.match(r"(\w+:)?//", address), f"{page.name}: {address}"
            path = re.split(r"[?#]", address)[0]
            assert not path or (page.parent / path).exists(), f"{page.name}: {address}"
    for sheet in built.rglob("*.css"):
        text = sheet.read_text(encoding="utf-8")
        assert not re.search(r"(@import|url\()\s*['\"]?(https?:)?//", text), sheet.name


def test_generated_text_is_in_its_pages(built):
    for name, effect in EFFECTS.items():
        page = (built / "effects" / f"{name}.html").read_text(encoding="utf-8")
        assert f"Acts on: {effect.stages[0].value}" in page
        assert all(f">{parameter.name}<" in page for parameter in effect.parameters)
        assert f"{name}.svg" in page
    index = (built / "effects" / "index.html").read_text(encoding="utf-8")
    assert index.count("<td><p><a ") == len(EFFECTS)
    commands = (built / "commands.html").read_text(encoding="utf-8")
    for name in COMMANDS:
        assert f'<span class="pre">{name}</span></code>' in commands, name
    interfaces = (built / "interfaces.html").read_text(encoding="utf-8")
    for node, module in NODES.items():
        assert f'id="{node}"' in interfaces
        for spec in importlib.import_module(module).PARAMETERS:
            assert f">{spec.name}<" in interfaces
