"""Tests that a replay reproduces recorded estimates, or explains why it cannot."""

import math

import numpy as np
import pytest

from slosh_bag.reader import BagReader
from slosh_model import Model, Rectangle
from slosh_model.model_text import parse_model
from slosh_replay.replay import replay_bag
from slosh_replay.replay.output_bag import OutputBag
from slosh_testing.live_bag import MODEL, MS, STATE_EVERY, TEXT, LiveBag

TANK = Model(Rectangle(0.09, 0.07, 0.06), modes=2).spatial().with_effect("gravity_tilt")
SHALLOW = TEXT.replace("0.07", "0.06")


@pytest.fixture
def live():
    return LiveBag()


def verified(folder, model=None):
    result = replay_bag(folder, model)
    return result, result.verification


def test_a_recording_gives_its_own_estimates_again(live, tmp_path):
    result, found = verified(live.write(tmp_path / "bag"))
    assert found.exact
    assert found.recorded == result.counters["samples_used"] == 2500
    assert result.model == MODEL
    assert result.limits.measured_limit == 0.006  # the recorded monitor's
    (row,) = [row for row in result.accuracy if row.name == "3D-NL"]
    assert row.sigma == pytest.approx(0.0, abs=1e-15)


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["accel", "imu", "pose"])
def test_a_rectangle_that_turns_gives_its_own_estimates_again(kind, tmp_path):
    live = LiveBag(kind)
    live.model = TANK
    live.attitude = lambda index: (0.0, 0.0, math.sin(1e-3 * index), math.cos(1e-3 * index))
    result, found = verified(live.write(tmp_path / "bag"))
    assert found.exact, found.lines()
    assert result.model == TANK


def test_estimates_that_the_recorder_missed_are_replayed(live, tmp_path):
    live.unrecorded = {800, 801, 1200}
    _, found = verified(live.write(tmp_path / "bag"))
    assert found.exact
    assert (found.recorded, found.extra) == (2497, 3)


def test_without_a_journal_a_lost_input_leaves_the_order_unknown(live, tmp_path):
    """The recorder heard inputs that the live estimator lost: no guess hides that."""
    live.unused = {1200, 1201}
    result, found = verified(live.write(tmp_path / "bag"))
    assert not found.exact
    assert (found.recorded, found.missing) == (2498, 0)
    assert found.identical >= 1200
    assert any("recorded before journals: order unknown" in line for line in found.lines())
    assert result.counters["not_used_live"] == 2


@pytest.mark.parametrize("kind", ["accel", "imu", "pose"])
def test_with_a_journal_lost_and_late_inputs_are_left_out_without_ros(kind, tmp_path, monkeypatch):
    """The live estimator lost some, also more than a chunk, and took others too late."""
    monkeypatch.setattr("slosh_bag.mcap_files.mcap_file.CHUNK_BYTES", 10_000)
    live = LiveBag(kind)
    live.journal, live.pose_window, live.checks = True, 0.02, True
    live.unused = {700, 701, *range(1200, 1210), *range(1800, 2200)}
    live.delay = lambda index: 600 * MS if 1500 <= index < 1505 else 2 * MS
    result, found = verified(live.write(tmp_path / "bag"))
    assert found.exact, found.lines()
    assert found.recorded > 1900
    assert result.counters["not_used_live"] == len(live.unused) + 5


@pytest.mark.parametrize("kind", ["accel", "imu", "pose"])
@pytest.mark.parametrize("chunk", [10_000, 1_000_000])
def test_with_a_journal_inputs_that_the_recorder_missed_cost_the_time_to_the_next_state(
    kind, chunk, tmp_path, monkeypatch
):
    monkeypatch.setattr("slosh_bag.mcap_files.mcap_file.CHUNK_BYTES", chunk)
    live = LiveBag(kind)
    live.journal, live.states, live.pose_window, live.checks = True, True, 0.02, True
    live.unheard = {1130, *range(1640, 1650)}
    _, found = verified(live.write(tmp_path / "bag"))
    assert found.exact, found.lines()
    why = "after inputs that are missing in the recording, until the next known state"
    expected = sum(STATE_EVERY - index % STATE_EVERY for index in (1130, 1640))
    assert abs(found.unchecked[why] - expected) <= 20
    assert found.recorded + sum(found.unchecked.values()) > 2450


@pytest.mark.parametrize("early", [0, 80])
def test_an_estimate_that_is_heard_before_its_input_begins_no_late_recording(
    live, tmp_path, early
):
    live.estimate_lag = lambda index: -early * MS
    _, found = verified(live.write(tmp_path / "bag"))
    assert found.exact, found.lines()
    assert not found.unchecked


def test_another_model_in_the_run_is_loaded_at_its_moment(live, tmp_path):
    live.loads = {1250: SHALLOW}
    result, found = verified(live.write(tmp_path / "bag"))
    assert found.exact
    assert result.model == parse_model(SHALLOW)


@pytest.mark.first(1)
@pytest.mark.parametrize("every", [1, 4, 17])
def test_poses_over_a_chosen_window_give_their_estimates_again(every, tmp_path):
    """The window follows the model in use, here a slower one from the middle on."""
    live = LiveBag("pose")
    live.pose_window, live.every = 0.0, every
    live.loads = {75 * 17 - 75 * 17 % every: SHALLOW}
    result, found = verified(live.write(tmp_path / "bag"))
    assert found.exact, found.lines()
    assert found.recorded > 2300 / every
    assert result.model == parse_model(SHALLOW)


def test_one_bit_of_one_parameter_is_seen_and_named(live, tmp_path):
    alpha = math.nextafter(0.58, 1.0)
    _, found = verified(
        live.write(tmp_path / "bag"), parse_model(TEXT.replace("0.58", repr(alpha)))
    )
    assert not found.exact
    assert found.identical < found.recorded
    assert found.first.field.startswith("nonlinear.")
    assert 1 <= found.first.units_in_the_last_place < 10
    text = "\n".join(found.lines())
    assert f"surface_nonlinearity.alpha: recorded 0.58, replayed with {alpha!r}" in text
    assert found.first.field in text


def test_a_silent_camera_leaves_a_gap_and_ends_an_excess(live, tmp_path):
    live.camera_gap = (2.2, 3.2)
    result, _ = verified(live.write(tmp_path / "bag"))
    gap = np.diff(result.t).max()
    assert gap == pytest.approx(1.0, abs=0.03)
    assert any("stopped" in event.description for event in result.events)


def test_outputs_go_to_a_bag_that_equals_the_recorded_one(live, tmp_path):
    bag = live.write(tmp_path / "bag")
    with OutputBag(tmp_path / "new") as outputs:
        result = replay_bag(bag, outputs=outputs)
    old, new = BagReader(bag), BagReader(tmp_path / "new")
    for before, after in zip(
        old.messages(["/slosh/estimate"]), new.messages(["/slosh/estimate"]), strict=True
    ):
        a, b = old.decode(before), new.decode(after)
        assert b.header.frame_id == "container"
        b.header.frame_id = a.header.frame_id
        assert repr(a) == repr(b)
    counts = {name: info.count for name, info in new.topics().items()}
    assert counts["/slosh/comparison"] == result.counters["images"]
    assert counts["/slosh/limit_event"] == len(result.events) > 0


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["accel", "imu", "pose"])
@pytest.mark.parametrize("jump", [{}, {1500: {"max_jump": 0.05}, 1600: {"max_jump": 20.0}}])
def test_parameters_that_change_apply_from_the_same_input_on(kind, jump, tmp_path):
    """A gap of 60 ms is one by the first value, and none by the second one."""
    live = LiveBag(kind)
    live.unused = live.unheard = (*range(800, 830), *range(1300, 1330))
    live.changes = {1200: {"max_gap": 0.1}, **jump}
    result, found = verified(live.write(tmp_path / "bag"))
    assert found.exact, found.lines()
    assert result.counters["gaps"] == live.gaps
    if not jump:
        assert live.gaps == 1
    live.changes = {}
    live.write(tmp_path / "unchanged")
    assert live.gaps == 2


def test_settings_that_change_with_a_new_process_are_its_own(live, tmp_path):
    """The parameters that changed are forgotten by a process that is started anew."""
    live.changes = {700: {"max_gap": 0.1}, 1290: {"max_gap": 0.2}}
    live.restarts = (1000,)
    live.unused = live.unheard = (*range(800, 830), *range(1100, 1130), *range(1300, 1330))
    result, found = verified(live.write(tmp_path / "bag"))
    assert found.exact, found.lines()
    assert result.counters["gaps"] == 1  # at 1100
