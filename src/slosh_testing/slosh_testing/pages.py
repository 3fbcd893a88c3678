"""Checks of HTML pages that hold for every page, and helpers for tests in a browser."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping
from typing import Any

A4 = 688
"""What is left of an A4 sheet between the margins [CSS px]."""

LOOK = """
const all = (selector) => [...document.querySelectorAll(selector)];
const shown = (element) => element.getClientRects().length > 0;
return {
  hacked: window.hacked ?? null,
  scripts: document.scripts.length,
  heading: document.querySelector("h1").textContent,
  width: document.documentElement.clientWidth,
  wanted: document.documentElement.scrollWidth,
  background: window.getComputedStyle(document.body).backgroundColor,
  line: window.getComputedStyle(document.querySelector(".chart path[style*=nonlinear]")).stroke,
  charts: all(".chart svg").filter(shown).map((svg) => svg.getBoundingClientRect().width),
  letters: all(".chart svg text").filter(shown).map((e) => e.getBoundingClientRect().height),
  images: all("img").map((image) => image.naturalWidth),
  cut: all(".scroll").filter((part) => part.scrollWidth > part.clientWidth + 1).length,
  named: all("[role=img], img").every(
    (e) => (e.getAttribute("aria-label") ?? e.getAttribute("alt")).length > 3),
  numbers: all("data").map((e) => [e.dataset.path, e.value, e.textContent]),
  folded: all("details td").filter((e) => e.checkVisibility({contentVisibilityAuto: true})).length,
  bare: all("td.n").filter((e) => e.querySelector("data") === null).map((e) => e.textContent),
};
"""
"""Body of a JavaScript function of `document` and `window`: what the page shows, as JSON."""


def grey_png(side: int = 8) -> bytes:
    """Returns a PNG image of a grey square."""

    def chunk(name: bytes, data: bytes) -> bytes:
        checksum = struct.pack(">I", zlib.crc32(name + data))
        return struct.pack(">I", len(data)) + name + data + checksum

    rows = b"".join(b"\x00" + b"\x80" * side for _ in range(side))
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0))
    body = chunk(b"IDAT", zlib.compress(rows))
    return b"\x89PNG\r\n\x1a\n" + header + body + chunk(b"IEND", b"")


def at(document: Any, path: str) -> Any:
    """Returns the value at a JSON pointer (RFC 6901) in a document."""
    for part in path.split("/")[1:]:
        step = part.replace("~1", "/").replace("~0", "~")
        document = document[int(step) if isinstance(document, list) else step]
    return document


def on_paper(page: str) -> str:
    """Returns an HTML page whose print style is shown on the screen, as wide as A4 paper."""
    return page.replace("@media print", "@media all").replace("(max-width: 44rem)", "print")


def check_numbers(seen: Mapping[str, Any], document: Any) -> None:
    """Checks that each number of an HTML page equals the JSON document's in value and type."""
    for path, value, _ in seen["numbers"]:
        there = at(document, path)
        assert type(there) is type(json.loads(value)), path
        assert there == json.loads(value), path


class EveryPage:
    """Tests that apply to any page; the fixture `seen` has its views and console output."""

    def test_no_error_is_in_the_console(self, seen: Mapping[str, Any]) -> None:
        assert seen["console"] == []

    def test_nothing_is_wider_than_the_screen(self, seen: Mapping[str, Any]) -> None:
        for view in ("desktop", "phone", "small phone", "paper", "hostile"):
            assert seen[view]["wanted"] <= seen[view]["width"], view

    def test_no_table_is_cut_on_paper(self, seen: Mapping[str, Any]) -> None:
        assert seen["paper"]["cut"] == 0

    def test_colours_follow_the_reader_and_paper_is_white(self, seen: Mapping[str, Any]) -> None:
        assert seen["desktop"]["background"] == "rgb(251, 250, 247)"
        assert seen["dark"]["background"] == "rgb(20, 23, 27)"
        assert seen["dark"]["line"] != seen["desktop"]["line"]
        assert seen["paper"]["background"] == "rgb(255, 255, 255)"
