"""A replay's page shows the replay's own numbers."""

from dataclasses import replace

import numpy as np
import pytest

from slosh_estimator.limits import Event, Kind, Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_replay.replay.report import Surroundings, event_spans, replay_report
from slosh_replay.replay.result import ModelAccuracy, ReplayResult
from slosh_report.run_report import render_report

NAMES = ("2D-L", "3D-L", "2D-NL", "3D-NL")
T = np.linspace(100.0, 104.0, 50)
START = Event(101_000_000_000, 1, Kind.START, Source.MEASURED, 0.02, 0.021, 0, 0, "up")
END = Event(
    102_500_000_000, 1, Kind.END, Source.MEASURED, 0.02, 0.03, 0, 1_500_000_000, "down again"
)
RESULT = ReplayResult(
    "run",
    "/slosh/accel",
    np.rint(T * 1e9).astype(np.int64),
    np.linspace(0.0, 0.03, 50),
    {name: np.full(50, 1e-3 * k) for k, name in enumerate(NAMES)},
    tuple(ModelAccuracy(name, 1e-3 * k, 0.1 * k, 0.1, 2e-3, 50) for k, name in enumerate(NAMES)),
    events=(START, END),
)


def test_the_3d_models_are_shown_from_time_zero():
    report = replay_report(RESULT)
    assert (report.linear_name, report.nonlinear_name) == ("3D-L", "3D-NL")
    assert report.linear[0] == pytest.approx(1e-3)
    assert report.nonlinear[0] == pytest.approx(3e-3)
    assert report.t[0] == 0.0
    assert [row.sigma for row in report.models] == [row.sigma for row in RESULT.accuracy]


def test_start_and_end_of_an_excess_are_one_span():
    (span,) = event_spans((START, END), 100_000_000_000)
    assert (span.start, span.end) == pytest.approx((1.0, 2.5))
    assert (span.peak, span.description, span.source) == (0.03, "down again", "measured")


def test_the_page_renders_with_its_surroundings():
    watched = replace(RESULT, limits=MonitorSettings(measured_limit=0.02))
    html = render_report(replay_report(watched, Surroundings(title="Cell 7")))
    assert "Cell 7" in html
    assert "limit 20 mm" in html
