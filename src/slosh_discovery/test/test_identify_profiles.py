"""Tests surface profiles: fitted lines, limits of the line, and residual vibration."""

import math

import numpy as np
import pytest

from slosh_base.files.errors import SloshFileError
from slosh_base.files.nanoseconds import SECOND
from slosh_discovery.discover_data import read_motions
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.identify import identify
from slosh_discovery.identify.validity import limited, line_limit
from slosh_estimator.estimator import Estimator
from slosh_estimator.validity import EstimateFlag
from slosh_model.measure import predicted_heights
from slosh_model.model import Model
from slosh_model.motion_profiles import Cycle
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs
from slosh_motion.inputs.sampling import Samples
from slosh_motion.tables.motion_table import MotionTable, read_motion_table, write_motion_table
from slosh_replay.tables.table_bag import import_table

CUP = Cylinder(0.03, 0.067)
BASE = Model(CUP)
TRUTH = Model(CUP, damping_ratio=0.042, natural_frequency=24.0)
X = np.linspace(-0.028, 0.028, 15)


def table_at(speed, seed, bend=0.0):
    """Returns a table of one cycle with a surface profile at 100 Hz: line, wave and noise."""
    cycle = Cycle("acceleration_pulse", speed, 0.1)
    t = np.arange(0.0, cycle.cycle_time, 1e-3)
    acceleration = np.zeros((len(t), 3))
    acceleration[:, 0] = cycle.at(t)[2]
    inputs = Inputs(t, acceleration)
    slope = predicted_heights(TRUTH, inputs, t, [0.0])[:, 0] / CUP.radius
    shape = np.sin(3.0 * math.pi * X / 0.06)
    moving = t <= cycle.motion_time
    profile = np.outer(slope, X) + bend * np.outer(moving, shape)
    profile += 1e-4 * np.random.default_rng(seed).normal(size=profile.shape)
    profile[np.arange(len(t)) % 10 != 0] = np.nan
    return MotionTable(t, acceleration, profile_x=X, profile=profile)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Writes tables with two repetitions at each speed; above 36 1/min the surface bends."""
    folder = tmp_path_factory.mktemp("profiles")
    for speed in (30, 36, 42, 48):
        for repeat in range(2):
            bend = 1.5e-3 * (speed / 48.0) ** 4
            path = folder / f"n{speed}_{repeat}.csv.gz"
            write_motion_table(path, table_at(speed, 10 * speed + repeat, bend))
    return folder


def test_profiles_are_written_and_read_to_the_last_bit(tmp_path):
    table = table_at(48, 1)
    path = tmp_path / "run.csv"
    write_motion_table(path, table)
    back = read_motion_table(path)
    np.testing.assert_array_equal(back.profile_x, table.profile_x)
    np.testing.assert_array_equal(back.profile, table.profile)
    with pytest.raises(SloshFileError, match="contains a profile"):
        import_table(path, tmp_path / "bag")
    path.write_text("t,ax,ay,az,profile_left\n0,0,0,0,0\n")
    with pytest.raises(SloshFileError, match="'profile_left' is unknown"):
        read_motion_table(path)


def test_a_profile_becomes_the_height_of_its_line(tables):
    path = tables / "n30_0.csv.gz"
    (motion,) = read_motions(path, BASE)
    assert motion.eta_azimuth.tolist() == [0.0]
    expected = predicted_heights(TRUTH, motion.inputs, motion.t, [0.0])
    assert np.std(motion.eta - expected) < 1.5e-4
    with pytest.raises(SloshDiscoveryError, match="its width is known only with a model"):
        read_motions(path)


def test_identification_from_profiles(tables):
    motions = read_motions(tables, BASE)
    found = identify(motions, BASE)
    for entry, true in zip(found.overall.parameters, (24.0, 0.042), strict=True):
        assert entry.value == pytest.approx(true, rel=0.02)
    assert found.line.speed == 36.0
    assert found.line.exceeded
    assert found.overall.model.limits == limited(BASE, found.line).limits
    assert any("up to 36 1/min" in remark for remark in found.remarks)
    assert [row.repetitions for row in found.dwell] == [2, 2, 2, 2]
    for row in found.dwell:
        # In the dwell the surface is a line but for the noise.
        assert row.line == pytest.approx(1e-4, rel=0.1)
        assert row.line <= row.simulated < 1.3e-4
        assert row.measured > 1.5 * row.line


def flags_of(model, speed):
    table = table_at(speed, 1)
    count = len(table.t)
    stamps = np.round(table.t * SECOND).astype(np.int64)
    samples = Samples(stamps, table.acceleration, np.zeros(count), np.zeros(count, dtype=bool))
    return np.bitwise_or.reduce(Estimator(model).update_many(samples).flags)


def test_the_estimator_flags_a_motion_that_leaves_the_limits(tables):
    model = limited(BASE, line_limit(read_motions(tables, BASE), 0.4))
    lost = int(EstimateFlag.PLANARITY_LOST)
    assert not flags_of(model, 30) & lost
    assert not flags_of(model, 36) & lost
    assert flags_of(model, 42) & lost
    assert not flags_of(BASE, 42) & lost
