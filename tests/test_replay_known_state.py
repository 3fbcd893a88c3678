"""Tests that recordings without a known start continue from a recorded state."""

import math
import re

import numpy as np
import pytest

from slosh_bag.reader import BagReader
from slosh_estimator.validity import EstimateFlag
from slosh_model.constants import GRAVITY
from slosh_replay.replay import replay_bag
from slosh_testing.live_bag import MODEL, START, LiveBag
from tests.test_replay_verification import TANK

REMEMBERING = (
    MODEL.with_effect("robot_dynamics", frequency=60.0, damping_ratio=0.7)
    .with_effect("draining_film", speed=0.01)
    .with_effect("fill_loss", rate=0.0001)
)


def begun_late(kind="accel", start=1010):
    live = LiveBag(kind)
    live.states = True
    live.unheard = live.unrecorded = range(start)
    return live


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["accel", "imu", "pose"])
@pytest.mark.parametrize("start", [1001, 1124, 1125])
def test_from_the_first_state_on_every_bit_is_the_same(kind, start, tmp_path):
    live = begun_late(kind, start)
    live.attitude = lambda index: (0.0, 0.0, math.sin(1e-3 * index), math.cos(1e-3 * index))
    found = replay_bag(live.write(tmp_path / "bag")).verification
    assert found.exact, found.lines()
    # A pose's estimate lies half a window behind it.
    assert found.unchecked == {"before the first known state": 1126 - start}
    assert found.recorded == 2500 - 1126
    assert f"{1126 - start} not checked: before the first known state" in found.lines()[1]


@pytest.mark.long
@pytest.mark.parametrize("every", [1, 5, 25])
def test_poses_with_a_chosen_window_go_on_with_the_same_bits(every, tmp_path):
    """At 500, 100 and 20 Hz; the last are answered with several estimates each."""
    live = begun_late("pose", 1000)
    live.pose_window, live.every = 0.0, every
    live.attitude = lambda index: (0.0, 0.0, math.sin(1e-3 * index), math.cos(1e-3 * index))
    found = replay_bag(live.write(tmp_path / "bag")).verification
    assert found.exact, found.lines()
    assert sum(found.unchecked.values()) < found.recorded


@pytest.mark.first(1)
@pytest.mark.parametrize("model", [TANK, REMEMBERING], ids=["tank", "remembering"])
def test_the_state_is_all_that_the_answers_depend_on(model, tmp_path):
    live = begun_late("imu")
    live.model = model
    found = replay_bag(live.write(tmp_path / "bag")).verification
    assert found.exact, found.lines()


def test_the_state_that_is_not_known_is_said_so_in_the_estimates(tmp_path):
    """The monitor must not judge by what came from an unknown state."""
    folder = begun_late(start=1001).write(tmp_path / "bag")
    result = replay_bag(folder)
    (row,) = [row for row in result.accuracy if row.name == "3D-NL"]
    assert row.sigma == pytest.approx(0.0, abs=1e-15)
    assert row.count == 172  # of 188 images behind the beginning


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["accel", "imu", "pose"])
@pytest.mark.parametrize("late", [False, True])
def test_doubts_about_the_input_come_again_bit_for_bit(kind, late, tmp_path):
    """Gravity in the accelerations, a fifth of it in forces, a tool that points down."""
    live = begun_late(kind, 1010) if late else LiveBag(kind)
    live.checks = True
    live.offset = (0.0, 0.0, {"accel": GRAVITY, "imu": -0.8 * GRAVITY, "pose": 0.0}[kind])
    live.attitude = lambda index: (1.0, 0.0, 0.0, 0.0)
    result = replay_bag(live.write(tmp_path / "bag"))
    found = result.verification
    assert found.exact, found.lines()
    word = {"accel": "gravity is contained", "imu": "of size 1.96", "pose": "points down"}[kind]
    assert any(word in line for line in result.warnings)
    flags = recorded_flags(tmp_path / "bag")
    assert flags[-1] & EstimateFlag.INPUT_DOUBTFUL
    # A second of rest is at the beginning: from then on all are flagged.
    assert all(flag & EstimateFlag.INPUT_DOUBTFUL for flag in flags[500:])


@pytest.mark.first(1)
@pytest.mark.parametrize("moves", [False, True])
def test_an_imu_mounted_askew_is_flagged_and_named_in_the_replay(moves, tmp_path, monkeypatch):
    """By 10°, at rest or with motions of a second after which it stands still for one."""
    t = np.arange(0.0, 5.0, 0.002)
    swing = moves * np.where(t % 2.0 > 1.0, 2.0 * np.sin(2.0 * np.pi * t), 0.0)
    stamps = START + np.rint(1e9 * t).astype(np.int64)
    told = stamps, np.column_stack((swing, 0.0 * t, 0.0 * t))
    monkeypatch.setattr("slosh_testing.live_bag.motion", lambda seconds: told)
    live = LiveBag("imu")
    live.checks, live.rotation = True, (0.0, 0.174533, 0.0)
    live.rate = (0.0, 0.0, 0.0)
    result = replay_bag(live.write(tmp_path / "bag"))
    assert result.verification.exact, result.verification.lines()
    assert any("10.0° off the container's +z" in line for line in result.warnings)
    flags = recorded_flags(tmp_path / "bag")
    assert all(flag & EstimateFlag.INPUT_DOUBTFUL for flag in flags[2000:])


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["accel", "imu", "pose"])
def test_a_mounting_is_applied_again_bit_for_bit(kind, tmp_path):
    live = LiveBag(kind)
    live.checks, live.rotation = True, (0.02, -0.01, 0.7)
    result = replay_bag(live.write(tmp_path / "bag"))
    assert result.verification.exact, result.verification.lines()
    # The rotation tilts what the pose says; the recorded model does not feel it.
    assert len(result.warnings) == (kind == "pose")
    assert all("tilts by up to 1.3 deg" in line for line in result.warnings)


def recorded_flags(folder):
    reader = BagReader(folder)
    return [reader.decode(m).flags for m in reader.messages() if m.topic == "/slosh/estimate"]


@pytest.mark.parametrize("count", [1, 20])
def test_estimates_recorded_before_their_inputs_at_the_end_are_not_checked(count, tmp_path):
    """A recorder of events may end between an estimate and the input that it is made of."""
    live = LiveBag()
    live.states = True
    live.unheard = range(2500 - count, 2500)
    found = replay_bag(live.write(tmp_path / "bag")).verification
    assert found.exact, found.lines()
    assert found.unchecked == {"behind the last recorded input": count}


def test_inputs_that_are_lacking_for_long_at_the_end_are_told(tmp_path):
    live = LiveBag()
    live.states = True
    live.unheard = range(2000, 2500)
    found = replay_bag(live.write(tmp_path / "bag")).verification
    assert not found.exact
    assert found.missing > 300


def test_a_few_long_intervals_are_not_the_rate_of_the_input(tmp_path):
    """Of a busy machine: 40 ms without a message every 60 ms, in the last tenth of the run."""
    live = LiveBag()
    live.checks, live.pose_window = True, 0.0
    live.unheard = live.unused = [k for k in range(2250, 2500) if k % 30 < 20]
    result = replay_bag(live.write(tmp_path / "bag"))
    assert result.verification.exact, result.verification.lines()
    (line,) = result.warnings
    assert re.search(r"at \d+ of 2330 samples accelerations arrive at 2\d.* Hz: the gain", line)
