"""Tests that the built pages load nothing from outside; formulae and search work offline."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
pytestmark = pytest.mark.timeout(300)
# What a browser fetches by itself; a link that is clicked may lead anywhere.
LOADED = {
    "script": "src", "img": "src", "iframe": "src", "source": "src", "object": "data",
    "link": "href",
}  # fmt: skip


def build(folder):
    """Builds the documentation pages anew; returns what is complained of."""
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    done = subprocess.run(
        [*command, str(ROOT / "docs"), str(folder)],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    return done.stderr if done.returncode else ""


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


@pytest.mark.long
def test_nothing_is_loaded_from_outside(tmp_path):
    built = tmp_path / "html"
    assert build(built) == ""
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
