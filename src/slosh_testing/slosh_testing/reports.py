"""Example reports: one with every part, and one with malicious texts."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np

from slosh_report.run_report import (
    AzimuthSeries,
    CheckRow,
    DifferenceRow,
    ExcessSpan,
    Fact,
    Frame,
    KeyFigure,
    ModelRow,
    RunMotion,
    RunReport,
    RunVerdict,
    Status,
    TopicRow,
    VerificationRow,
)

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


EVIL = "<img src=x onerror=hacked=1>'\"\x1b[31m\nslosh: all is well\u202e\u2028"
FORGED = "slosh: all is well"
CONTROL = set("\x1b\x07\u202e\u2028")

NAN = float("nan")
T = np.arange(0.0, 20.0, 1.0 / 60.0)
NAMES = ("2D-L", "3D-L", "2D-NL", "3D-NL")


def rows(seed):
    """Returns example results of four models, random by seed, with unrounded numbers."""
    noise = np.random.default_rng(seed).random((4, 3)) / 3.0
    return tuple(
        ModelRow(name, 2e-3 * a, b - 0.2, 3e-3 * c, 3.2 + a, 600 + seed)
        for name, (a, b, c) in zip(NAMES, noise.tolist(), strict=True)
    )


def full_report():
    """Returns a report with content in every part of its HTML page."""
    measured = 0.0213 * np.sin(0.7 * T) ** 2
    estimated = AzimuthSeries("3D-NL", T, np.angle(np.exp(0.9j * T)), 0.98 * measured)
    return RunReport(
        title="cup_two_motions",
        subtitle="replay, driven by /slosh/accel",
        t=T,
        measured=np.where((T > 8.0) & (T < 9.0), np.nan, measured),
        linear=1.2 * measured,
        nonlinear=0.98 * measured,
        linear_name="3D-L",
        nonlinear_name="3D-NL",
        limit=0.0181,
        saturated=measured > 0.0212,
        key_figures=(
            KeyFigure("highest measured", 0.0212987, "mm"),
            KeyFigure("ε 3D-NL", -0.0234567, "%", "3D-L: +20.0 %"),
            KeyFigure("model", "3D-NL"),
        ),
        facts=(Fact("bag", "bags/cup_two_motions"),),
        events=(
            ExcessSpan("measured", 1.81, 2.74, 0.0181, 0.0213, "above the limit", 2.2439),
            ExcessSpan("estimated", 19.5, NAN, 0.0181, 0.0191),
        ),
        models=rows(1),
        motions=(
            RunMotion("RD_2D", 0.5, 8.123456, 0.0212987, rows(2)),
            RunMotion("LE_3D", 9.5, 19.0, 0.02, rows(3)),
        ),
        frames=(
            Frame(grey_png(), "highest: 2.24 s", "image/png", 2.24),
            Frame(grey_png(), "first", "image/png"),
        ),
        topics=(
            TopicRow("/slosh/accel", "geometry_msgs/msg/AccelStamped", 20000, 999.73, 0),
            TopicRow("/slosh/free_surface", "slosh_msgs/msg/FreeSurface", 1200, 59.94),
        ),
        model_text="container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\n",
        effects={"fill_level": "More or less liquid than the model says."},
        notes=("a note",),
        warnings=("0.4 s are lost at the end",),
        status=Status(RunVerdict.FAILED, ("MAE 3D-NL is too large",)),
        checks=(
            CheckRow("MAE 3D-NL", 0.00060000001, 0.0, 0.0006, "mm"),
            CheckRow("samples dropped", 0, upper=0),
        ),
        verifications=(
            VerificationRow(
                "recorded estimates reproduced bit for bit",
                9216,
                9218,
                (
                    *(
                        DifferenceRow("/slosh/estimate", f"jerk[{i}]", i, NAN, 1e-9)
                        for i in range(6)
                    ),
                    DifferenceRow(
                        "/slosh/estimate", "nonlinear.msh", 2, 3.2141, 1.7e-18,
                        0.012345678901234567, 0.012345678901234569,
                    ),
                ),
            ),
            VerificationRow("limit events reproduced", 4, 4),
        ),
        measured_azimuth=AzimuthSeries("measured", T, estimated.azimuth + 0.05, measured),
        estimated_azimuth=estimated,
        further=(container("near", 0.9 * measured), container("far", np.full_like(T, NAN))),
    )  # fmt: skip


def container(name, measured):
    """Returns the heights of a further container of a tray."""
    return RunReport(
        title=name, t=T, measured=measured, linear=1.1 * measured, nonlinear=1.02 * measured,
        limit=0.0181,
    )  # fmt: skip


def hostile_report():
    """Returns a report whose texts try to become markup, formulas or requests."""
    base = full_report()
    bad_rows = tuple(replace(row, name=evil("model")) for row in base.models[:1])
    return replace(
        base,
        title=evil("title"),
        further=(replace(base.further[0], title=evil("container")),),
        subtitle=evil("subtitle"),
        linear_name=evil("linear"),
        nonlinear_name=evil("nonlinear"),
        key_figures=(KeyFigure(evil("label"), evil("value"), evil("unit"), evil("note")),),
        facts=(Fact(evil("fact"), evil("text")),),
        events=(ExcessSpan(evil("source"), 1.0, 2.0, 0.01, 0.02, evil("description")),),
        models=bad_rows,
        motions=(
            RunMotion(evil("motion"), 0.5, 8.0, 0.02, bad_rows),
            RunMotion(evil("motion"), 9.0, 19.0, 0.02, bad_rows),
        ),
        frames=(Frame(grey_png(), evil("caption"), "image/png", 2.0),),
        topics=(TopicRow(evil("topic"), evil("type"), 1),),
        model_text=evil("text"),
        effects={evil("effect"): evil("meaning")},
        notes=(evil("note"),),
        warnings=(evil("warning"),),
        status=Status(RunVerdict.PASSED, (evil("reason"),)),
        checks=(CheckRow(evil("check"), 1.0),),
        verifications=(
            VerificationRow(evil("verification"), 0, 1, (DifferenceRow(evil("t"), evil("f"), 1),)),
        ),
        measured_azimuth=replace(base.measured_azimuth, name=evil("measured")),
        estimated_azimuth=replace(base.estimated_azimuth, name=evil("estimated")),
    )


class Page(HTMLParser):
    """Parsed page that shows whether injected elements appear, and its text."""

    def __init__(self) -> None:
        super().__init__()
        self.hacked, self.text = False, ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.hacked |= ("src", "x") in attrs or "onerror" in dict(attrs)

    def handle_data(self, data: str) -> None:
        self.text += data


def has_forged_line(text: str) -> bool:
    """Returns whether a name has injected a line into a text."""
    return any(line.lstrip().startswith(FORGED) for line in text.splitlines())


def evil(where: str) -> str:
    """Returns a malicious text: markup, formulas, requests, control characters and a long word."""

    return (
        f'{where}</pre></title></style><script>window.hacked="{where}"</script>'
        f"<img src=http://127.0.0.1:9/{where} onerror=\"window.hacked='{where}'\">"
        f'" onmouseover="window.hacked=1" {{{{7*7}}}} $\\frac{{1}}{{0$ #010101 url(#x)'
        f" \x00\x1b[31m \ud800 \u202e {'W' * 300}"
    )
