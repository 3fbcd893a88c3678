"""Tests that each run ends with a report, which explains missing measurements."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from slosh_bag.errors import SloshBagError
from slosh_bringup.live.report import REPORT, RESULT, make_live_report
from slosh_camera.measurement import Flag
from slosh_replay.replay import replay_bag
from slosh_testing.live_bag import MS, LiveBag

BAGS = Path(__file__).parents[1] / "bags"


def written(folder, problems, *, began=True):
    report = make_live_report(folder / "bag", "Cell", problems, began=began)
    report.write(folder)
    return report.result


def results(tmp_path, bag, problems=(), began=True):
    bag.write(tmp_path / "bag")
    found = written(tmp_path, problems, began=began)
    return found, json.loads((tmp_path / RESULT).read_text()), (tmp_path / REPORT).read_text()


def live_bag(*without, **attributes):
    bag = LiveBag()
    bag.topics = {"accel", "estimate", "free_surface", "settings"} - set(without)
    for name, value in attributes.items():
        setattr(bag, name, value)
    return bag


@pytest.mark.first(4)
@pytest.mark.parametrize(
    ("bag", "reasons"),
    [
        (
            live_bag("accel", "estimate", "free_surface"),
            ["no messages received on /slosh/accel", "no images received on camera/image_raw"],
        ),
        (live_bag("free_surface"), ["no images received on camera/image_raw"]),
        (
            live_bag("accel", "estimate"),
            ["no messages received on /slosh/accel, the input of the models"],
        ),
        (live_bag("estimate"), ["2500 messages received on /slosh/accel, but none could be used"]),
        (
            live_bag(image_flags=Flag.NOT_FOUND),
            ["no free surface was found in any of 313 images on camera/image_raw: NOT_FOUND 313"],
        ),
        (
            live_bag(image_ahead=100_000 * MS),
            ["the stamps of the images are 95.0 s ahead of those of the input: both must use"],
        ),
        (
            live_bag(image_ahead=-100_000 * MS),
            ["the stamps of the images are 95.0 s behind those of the input: both must use"],
        ),
        (
            live_bag(image_lag=lambda index: 3_000 * MS),
            ["313 heights were measured, most of them 3.0 s after their images: too late"],
        ),
        (live_bag(), ["313 heights were measured and estimated, but the monitor compared none"]),
    ],
)
def test_a_run_without_measurements_says_why(tmp_path, bag, reasons):
    found, document, page = results(tmp_path, bag)
    assert len(found.reasons) == len(reasons)
    for told, reason in zip(found.reasons, reasons, strict=True):
        assert told.startswith(reason)
    assert document["nothing_because"] == list(found.reasons)
    assert document["status"]["verdict"] == "failed"
    assert "nothing was measured, because " + reasons[0].split(",")[0] in page
    assert found.figures.compared == 0
    assert math.isnan(found.figures.agreements[0].sigma)


def test_old_stamps_are_named(tmp_path):
    """A bag that is played to nodes without use_sim_time, or a robot with another clock."""
    bag = live_bag("estimate", "free_surface")
    entries = bag.entries
    hour = 3_600_000 * MS
    bag.entries = lambda seconds: [(log + hour, *rest) for log, *rest in entries(seconds)]
    found, *_ = results(tmp_path, bag)
    assert found.reasons[0].endswith("their stamps are 3600.0 s behind this machine's clock")


def test_no_bag_at_all_is_a_report_too(tmp_path):
    found = written(tmp_path, ("node recorder ended",))
    assert found.reasons[0] == "node recorder ended"
    assert found.reasons[1].startswith("nothing was recorded: ")
    assert "node recorder ended" in (tmp_path / REPORT).read_text()
    assert json.loads((tmp_path / RESULT).read_text())["nothing_because"] == list(found.reasons)


def test_a_recording_that_is_not_reproduced_is_a_failure(monkeypatch):
    """With the same lines as `slosh replay --check` has."""

    def with_a_difference(run, replay=replay_bag):
        found = replay(run)
        one = replace(found.verification, identical=found.verification.recorded - 1)
        return replace(found, verified={**found.verified, "estimate": one})

    monkeypatch.setattr("slosh_bringup.live.report.replay_bag", with_a_difference)
    monkeypatch.setattr("slosh_bringup.live.report.checked_by_journal", lambda found, run: found)
    found = make_live_report(BAGS / "l", "Cell", began=True, events=False)
    assert any("bit for bit, 1 differ" in line for line in found.result.failures)
    assert set(found.result.failures) <= set(found.result.warnings)
    assert '"verdict": "failed"' in found.text


def test_a_recording_that_is_reproduced_is_none():
    assert make_live_report(BAGS / "l", "Cell").result.failures == ()


def test_a_recording_that_cannot_be_replayed_is_a_failure(monkeypatch):
    def refused(*_, **__):
        raise SloshBagError("holds no message of accel")

    monkeypatch.setattr("slosh_bringup.live.report.replay_bag", refused)
    found = make_live_report(BAGS / "l", "Cell", began=True, events=False)
    assert found.result.figures.compared > 300
    assert found.result.failures == ("not replayed: holds no message of accel",)
    assert found.result.failures[0] in found.result.warnings
    assert found.result.failures[0] in found.page
