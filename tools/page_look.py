"""What tests put into a report's page, and ask of it in a browser."""

from __future__ import annotations

import struct
import zlib
from typing import Any

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
    """An image: a grey square."""

    def chunk(name: bytes, data: bytes) -> bytes:
        checksum = struct.pack(">I", zlib.crc32(name + data))
        return struct.pack(">I", len(data)) + name + data + checksum

    rows = b"".join(b"\x00" + b"\x80" * side for _ in range(side))
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0))
    body = chunk(b"IDAT", zlib.compress(rows))
    return b"\x89PNG\r\n\x1a\n" + header + body + chunk(b"IEND", b"")


def at(document: Any, path: str) -> Any:
    """What a JSON pointer (RFC 6901) without escapes points at."""
    for step in path.split("/")[1:]:
        document = document[int(step) if isinstance(document, list) else step]
    return document
