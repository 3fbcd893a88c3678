"""Tests that a replay gives the model's heights, and handles unrelated clocks."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slosh_bag.bag_writer import BagWriter
from slosh_bag.errors import SloshBagError
from slosh_estimator.limits import Event, Kind, Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_motion.tables.motion_table import MotionTable
from slosh_replay.replay import replay_bag, replay_table
from slosh_replay.replay.report import Surroundings, event_spans, replay_report
from slosh_replay.replay.result import ModelAccuracy, ReplayResult
from slosh_report.run_report import render_report
from slosh_testing.cell_bag import SURFACE, CellBag

MODEL = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()


def motion_table() -> MotionTable:
    """Returns a table of 1 s rest, 4 s motion and 1 s rest, with 3D nonlinear heights."""
    t = np.arange(0.0, 6.0, 0.002)
    swell = np.where((t > 1.0) & (t < 5.0), np.sin(np.pi * (t - 1.0) / 4.0) ** 2, 0.0)
    waves = (4.0 * np.sin(13.0 * t), 3.0 * np.cos(11.0 * t), 2.0 * np.sin(9.0 * t))
    acceleration = swell[:, None] * np.column_stack(waves)
    response, _ = simulate(MODEL, Inputs(t, acceleration))
    return MotionTable(t, acceleration, msh=response.msh)


TABLE = motion_table()


def write_bag(folder: Path, shift: float = 0.0, facts: dict[str, str] | None = None) -> Path:
    """Writes the table as a bag: input at 500 Hz, and images on a shifted clock."""
    ahead = round(shift * 1e9)
    bag = CellBag()
    for t, acceleration in zip(TABLE.t.tolist(), TABLE.acceleration.tolist(), strict=True):
        bag.accel(10**9 + round(t * 1e9), acceleration)
    still = np.arange(-3.0, 0.0, 0.016) if shift else np.empty(0)
    times = np.concatenate((still, TABLE.t[::8]))
    heights = np.concatenate((np.zeros(still.size), TABLE.msh[::8]))
    for t, height in zip(times.tolist(), heights.tolist(), strict=True):
        bag.surface(10**9 + round(t * 1e9) + ahead, height)
    return bag.write(folder, facts)


def by_name(result):
    return {row.name: row for row in result.accuracy}


def test_a_table_of_the_models_own_heights_agrees_with_that_model_alone():
    rows = by_name(replay_table("own", TABLE, MODEL))
    assert list(rows) == ["2D-L", "3D-L", "2D-NL", "3D-NL"]
    assert rows["3D-NL"].sigma < 1e-7
    assert rows["3D-NL"].epsilon == pytest.approx(0.0, abs=1e-6)
    assert min(rows[name].sigma for name in ("2D-L", "3D-L", "2D-NL")) > 1e-4


def test_a_single_outlier_moves_the_raw_peak_error_only():
    msh = TABLE.msh.copy()
    msh[1500] = 0.2
    row = by_name(replay_table("spike", replace(TABLE, msh=msh), MODEL))["3D-NL"]
    assert row.epsilon == pytest.approx(0.0, abs=1e-6)
    assert row.epsilon_raw < -0.5


def test_json_has_every_number_and_no_nan():
    result = replay_table("own", TABLE, MODEL)
    document = json.loads(result.to_json(series=True))
    assert document["accuracy"][3]["sigma"] == result.accuracy[3].sigma
    assert len(document["series"]["3D-NL"]) == len(TABLE.t)


def test_a_table_without_heights_is_refused():
    with pytest.raises(SloshBagError, match="no measured heights"):
        replay_table("none", replace(TABLE, msh=None), MODEL)


def test_a_bag_with_one_clock_gives_the_same_as_its_table(tmp_path: Path):
    result = replay_bag(write_bag(tmp_path / "bag"), MODEL)
    row = by_name(result)["3D-NL"]
    assert row.sigma < 1e-7
    assert row.clock is None
    assert result.counters["samples_used"] == len(TABLE.t)
    assert result.counters["images"] == row.count == len(TABLE.t[::8])


def test_unrelated_clocks_are_found(tmp_path: Path):
    bag = write_bag(tmp_path / "bag", shift=7.25, facts={"clocks": "unrelated"})
    row = by_name(replay_bag(bag, MODEL))["3D-NL"]
    assert row.clock.offset == pytest.approx(7.25, abs=2e-3)
    assert row.clock.unambiguous
    assert row.sigma < 2e-4


def test_a_bag_without_container_needs_a_model(tmp_path: Path):
    with pytest.raises(SloshBagError, match="contains no model or container"):
        replay_bag(write_bag(tmp_path / "bag"))


def test_an_empty_bag_is_refused(tmp_path: Path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/slosh/free_surface", SURFACE)
    with pytest.raises(SloshBagError, match="the model has no input"):
        replay_bag(tmp_path / "bag", MODEL)


# A replay's page shows the replay's own numbers.


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
