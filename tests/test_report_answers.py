"""Tests in a browser that charts react to the pointer and the index can be sorted."""

import json
from urllib.parse import quote

import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_report.page.html import html_page
from slosh_report.run_report import RunVerdict
from slosh_report.run_report.index import IndexRow, index_document
from slosh_testing.live_bag import LiveBag

pytestmark = pytest.mark.long
CHART = "document.querySelector('figure[data-rows=heights] .wide')"


@pytest.fixture(scope="module")
def replayed(tmp_path_factory):
    """Replays two bags into one folder."""
    folder = tmp_path_factory.mktemp("pages")
    live = LiveBag()
    for name, height in (("low", 0.8), ("high", 1.2)):
        live.height = height
        live.write(folder / "bags" / name, seconds=2.0)
    assert main(["replay", str(folder / "bags"), "-o", str(folder / "out")]) == 0
    return folder / "out"


def opened(browser, path, **options):
    return browser.open(f"file://{quote(str(path))}", dark=False, **options)


def pointed(page, share, kind="mouseMoved", **more):
    """Moves the pointer to a fraction of the chart's width; returns the displayed text."""
    box = page.value(f"(() => {{ const b = {CHART}.getBoundingClientRect();"
                     "return [b.left, b.top, b.width, b.height]; })()")  # fmt: skip
    place = {"x": box[0] + share * box[2], "y": box[1] + 0.5 * box[3]}
    page.call("Input.dispatchMouseEvent", type=kind, **place, **more)
    return page.value("document.querySelector('figure[data-rows=heights] .values').textContent")


def test_a_chart_tells_the_values_under_the_pointer(browser, replayed):
    page = opened(browser, replayed / "high.html", height=3000)
    said = pointed(page, 0.6)
    series = json.loads((replayed / "high.json").read_text())["replay"]["series"]
    moment = float(said.split(" s: ")[0])
    names = ("measured", "3D-L", "3D-NL")
    told = dict(
        part.rsplit(" ", 1) for part in said.split(": ")[1].removesuffix(" mm").split(", ")
    )
    assert tuple(told) == names
    start = series["t"][0]
    at = int(np.argmin(np.abs(np.array(series["t"]) - start - moment)))
    assert float(told["measured"]) == pytest.approx(1e3 * series["measured"][at], abs=0.006)
    assert page.complaints == []


def test_the_index_names_each_bag_and_sorts(browser, replayed):
    page = opened(browser, replayed / "index.html", width=390)
    names = "[...document.querySelectorAll('tbody th')].map((cell) => cell.textContent)"
    assert page.value(names) == ["high", "low"]
    heads = "[...document.querySelectorAll('thead th')]"
    press = f"{heads}.find((head) => head.textContent === 'highest [mm]').firstChild.click()"
    page.value(press)
    assert page.value(names) == ["low", "high"]
    page.value(press)
    assert page.value(names) == ["high", "low"]
    assert page.value("document.documentElement.scrollWidth") <= 390
    page.value("document.querySelector('tbody a').click()")
    page.wait_until("document.querySelector('h1') && location.href.endsWith('high.html')")
    assert page.complaints == []


def test_what_is_unknown_stands_last_and_a_hostile_name_is_text(browser, tmp_path):
    hostile = "<script>window.hacked=1</script>"
    rows = [
        IndexRow("blind", RunVerdict.NO_EXPECTATION),
        IndexRow("good", RunVerdict.PASSED, "3D-NL", 1e-4, 0.01, 0.02, 9),
        IndexRow(hostile, None, reason="is no bag"),
        IndexRow("bad", RunVerdict.FAILED, "3D-NL", 2e-4, -0.02, 0.01, 9, reason="MAE too large"),
    ]
    (tmp_path / "index.html").write_text(html_page(index_document("bags", rows)))
    page = opened(browser, tmp_path / "index.html")
    names = "[...document.querySelectorAll('tbody th')].map((cell) => cell.textContent)"
    for _ in range(2):
        page.value("document.querySelectorAll('thead button')[3].click()")
        assert set(page.value(names)[2:]) == {"blind", hostile}
    assert page.value(names)[:2] == ["bad", "good"]
    assert page.value("window.hacked ?? null") is None
    assert "2 failed" in page.value("document.querySelector('.subtitle').textContent")
