"""Tests that the report is one self-contained page that shows the given data."""

import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from slosh_report.errors import SloshReportError
from slosh_report.page.html import LIVE
from slosh_report.page.template import script
from slosh_report.page.units import shown
from slosh_report.run_report import (
    AzimuthSeries,
    CheckRow,
    ExcessSpan,
    Frame,
    KeyFigure,
    ModelRow,
    RunMotion,
    RunReport,
    RunVerdict,
    Status,
    TopicRow,
    render_report,
    report_document,
)

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
    key_figures=(KeyFigure("MAE 3D-NL", "1.20", "mm"),),
    events=(ExcessSpan("measured", 1.2, 1.9, 0.018, 0.0203, "<script>alert(1)</script>"),),
    models=(ModelRow("3D-NL", 0.00123, -0.119, 0.0015, 0.5, 480),),
    frames=(Frame(b"\x89PNG", 'peak "front"', "image/png"),),
    topics=(TopicRow("/slosh/accel", "geometry_msgs/msg/AccelStamped", 8000, 999.7),),
    model_text="damping_ratio: auto",
    notes=("one note",),
)


OWN_SCRIPTS = [script(*name) for name in LIVE]


class Page(HTMLParser):
    """Collects the tags, their attributes and the text of a page."""

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
    assert page.tags.count("script") == len(OWN_SCRIPTS) + 1  # and the series
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


def test_an_event_is_described_under_its_name_which_no_width_cuts_off():
    text = render_report(
        replace(REPORT, events=(ExcessSpan("measured", 1.0, 2.0, 0.01, 0.02, "why"),))
    )
    assert '<th scope="row" class="name">measured<span class="small">why</span></th>' in text


def test_series_that_do_not_match_are_refused():
    with pytest.raises(SloshReportError, match="linear has the shape"):
        replace(REPORT, linear=np.zeros(3))
    with pytest.raises(SloshReportError, match="media type"):
        Frame(b"", "x", "text/html")


def test_time_that_goes_back_is_refused():
    back = T.copy()
    back[100] = 0.0
    with pytest.raises(SloshReportError, match=r"t goes back after 1\.65"):
        replace(REPORT, t=back)
    with pytest.raises(SloshReportError, match="azimuth of measured: height has the shape"):
        AzimuthSeries("measured", T, T, T[1:])


def test_a_number_needs_a_unit_that_the_page_knows():
    with pytest.raises(SloshReportError, match="unit 'cm' is not one of 'mm'"):
        KeyFigure("height", 0.01, "cm")
    with pytest.raises(SloshReportError, match="unit 'cm'"):
        CheckRow("height", 0.01, unit="cm")
    assert "beans" in render_report(replace(REPORT, key_figures=(KeyFigure("x", "7", "beans"),)))


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.012345, "mm", "12.35"),
        (-0.1194, "%", "−11.9"),
        (0.02, "%", "+2.0"),
        (-0.00001, "%", "0.0"),
        (0.0614, "ms", "61"),
        (0.5, "°", "29"),
        (float("nan"), "mm", "–"),
        (None, "s", "–"),
    ],
)
def test_numbers_are_rounded_as_their_unit_is(value, unit, text):
    assert shown(value, unit) == text


def test_a_check_that_misses_by_little_shows_by_how_much():
    bound = 0.0006
    check = CheckRow("MAE", math.nextafter(bound, 1.0), upper=bound, unit="mm")
    text = " ".join(Page(render_report(replace(REPORT, checks=(check,)))).text)
    assert not check.passed
    assert "0.60000000000000" in text  # and more digits, that differ
    assert len(set(re.findall(r"0\.6000000000\d*", text))) == 2


def test_the_status_and_the_warnings_come_first(full_report):
    html = render_report(full_report)
    places = [html.index(text) for text in ("✗ Failed", "MAE 3D-NL is too large", "0.4 s are lost",
              'class="figures"', 'id="heights"')]  # fmt: skip
    assert places == sorted(places)
    assert "✓ Passed" in render_report(replace(full_report, status=Status(RunVerdict.PASSED)))
    assert 'class="status' not in render_report(REPORT)


def test_the_document_holds_what_json_can():
    spans = (replace(REPORT.events[0], end=float("nan")),)
    rows = (ModelRow("3D-L", np.float64(0.5), float("inf"), count=np.int64(3)),)
    report = replace(REPORT, events=spans, models=rows, checks=(CheckRow("n", 1.0, upper=2.0),))
    text = json.dumps(report_document(report, series=True), allow_nan=False)
    document = json.loads(text)
    assert document["events"][0]["end"] is None
    assert document["events"][0]["duration"] is None
    assert document["models"][0] == {
        "name": "3D-L", "sigma": 0.5, "epsilon": None, "rms": None, "offset": None, "count": 3,
    }  # fmt: skip
    assert document["checks"][0]["lower"] is None
    assert document["checks"][0]["passed"] is True
    assert document["status"]["verdict"] == "no expectation"
    assert document["azimuth"] is None
    assert document["series"]["measured"] == REPORT.measured.tolist()
    assert "series" not in report_document(report)


def test_the_document_tells_gaps_and_azimuths(full_report):
    document = report_document(full_report, series=True)
    ((start, end),) = [(gap["start"], gap["end"]) for gap in document["gaps"]]
    assert (start, end) == pytest.approx((8.0, 9.0), abs=0.05)
    assert document["azimuth"]["median"] == pytest.approx(0.05, abs=1e-3)
    assert document["series"]["measured_azimuth"]["name"] == "measured"
    assert document["frames"][0] == {"caption": "highest: 2.24 s", "time": 2.24}
    json.dumps(document, allow_nan=False)


def test_tables_and_headings_tell_what_they_are(full_report):
    page = Page(render_report(full_report))
    assert page.tags.count("h1") == 1
    heads = [tag for tag in page.tags if tag == "th"]
    scopes = [value for tag, name, value in page.attributes if (tag, name) == ("th", "scope")]
    assert len(scopes) == len(heads) > 20
    assert page.tags.count("caption") == page.tags.count("table") == 7
    links = {value for tag, name, value in page.attributes if (tag, name) == ("a", "href")}
    ids = {f"#{value}" for _, name, value in page.attributes if name == "id"}
    assert links <= ids
    assert len(links) == 10


def test_the_page_forbids_itself_other_scripts_and_requests(full_report):
    page = Page(render_report(full_report))
    policies = [value for tag, name, value in page.attributes
                if tag == "meta" and name == "content" and "default-src" in value]  # fmt: skip
    assert policies == [
        "default-src 'none'; style-src 'unsafe-inline'; img-src data:;"
        f" script-src {' '.join(script.source for script in OWN_SCRIPTS)};"
        " base-uri 'none'; form-action 'none'"
    ]


def test_the_motions_that_the_model_follows_worst_are_drawn():
    motions = tuple(
        RunMotion(str(i), 0.8 * i, 0.8 * i + 0.7, 0.01, (ModelRow("3D-NL", 1e-3 * (i % 5), 0.1),))
        for i in range(10)
    )
    html = render_report(replace(REPORT, motions=motions))
    drawn = re.findall(r'aria-label="Line chart of the heights over motion (\d+)"', html)
    assert drawn == ["3", "4", "5", "8", "9", "10"]


def _run(peak: float, limit: float | None, times: int, **other: object) -> RunReport:
    t = np.linspace(0.0, 1.0, 11)
    heights = peak * np.sin(np.pi * t)
    spans = tuple(ExcessSpan("measured", k, k + 0.1, limit or 0.0, peak) for k in range(times))
    models = (ModelRow("NL", 0.0002, 0.01),)
    return replace(
        RunReport("run", t, heights, heights, heights, limit=limit, events=spans, models=models),
        **other,
    )


NOTHING = np.full(11, np.nan)


@pytest.mark.parametrize(
    ("report", "expected"),
    [
        (
            _run(0.0241, 0.02, 2),
            "The liquid rose to 24.1 mm, 4.1 mm above the limit, twice; the model agrees within "
            "0.2 mm on average.",
        ),
        (
            _run(0.0241, 0.02, 4, limit_name="rim", models=()),
            "The liquid rose to 24.1 mm, 4.1 mm above the rim, 4 times.",
        ),
        (
            _run(0.0141, 0.02, 0),
            "The liquid rose to 14.1 mm, 5.9 mm below the limit; the model agrees within 0.2 mm "
            "on average.",
        ),
        (_run(0.0141, None, 0, models=()), "The liquid rose to 14.1 mm."),
        (
            _run(0.0141, None, 0, models=(ModelRow("NL", 2e-5, 0.6, count=3),)),
            "The liquid rose to 14.1 mm; the model agrees within 0.1 mm on average over 3 of 11 "
            "images.",
        ),
        (
            _run(0.0241, None, 1, models=()),
            "The liquid rose to 24.1 mm, beyond a limit that changed, once.",
        ),
        (
            _run(0.0241, None, 0, models=(), saturated=np.ones(11, dtype=bool)),
            "The liquid rose to at least 24.1 mm.",
        ),
        (
            _run(0.0141, 0.02, 0, measured=NOTHING),
            "By the model the liquid rose to 14.1 mm, 5.9 mm below the limit; nothing was "
            "measured.",
        ),
        (
            _run(0.01, 0.02, 0, measured=NOTHING, nonlinear=NOTHING),
            "No height is known, measured or estimated.",
        ),
    ],
)
def test_the_page_begins_with_what_the_run_came_to(report: RunReport, expected: str) -> None:
    assert report_document(report)["sentence"] == expected
    page = render_report(report)
    assert page.index(expected) < page.index("<nav")
