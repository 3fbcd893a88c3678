"""Tests that long series are reduced to short lines with the same extremes and gaps."""

import re
from dataclasses import replace

import numpy as np
import pytest

from slosh_report.page.charts import chart_svg
from slosh_report.page.series import envelope, gaps, united
from slosh_report.page.svg import NARROW
from slosh_report.run_report import AzimuthSeries, render_report
from slosh_report.run_report.charts import heights_chart, residual


def test_long_series_keep_their_extremes():
    t = np.arange(100_000.0)
    values = np.sin(t)
    values[77_777] = 9.0
    short_t, short = envelope(t, values)
    assert len(short_t) <= 1300
    assert 9.0 in short
    assert np.all(np.diff(short_t) > 0)


@pytest.mark.parametrize("count", [600, 60_000])
def test_a_gap_parts_the_line_and_a_lost_sample_does_not(count):
    t = np.linspace(0.0, 10.0, count)
    values = np.cos(t)
    values[(t > 4.0) & (t < 5.0)] = np.nan
    values[count // 10] = np.nan
    short_t, short = envelope(t, values)
    assert short_t[np.isnan(short)] == pytest.approx([4.5], abs=0.05)


def test_gaps_count_at_both_ends_and_over_all():
    t = np.arange(0.0, 10.0, 0.01)
    values = np.where((t < 1.0) | (t > 9.0), np.nan, 1.0)
    assert np.array(gaps(t, values)) == pytest.approx(
        np.array([[0.0, 1.0], [9.0, 9.99]]), abs=0.02
    )
    assert gaps(t, np.full(len(t), np.nan)) == ((0.0, pytest.approx(9.99)),)
    assert gaps(np.empty(0), np.empty(0)) == ()


def test_spans_are_united_where_they_touch():
    assert united([(3.0, 4.0), (0.0, 1.0), (1.05, 2.0)], 0.1) == [(0.0, 2.0), (3.0, 4.0)]


def test_a_lower_bound_below_the_model_is_no_residual(full_report):
    saturated = np.zeros(len(full_report.t), dtype=bool)
    saturated[[300, 400]] = True
    model = full_report.measured.copy()
    model[300] += 1e-3
    model[400] -= 1e-3
    difference = residual(replace(full_report, saturated=saturated), model)
    assert np.isnan(difference[300])
    assert difference[400] == pytest.approx(1e-3)


def test_lower_bounds_gaps_motions_and_frames_are_marked(full_report):
    drawn = chart_svg(heights_chart(full_report, "x"), NARROW, "x")
    assert "var(--gap)" in drawn
    assert all(f">{mark}</text>" in drawn for mark in ("1", "2", "A"))
    plain = replace(full_report, saturated=None)
    assert len(chart_svg(heights_chart(plain, "x"), NARROW, "x")) < len(drawn)


@pytest.mark.long
def test_a_page_of_hours_stays_below_a_megabyte(full_report):
    t = np.arange(0.0, 3.0 * 3600.0, 1.0 / 60.0)
    measured = np.abs(np.sin(3.0 * t)) * 0.02 + np.random.default_rng(1).normal(0.0, 5e-4, len(t))
    measured[(t % 50.0) < 2.0] = np.nan
    motion, event = full_report.motions[0], full_report.events[0]
    report = replace(
        full_report,
        t=t, measured=measured, linear=1.1 * measured, nonlinear=0.9 * measured,
        saturated=measured > 0.019,
        motions=tuple(replace(motion, start=10.0 * i, end=10.0 * i + 8.0) for i in range(1000)),
        events=tuple(replace(event, start=5.0 * i, end=5.0 * i + 1.0) for i in range(2000)),
        measured_azimuth=AzimuthSeries("measured", t, 0.9 * t % 6.0, measured),
        estimated_azimuth=AzimuthSeries("3D-NL", t, 0.9 * t % 6.0, measured),
        frames=(), further=(),
    )  # fmt: skip
    page = render_report(report)
    assert len(page.encode()) < 1_000_000
    assert "The first 100 of 2000" in page


def test_the_estimated_path_does_not_cross_the_container(full_report):
    """A highest point that changes sides leaves a gap in the drawn path."""
    t = full_report.t
    flipping = np.where(np.sin(3.0 * t) > 0.0, 0.0, np.pi)
    series = AzimuthSeries("3D-NL", t, flipping, np.full(len(t), 0.02))
    page = render_report(replace(full_report, estimated_azimuth=series, measured_azimuth=None))
    (chart,) = re.findall(r"<svg[^>]*>(?:(?!</svg>).)*azimuth-(?:(?!</svg>).)*</svg>", page, re.S)
    paths = re.findall(r'd="([^"]*)"[^>]*stroke: var\(--nonlinear\)', chart)
    assert paths
    for path in paths:
        for part in path.split("M")[1:]:
            points = np.array([float(x) for x in re.findall(r"-?[\d.]+", part)]).reshape(-1, 2)
            assert np.ptp(points, axis=0).max() < 20.0
