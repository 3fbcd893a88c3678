"""Tests a discovery's page in a real browser: on screens, phones and paper."""

import json
import re
from dataclasses import replace

import pytest
from headless_browser import View

from slosh_discovery.discover.finding import Verdict
from slosh_discovery.discovery_report import (
    Command,
    DiscoveryReport,
)
from slosh_report.page.frame import Frame
from slosh_testing.example_finding import example_finding, example_report, forms_of
from slosh_testing.reports import A4, LOOK, EveryPage, check_numbers, evil, grey_png, on_paper

pytestmark = pytest.mark.long

ALSO = """
return {...(() => { %s })(),
  status: document.querySelector(".status").className,
  ground: window.getComputedStyle(document.querySelector(".status")).backgroundColor,
  model: document.querySelector("#model ~ pre").textContent,
  sections: all("h2").map((e) => e.id),
  bars: all(".bar").map((e) => [
    e.className, e.getBoundingClientRect().width / e.parentElement.getBoundingClientRect().width]),
  fresh: all("ins").map((e) => e.textContent),
  won: all("tr.won th").map((e) => e.textContent),
  typed: all("#next ~ pre").map((e) => e.textContent),
};
"""
SCRIPT = "const all = (selector) => [...document.querySelectorAll(selector)];" + ALSO % LOOK


def hostile_report():
    """Returns a report with names that try to break the page."""
    finding = example_finding(Verdict.AMBIGUOUS)
    entry = finding.motions[0]
    motions = (replace(entry, motion=replace(entry.motion, name=evil("motion"))),)
    return DiscoveryReport(
        replace(
            finding,
            motions=motions,
            where=tuple(replace(row, label=evil("label")) for row in finding.where),
            worst=tuple(replace(moment, motion=evil("motion")) for moment in finding.worst),
            candidates=tuple(
                replace(row, reason=evil("reason") if row.reason else "")
                for row in finding.candidates
            ),
            separating=(replace(finding.separating[0], description=evil("description")),),
            remarks=(evil("remark"),),
        ),
        subtitle=evil("subtitle"),
        notes=(evil("note"),),
        commands=(Command(evil("purpose"), evil("line")),),
        separating_files=(evil("file"),),
    )


@pytest.fixture(scope="module")
def reports():
    found = {verdict.value: example_report(verdict) for verdict in Verdict}
    frames = (Frame(grey_png(), "worst: 1.52 s", "image/png"),)
    found["named"] = replace(found["named"], frames=frames)
    for name in ("none", "unexplained"):  # charts take most of the time
        finding = found[name].finding
        found[name] = replace(found[name], finding=replace(finding, motions=finding.motions[:1]))
    return found


@pytest.fixture(scope="module")
def pages(reports):
    return {name: forms_of(report)[2] for name, report in reports.items()}


@pytest.fixture(scope="module")
def seen(headless, pages):
    """Returns what the browser shows of the page in all views."""
    views = {
        **{name: View(page) for name, page in pages.items()},
        "dark": View(pages["named"], dark=True),
        "phone": View(pages["ambiguous"], width=390),
        "small phone": View(pages["named"], width=320),
        "paper": View(on_paper(pages["ambiguous"]), width=A4, dark=True),
        "hostile": View(forms_of(hostile_report())[2], width=390),
    }
    look = headless.look(list(views.values()), SCRIPT)
    found = dict(zip(views, look.values, strict=True))
    return {**found, "desktop": found["named"], "console": look.console}


def test_the_verdict_comes_first(seen):
    assert seen["named"]["heading"] == "Missing: fill level and vertical acceleration"
    assert seen["none"]["heading"] == "Nothing is missing"
    assert seen["ambiguous"]["heading"] == "Not settled: fill level or scale of the heights"
    assert seen["unexplained"]["heading"] == "Unexplained: a gap of 1.10 mm remains"
    assert [seen[verdict.value]["status"] for verdict in Verdict] == [
        "status passed", "status passed", "status open", "status failed",
    ]  # fmt: skip
    assert seen["ambiguous"]["ground"] == "rgb(253, 241, 216)"


def test_every_part_has_its_place(seen):
    always = ["evidence", "motions", "where", "worst", "model", "next"]
    assert seen["none"]["sections"] == always
    assert seen["named"]["sections"] == ["effects", *always]
    assert seen["ambiguous"]["sections"] == ["effects", "evidence", "separating", *always[1:]]
    assert seen["unexplained"]["sections"] == ["effects", "evidence", "proposal", *always[1:]]
    assert seen["named"]["images"] == [8]


class TestEveryScreen(EveryPage):
    pass


@pytest.mark.parametrize(("view", "count"), [("named", 6), ("phone", 8), ("paper", 8)])
def test_every_motion_is_drawn_with_its_residual(seen, view, count):
    assert len(seen[view]["charts"]) == count  # and the separating one's acceleration and yaw
    assert min(seen[view]["charts"]) > 300.0
    assert min(seen[view]["letters"]) > 7.5
    assert seen[view]["named"]


def test_what_is_folded_is_open_on_paper(seen):
    assert seen["ambiguous"]["folded"] == 0
    assert seen["paper"]["folded"] > 10


@pytest.mark.parametrize("verdict", [verdict.value for verdict in Verdict])
def test_every_number_is_that_of_the_document(seen, reports, verdict):
    document = json.loads(forms_of(reports[verdict])[0])
    assert len(seen[verdict]["numbers"]) > 50
    check_numbers(seen[verdict], document)
    assert set(seen[verdict]["bare"]) <= {"–"}


def test_it_prints_on_several_sheets(headless, pages, tmp_path):
    target = tmp_path / "page.pdf"
    headless.print_pdf(pages["ambiguous"], target)
    content = target.read_bytes()
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", content)) <= 9


SCALES = {
    "epsilon": 1e2, "closed": 1e2, "share": 1e2, "explained": 1e2, "clock_offset": 1e3,
    "t": 1.0, "duration": 1.0, "samples": 1.0, "confidence": 1.0, "probability": 1.0,
    "delta": 1e3, "gain": 1.0,
}  # fmt: skip


def scale(path):
    """Returns the factor from SI units to displayed units for a number of the page."""
    *_, before, last = path.split("/")
    if path.startswith("/where/") and last in ("before", "after") and int(before) >= 5:
        return 1.0
    return SCALES.get(last, 1e3)
