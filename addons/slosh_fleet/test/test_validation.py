"""The validation report: its numbers are those of a replay, and its verdicts are honest."""

import dataclasses
import hashlib
import json
import math
import re
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from slosh_bag.bag_writer import BagWriter
from slosh_bag.errors import SloshBagError
from slosh_bag.held_folder import HeldFolder
from slosh_bag.reader import BagReader
from slosh_bag.recover import NotedDefinitions
from slosh_fleet.validation.assemble import Order, assemble, repeatability
from slosh_fleet.validation.content import Peak, Verdict
from slosh_fleet.validation.criteria import Acceptance, judge
from slosh_fleet.validation.document import HEIGHT, validation_page
from slosh_fleet.validation.files import check_files
from slosh_fleet.validation.seal import check_seal, content_of
from slosh_msgs.msg import NodeSettings
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import replay_bag
from slosh_replay.replay.report import Surroundings, replay_report
from slosh_report.run_report import RunMotion

BAGS = Path(__file__).parents[3] / "bags"
LENGTHS = st.floats(0.0, 0.2)
EVENT = json.dumps([{"cause": "limit", "stamp_ns": 5, "text": "over the limit"}])


def report_of(*bags, **given):
    """Creates the validation report of recordings; the options are fields of `Order`."""
    names = tuple(bag.name for bag in bags)
    return assemble(bags, Order(names, **given)).report


def verdict_of(report, name=HEIGHT, recording=None):
    (found,) = [
        one for one in report.criteria if one.name == name and recording in (None, one.recording)
    ]
    return found


def altered(bag, folder, *, without=(), facts=None, parameter=""):
    """Copies a bag without some topics, with other facts, or with another monitor parameter."""
    reader = BagReader(bag)
    with BagWriter(folder, NotedDefinitions(reader.types), facts) as writer:
        for message in reader.messages():
            if message.topic in without:
                continue
            data = bytes(message.data)
            if parameter and message.topic.endswith("settings"):
                data = with_parameter(data, parameter)
            writer.add_topic(message.topic, message.message_type)
            writer.write(message.topic, data, message.log_ns)
    return folder


def with_parameter(data, parameter):
    settings = deserialize_message(data, NodeSettings)
    if settings.node == "monitor":
        key = parameter.partition(":")[0]
        line = re.compile(rf"^  {key}: .*$", re.MULTILINE)
        settings.document, count = line.subn(f"  {parameter}", settings.document)
        assert count == 1
    return serialize_message(settings)


@pytest.fixture(scope="module")
def found():
    return assemble([BAGS / "c"], Order(("c",), issued="2026-11-26"))


def test_numbers_are_those_of_the_replay(found):
    result = replay_bag(BAGS / "c")
    page = replay_report(result, Surroundings())
    recording = found.report.recordings[0]
    assert recording.models == page.models
    assert recording.motions == page.motions
    assert recording.events == page.events
    (highest,) = [one.value for one in page.key_figures if one.label == "highest measured"]
    assert recording.peak.height == highest == verdict_of(found.report).value
    assert [peak.height for peak in recording.motion_peaks] == [m.peak for m in page.motions]
    assert recording.reproduced == recording.estimates == result.verification.identical
    limit = result.limits.measured_limit
    assert verdict_of(found.report).limit == limit
    assert {row.limit for row in found.report.limits if "measured height" in row.quantity} == {
        limit
    }


def test_uncertainty_is_twice_what_the_camera_stated(found):
    run = RecordedRun(BAGS / "c")
    surfaces = [run.reader.decode(one) for one in run.reader.messages({"/slosh/free_surface"})]
    top = max(surfaces, key=lambda one: one.msh)
    assert found.report.recordings[0].peak.uncertainty == pytest.approx(2 * top.msh_stddev)


def test_a_further_uncertainty_is_added_in_quadrature(found):
    own = found.report.recordings[0].peak.uncertainty
    report = report_of(BAGS / "c", uncertainty=0.001)
    assert report.recordings[0].peak.uncertainty == pytest.approx(math.hypot(own, 0.002))


@given(LENGTHS, LENGTHS, LENGTHS)
def test_a_pass_and_a_fail_hold_for_the_whole_interval(value, uncertainty, limit):
    verdict = judge(value, uncertainty, limit)
    assert (verdict is Verdict.PASS) == (value + uncertainty <= limit)
    assert (verdict is Verdict.FAIL) == (value - uncertainty > limit)


@pytest.mark.parametrize("unknown", range(3))
def test_nothing_unknown_is_decided(unknown):
    numbers = [0.001, 0.0001, 0.1]
    numbers[unknown] = math.nan
    assert judge(*numbers) is Verdict.UNDECIDED


@pytest.mark.parametrize(
    ("limit", "verdict"), [(0.03, "pass"), (0.02, "fail"), (0.0257, "undecided")]
)
def test_the_given_limit_is_judged_by(limit, verdict):
    report = report_of(BAGS / "c", acceptance=Acceptance(height=limit))
    assert verdict_of(report).verdict == verdict
    assert report.verdict == verdict


def test_no_camera_is_undecided_and_says_so(tmp_path):
    bag = altered(
        BAGS / "c", tmp_path / "blind", parameter="camera: false",
        without=("/slosh/free_surface", "/slosh/comparison"),
    )  # fmt: skip
    report = report_of(bag, acceptance=Acceptance(height=0.03))
    assert verdict_of(report).verdict is Verdict.UNDECIDED
    assert "no camera" in verdict_of(report).reason
    assert report.verdict is Verdict.UNDECIDED
    assert math.isfinite(report.recordings[0].estimated_peak)


@pytest.mark.parametrize(
    ("name", "reason"), [("cut", "incomplete"), ("camera_gap", "nothing was measured for 1.0")]
)
def test_missing_data_are_undecided(name, reason):
    found = verdict_of(report_of(BAGS / name, acceptance=Acceptance(height=0.05)))
    assert found.verdict is Verdict.UNDECIDED
    assert reason in found.reason


def test_missing_data_do_not_hide_a_failure():
    found = verdict_of(report_of(BAGS / "camera_gap", acceptance=Acceptance(height=0.01)))
    assert found.verdict is Verdict.FAIL


def test_a_bag_of_an_event_is_undecided(tmp_path):
    bag = altered(BAGS / "l", tmp_path / "event", facts={"events": EVENT})
    report = report_of(bag, acceptance=Acceptance(height=0.05))
    assert "around an event" in verdict_of(report).reason
    assert any("over the limit" in line for line in report.deviations)


def test_another_container_is_refused_with_a_remedy(tmp_path):
    model = tmp_path / "model.yaml"
    model.write_text("container: {shape: cylinder, radius: 0.04, fill_height: 0.07}\n")
    with pytest.raises(SloshBagError, match=r"another container.*leave out --model"):
        report_of(BAGS / "c", model=model)


def test_another_model_of_the_container_is_not_compared(tmp_path):
    model = tmp_path / "model.yaml"
    model.write_text("container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\n")
    report = report_of(BAGS / "c", model=model)
    found = verdict_of(report, "recorded estimates not reproduced")
    assert found.verdict is Verdict.UNDECIDED
    assert any("another model" in line for line in report.deviations)


def test_a_bag_that_is_being_recorded_is_refused(tmp_path):
    bag = shutil.copytree(BAGS / "l", tmp_path / "l")
    held = HeldFolder(bag)
    with pytest.raises(SloshBagError, match="being recorded"):
        report_of(bag)
    held.release()


def test_repetitions_of_one_motion_have_a_spread(tmp_path):
    again = shutil.copytree(BAGS / "c", tmp_path / "again")
    report = report_of(BAGS / "c", again, acceptance=Acceptance(spread=0.001))
    (row,) = report.repeatability
    assert (row.count, row.spread, row.deviation) == (2, 0.0, 0.0)
    own = report.recordings[0].motion_peaks[0].uncertainty
    assert row.uncertainty == pytest.approx(math.sqrt(2.0) * own)
    assert verdict_of(report, "spread of the highest height, motion 1").verdict is Verdict.PASS


def test_different_motions_are_no_repetitions(found):
    recording = found.report.recordings[0]
    longer = dataclasses.replace(recording, motions=(RunMotion("1", 0.0, 9.0, 0.01),))
    rows, reason = repeatability([recording, longer])
    assert rows == ()
    assert "different motions" in reason


def test_mean_and_deviation_are_those_of_the_peaks(found):
    recording = found.report.recordings[0]
    heights = (0.010, 0.011, 0.012)
    rows, _ = repeatability(
        [dataclasses.replace(recording, motion_peaks=(Peak(h, 1e-4),)) for h in heights]
    )
    assert rows[0].mean == pytest.approx(0.011)
    assert rows[0].deviation == pytest.approx(0.001)
    assert rows[0].spread == pytest.approx(0.002)


def test_files_are_named_with_their_digests(found):
    for file in found.report.files:
        content = Path(file.path).read_bytes()
        assert file.size == len(content)
        assert file.sha256 == hashlib.sha256(content).hexdigest()
    assert {Path(file.path).name for file in found.report.files} == {"c_0.mcap", "metadata.yaml"}


def test_equal_reports_have_equal_bytes(found):
    again = assemble([BAGS / "c"], Order(("c",), issued="2026-11-26"))
    assert validation_page(*found) == validation_page(*again)


def test_a_moved_and_a_changed_file_are_found(tmp_path):
    bag = shutil.copytree(BAGS / "l", tmp_path / "l")
    content = content_of(report_of(bag))
    report = tmp_path / "report.html"
    assert {one.state for one in check_files(content, report, ())} == {"same"}
    moved = bag.rename(tmp_path / "elsewhere")
    assert {one.state for one in check_files(content, report, ())} == {"missing"}
    assert {one.state for one in check_files(content, report, [tmp_path])} == {"same"}
    with (moved / "l_0.mcap").open("ab") as stream:
        stream.write(b"\0")
    states = {Path(one.path).name: one.state for one in check_files(content, report, [tmp_path])}
    assert states == {"l_0.mcap": "changed", "metadata.yaml": "same"}


def test_the_page_carries_what_was_signed(found):
    check = check_seal(validation_page(*found), "page")
    assert check.failures == ()
    assert check.content == content_of(found.report)
