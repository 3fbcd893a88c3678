"""Tests recordings of many kinds: cut into chunks, late, incomplete or of two cells."""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.recorded.input_blocks import InputBlocks
from slosh_motion.recorded.sources import find_sources
from slosh_replay.recording.heights import measurements
from slosh_replay.replay import replay_bag
from slosh_replay.replay.checking import RECORDED, check_result, excesses
from slosh_replay.replay.replay_bag import feed
from slosh_replay.replay.stream import ReplayStream
from slosh_testing.bags import copied
from slosh_testing.live_bag import MODEL, MS, START, TEXT, LiveBag, Quaternion

BAGS = Path(__file__).parents[1] / "bags"


@pytest.fixture
def live():
    return LiveBag()


def everything(result):
    return json.loads(result.to_json(series=True))


def rewritten(bag, folder, chunk, monkeypatch):
    """Rewrites a bag with chunks of about a given size [bytes]."""
    monkeypatch.setattr("slosh_bag.mcap_files.mcap_file.CHUNK_BYTES", chunk)
    return copied(bag, folder)


@pytest.fixture(scope="module")
def eventful(tmp_path_factory):
    """Writes a bag with late images and estimates, gaps on both sides, and a restart."""
    live = busy(LiveBag())
    lags = np.random.default_rng(1).integers(5, 1990, 3000) * MS
    live.image_lag = lambda index: int(lags[index])
    live.estimate_lag = lambda index: round((100 + 90 * math.sin(index / 100)) * MS)
    return live.write(tmp_path_factory.mktemp("eventful") / "bag")


def busy(live):
    """Writes a bag with gaps, lost estimates and a restart."""
    live.unused = live.unheard = range(700, 760)
    live.restarts = {1200}
    live.unrecorded = {300, 301, 900, *range(1200, 1203), 1500}
    live.camera_gap = (2.2, 2.9)
    live.height = 1.2
    return live


@pytest.mark.first(1)
@pytest.mark.parametrize("chunk", [4 << 10, 50_000, 300_000])
def test_chunks_do_not_matter(eventful, tmp_path, monkeypatch, chunk):
    in_one = rewritten(eventful, tmp_path / "one" / "bag", 8 << 20, monkeypatch)
    in_many = rewritten(eventful, tmp_path / "many" / "bag", chunk, monkeypatch)
    sources = find_sources(in_many, BagReader(in_many))
    readers = [BagReader(bag) for bag in (in_one, in_many)]
    counts = [
        len(list(feed(reader, sources, {}, InputBlocks(reader, sources, InputSettings()))))
        for reader in readers
    ]
    assert counts[0] == 1
    assert counts[1] > 500_000 // chunk
    expected = replay_bag(in_one)
    assert expected.verification.exact
    assert len(expected.events) > 3
    assert expected.counters["not_used_live"] == 7
    assert everything(replay_bag(in_many)) == everything(expected)


@pytest.mark.first(1)
@pytest.mark.parametrize("index", [0, 900], ids=["at first", "later"])
def test_a_process_that_ended_before_it_estimated_is_nobodys_start(live, tmp_path, index):
    live.idle = {index}
    live.unrecorded = {index + 1}
    replayed = replay_bag(live.write(tmp_path / "bag"))
    assert replayed.verification.exact, replayed.verification.lines()


def test_one_image_from_the_future_changes_nothing_else(live, tmp_path, monkeypatch):
    """A camera's clock may be wrong for a moment; the estimates are monitored all the same."""
    live.image_lag = lambda index: -300 * MS  # the camera's clock is a little ahead
    bag = live.write(tmp_path / "good" / "bag")
    stamps = iter(range(10**6))

    def strange(columns, measurements=measurements):
        found = measurements(columns)
        for row in range(len(found.stamps)):
            if next(stamps) == 20:
                found.stamps[row] += 3600 * 10**9
        return found

    good = replay_bag(rewritten(bag, tmp_path / "bag", 20_000, monkeypatch))
    monkeypatch.setattr(sys.modules[feed.__module__], "measurements", strange)
    result = replay_bag(tmp_path / "bag")
    assert np.isfinite(result.heights["3D-NL"]).sum() == len(good.stamps) - 1
    assert len(excesses(result.events)) == len(excesses(good.events)) > 0
    assert result.comparisons is None
    assert result.verification.exact


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["imu", "pose"])
def test_other_inputs_give_their_estimates_again(tmp_path, kind):
    live = LiveBag(kind)
    if kind == "imu":
        live.unrecorded = {700, 701, 900}
    result = replay_bag(live.write(tmp_path / "bag"))
    assert result.source == f"/slosh/{kind}"
    assert result.verification.exact
    assert result.verification.recorded > 2400
    assert max(result.measured) > 0.005


FOUND = {
    "gravity_tilt": {},
    "lever_arm": {"x": 0.05, "y": 0.0, "z": -0.2},
    "yaw_coupling": {"kappa": 0.3},
    "height_scale": {"gain": 1.3},
    "draining_film": {"speed": 0.05},
}


def tipped(index: int) -> Quaternion:
    """Writes a bag whose container rolls to and fro from the second second on, and yaws."""
    second = max(0.002 * index - 1.0, 0.0)
    turn = Rotation.from_euler("ZX", [0.5 * np.sin(2.0 * second), 0.1 * np.sin(3.0 * second)])
    x, y, z, w = turn.as_quat().tolist()
    return x, y, z, w


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["imu", "pose"])
@pytest.mark.parametrize("tau", [0.1, -0.1])
def test_a_found_model_replays_as_it_ran_and_agrees_with_its_camera(tmp_path, kind, tau):
    live = LiveBag(kind)
    live.model = MODEL
    for effect, parameters in FOUND.items():
        live.model = live.model.with_effect(effect, **parameters)
    live.model = live.model.with_effect("time_offset", tau=tau)
    live.attitude = tipped
    live.camera_gap = (2.2, 2.5)
    result = replay_bag(live.write(tmp_path / "bag"))
    assert result.verification.exact
    assert result.verification.recorded > 2400
    row = next(row for row in result.accuracy if row.name == live.model.name)
    assert row.count > 250
    assert row.sigma < 1e-5
    assert max(result.measured) > 0.005
    # Without what was found they do not agree.
    other = replay_bag(tmp_path / "bag", MODEL).accuracy
    assert next(row for row in other if row.name.startswith("3D-NL")).sigma > 1e-4


def test_without_images_the_estimates_are_verified_all_the_same(live, tmp_path):
    live.topics = {"accel", "estimate", "settings"}
    result = replay_bag(live.write(tmp_path / "bag"))
    assert result.verification.exact
    assert (result.accuracy, result.counters["images"], result.warnings) == ((), 0, ())
    assert len(result.motions) == 0
    json.loads(result.to_json(series=True))


def test_without_settings_a_model_is_needed(live, tmp_path):
    live.unrecorded = {700, 701}
    live.topics = {"accel", "estimate", "free_surface"}
    bag = live.write(tmp_path / "bag")
    with pytest.raises(SloshBagError, match="contains no model or container"):
        replay_bag(bag)
    result = replay_bag(bag, MODEL, MonitorSettings(measured_limit=0.006))
    assert result.verification.exact
    assert result.counters["not_used_live"] == 2
    assert result.events


def test_a_camera_that_saw_nothing_is_told_and_the_rest_is_replayed(live, tmp_path):
    live.height = float("nan")
    result = replay_bag(live.write(tmp_path / "bag"))
    assert result.verification.exact
    assert result.accuracy == ()
    (warning,) = result.warnings
    assert warning.startswith("bag: no image has a usable height")


def test_a_recording_that_begins_late_says_why_it_differs(live, tmp_path):
    def heard(message):
        return message.log_ns > START + 2 * 10**9 or message.topic.endswith("settings")

    bag = copied(live.write(tmp_path / "whole"), tmp_path / "bag", heard)
    found = replay_bag(bag).verification
    assert not found.exact
    assert not found.missing
    assert found.unchecked == {"before the first known state": 1499}


def without_input(bag, folder, first, last):
    """Writes a copy of a bag without some input messages."""

    def kept(message):
        index = (message.log_ns - START) // (2 * MS)
        return not (message.topic.endswith("accel") and first <= index < last)

    return copied(bag, folder, kept)


def test_comparisons_without_a_journal_are_compared_and_a_difference_fails_nothing(tmp_path):
    plain = copied(BAGS / "l", tmp_path / "plain", lambda m: not m.topic.endswith("/journal"))
    whole = replay_bag(plain).verified["comparison"]
    assert whole.exact
    assert whole.recorded == BagReader(plain).topics()["/slosh/free_surface"].count
    heights = [m.log_ns for m in BagReader(BAGS / "l").messages({"/slosh/free_surface"})]
    without = copied(
        plain, tmp_path / "bag",
        lambda m: not (m.topic == "/slosh/free_surface" and m.log_ns == heights[100]),
    )  # fmt: skip
    result = replay_bag(without)
    found = result.verified["comparison"]
    assert (found.recorded, found.missing) == (whole.recorded - 1, 1)
    assert any("recorded before journals: order unknown" in line for line in found.lines())
    assert check_result(result, RECORDED).passed


def cells(tmp_path, **namespaces):
    first, *others = [LiveBag() for _ in namespaces]
    for live, (name, height) in zip([first, *others], namespaces.items(), strict=True):
        live.namespace, live.height = f"/{name}", height
    return [first, *others]


def test_of_two_cells_one_is_replayed_and_the_other_is_named(tmp_path):
    first, second = cells(tmp_path, left=1.0, right=1.5)
    bag = first.write(tmp_path / "bag", beside=[second])
    result = replay_bag(bag)
    assert result.source == "/left/accel"
    assert result.verification.exact
    assert result.verification.topic == "/left/estimate"
    (warning,) = result.warnings
    assert warning == f"{bag}: the cell /left is replayed; the bag also holds /right"
    rows = {row.name: row for row in result.accuracy}
    assert rows["3D-NL"].sigma == pytest.approx(0.0, abs=1e-12)
    other = replay_bag(bag, cell="right")
    assert other.source == "/right/accel"
    assert other.verification.topic == "/right/estimate"
    assert {row.name: row for row in other.accuracy}["3D-NL"].sigma > 1e-4
    with pytest.raises(SloshBagError, match="no topic of a cell /middle"):
        replay_bag(bag, cell="/middle")


def test_a_model_that_is_given_stays_through_all_changes(live, tmp_path):
    live.loads = {700: TEXT.replace("0.07", "0.06")}
    bag = live.write(tmp_path / "bag", seconds=1.0)
    result = replay_bag(bag, MODEL)
    assert result.model == MODEL
    assert 700 <= result.verification.identical < 710


@pytest.mark.long
def test_while_the_input_was_not_recorded_nothing_piles_up(live, tmp_path, monkeypatch):
    """Images and estimates of eight seconds, and no input."""
    bag = without_input(live.write(tmp_path / "all", 10.0), tmp_path / "cut", 1500, 5500)
    bag = rewritten(bag, tmp_path / "bag", 20_000, monkeypatch)
    waiting = []

    def advance(stream, *, final=False, go_on=ReplayStream.advance):
        go_on(stream, final=final)
        sides = stream._measured, stream.verifiers["estimate"]._recorded
        waiting.append(max(sum(len(part.stamps) for part in side) for side in sides))

    monkeypatch.setattr(ReplayStream, "advance", advance)
    result = replay_bag(bag)
    assert result.verification.missing == 4001  # the first one behind the gap waits for the next
    assert max(waiting) < 500 * 2.5  # two seconds, and what a chunk holds
