"""The report is one page that needs nothing else and shows what it was given."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.report import (
    Frame,
    KeyFigure,
    ModelRow,
    RunReport,
    Span,
    Topic,
    render_report,
)
from slosh_discovery.report.charts import envelope, heights_chart, residual_chart

T = np.linspace(0.0, 8.0, 480)
REPORT = RunReport(
    title="Run c3 <b>",
    subtitle="a & b",
    t=T,
    measured=0.02 * np.sin(T) ** 2,
    linear=0.024 * np.sin(T) ** 2,
    nonlinear=0.019 * np.sin(T) ** 2,
    linear_name="3D-L",
    nonlinear_name="3D-NL",
    limit=0.018,
    key_figures=(KeyFigure("σ 3D-NL", "1.20", "mm"),),
    events=(Span("measured", 1.2, 1.9, 0.018, 0.0203, "<script>alert(1)</script>"),),
    models=(ModelRow("3D-NL", 0.00123, -0.119, 0.0015, 0.5, 480),),
    frames=(Frame(b"\x89PNG", 'peak "front"', "image/png"),),
    topics=(Topic("/slosh/accel", "geometry_msgs/msg/AccelStamped", 8000, 999.7),),
    model_text="damping_ratio: auto",
    notes=("one note",),
)

CHARTS = (heights_chart, residual_chart)


class Page(HTMLParser):
    """Collects the tags, their attributes and the text."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.text = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, *pair) for pair in attrs]

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def html():
    return render_report(REPORT)


def test_numbers_appear_in_millimetres_and_percent(html):
    text = " ".join(Page(html).text)
    for expected in (
        "1.23",
        "−11.9",
        "1.50",
        "0.500",
        "20.30",
        "18.00",
        "0.70",
        "1000",
        "one note",
    ):
        assert expected in text


def test_every_text_is_escaped(html):
    page = Page(html)
    assert "script" not in page.tags
    assert "Run c3 <b>" in page.text
    assert ("img", "alt", 'peak "front"') in page.attributes


def test_nothing_is_fetched(html):
    for _, name, value in Page(html).attributes:
        if name in ("src", "href", "xlink:href"):
            assert value.startswith(("data:", "#")), value
    assert "@import" not in html
    assert not re.search(r"url\((?!#)", html)


def test_ids_are_unique_and_references_resolve(html):
    ids = [value for _, name, value in Page(html).attributes if name == "id"]
    assert len(ids) == len(set(ids))
    assert set(re.findall(r"url\(#([^)]+)\)", html)) <= set(ids)


def test_charts_take_their_colours_from_the_page(html):
    for name in ("measured", "linear", "nonlinear", "limit", "span"):
        assert f"var(--{name})" in html
    assert "prefers-color-scheme: dark" in html


def test_the_same_report_gives_the_same_page(html):
    assert render_report(REPORT) == html


def test_an_empty_run_still_gives_a_page():
    none = np.empty(0)
    html = render_report(RunReport("Nothing", none, none, none, none))
    assert "No limit was exceeded." in html


def test_unknown_numbers_are_dashes():
    nan = float("nan")
    rows = (ModelRow("3D-L", nan, nan),)
    spans = (replace(REPORT.events[0], end=nan),)
    text = render_report(replace(REPORT, models=rows, events=spans, topics=()))
    assert ">nan<" not in text.lower()


def test_the_clock_offset_is_shown_where_there_is_one():
    one_clock = (replace(REPORT.models[0], offset=float("nan")),)
    assert "clock offset" in render_report(REPORT)
    assert "clock offset" not in render_report(replace(REPORT, models=one_clock))


def test_both_charts_have_one_time_axis():
    """Also where a model has no estimate over most of the run."""
    short = np.where(T > 6.0, REPORT.linear, np.nan)
    report = replace(REPORT, linear=short, nonlinear=short, events=())
    ticks = [re.findall(r">(\d+)</text>", draw(report, (9.6, 3.3), "x")) for draw in CHARTS]
    assert ticks[0][:3] == ticks[1][:3] == ["0", "1", "2"]


def test_long_series_keep_their_extremes():
    t = np.arange(100_000.0)
    values = np.sin(t)
    values[77_777] = 9.0
    short_t, short = envelope(t, values)
    assert len(short_t) <= 1300
    assert 9.0 in short
    assert np.all(np.diff(short_t) > 0)


def test_series_that_do_not_match_are_refused():
    with pytest.raises(SloshDiscoveryError, match="linear has the shape"):
        replace(REPORT, linear=np.zeros(3))
    with pytest.raises(SloshDiscoveryError, match="media type"):
        Frame(b"", "x", "text/html")
