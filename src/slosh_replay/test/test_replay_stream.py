"""Tests that a replay gives the same results for single messages and for blocks."""

import numpy as np
import pytest

from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.recorded.inputs import InputReader
from slosh_replay.recording.heights import Measurements
from slosh_replay.replay.series import Series
from slosh_replay.replay.setting import Outputs, Setting
from slosh_replay.replay.stream import ReplayStream

MS = 1_000_000
START = 10**18
MODEL = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()


def inputs():
    """Returns inputs at 500 Hz for six seconds, with a sudden acceleration."""
    stamps = START + 2 * MS * np.arange(3000)
    accelerations = np.zeros((3000, 3))
    accelerations[(stamps >= START + 2025 * MS) & (stamps < START + 3500 * MS), 0] = 1.0
    return stamps, accelerations


def images():
    stamps = START + 16 * MS * np.arange(370)
    heights = 0.01 * np.sin(1e-8 * (stamps - START)) ** 2
    unknown = np.full(len(stamps), np.nan)
    return Measurements(stamps, heights, np.zeros(len(stamps), np.int64), unknown, unknown)


def columns(stamps, accelerations):
    seconds, nanoseconds = np.divmod(stamps, 10**9)
    return {
        "header.stamp.sec": seconds,
        "header.stamp.nanosec": nanoseconds,
        "header.frame_id": np.full(len(stamps), "world", dtype=object),
        **{f"accel.linear.{axis}": accelerations[:, i] for i, axis in enumerate("xyz")},
    }


class Kept(Outputs):
    """Receiver that keeps all results."""

    def __init__(self):
        self.stamps, self.rows, self.found = [], [], []

    def estimates(self, estimates):
        self.stamps += estimates.own.stamps.tolist()

    def comparisons(self, comparisons):
        self.rows += comparisons

    def events(self, events):
        self.found += events


def replayed(step):
    """Returns series and outputs of a replay that is fed in steps [ms]."""
    stamps, accelerations = inputs()
    measured, out = images(), Kept()
    with Series(4) as series:
        setting = Setting(
            MODEL, InputReader("accel", InputSettings()), MonitorSettings(measured_limit=0.005),
            outputs=out,
        )  # fmt: skip
        stream = ReplayStream("run", setting, series)
        for start in range(START, START + 6000 * MS, step * MS):
            end = start + step * MS
            rows = (stamps >= start) & (stamps < end)
            stream.add_input(columns(stamps[rows], accelerations[rows]), end)
            rows = (measured.stamps >= start) & (measured.stamps < end)
            stream.add_measurements(measured.chosen(rows), end)
            stream.advance()
        stream.advance(final=True)
        return series.read(0, len(series)), out


@pytest.mark.parametrize("step", [pytest.param(10, marks=pytest.mark.long), 130, 2600])
def test_the_parts_in_which_a_recording_comes_do_not_matter(step):
    whole, all_out = replayed(6000)
    series, out = replayed(step)
    for name in series.dtype.names:
        np.testing.assert_array_equal(series[name], whole[name], name)
    assert out.stamps == all_out.stamps
    assert repr(out.rows) == repr(all_out.rows)
    assert repr(out.found) == repr(all_out.found)
    assert len(out.found) > 4
    assert set(whole["motion"]) == {-1, 0}
