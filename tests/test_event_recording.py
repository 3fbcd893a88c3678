"""Tests an event recorder beside estimator and monitor: its bags replay bit for bit."""

from pathlib import Path

import numpy as np
import pytest
from std_srvs.srv import Trigger

from slosh_bag.bag_writer import Qos
from slosh_bag.black_box.black_box import Cause, Happening, Windows
from slosh_bag.black_box.event_bags import EventRecorder, noted_events
from slosh_bag.black_box.ring import Place
from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.processes import NodeProcess
from slosh_bringup.replay.page import make_report
from slosh_bringup.replay.task import Task, replay_task
from slosh_discovery.discover_data import day_motions
from slosh_discovery.discover_data.reading import files_at
from slosh_discovery.discovering import recorded_model
from slosh_discovery.errors import SloshDiscoveryError
from slosh_msgs.msg import SloshComparison
from slosh_msgs_py import topics
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import replay_bag
from slosh_replay.replay.checking import check_result, expectation_of
from slosh_replay.replay.report import Surroundings
from slosh_testing.journaled import replayed_by_journal
from slosh_testing.live_bag import LiveBag
from slosh_testing.robot import nodes_and_robot, swing

EVENTS = {"mode": "events", "event_before": "2.0", "event_after": "1.0"}
ERROR = SloshComparison.STATE_ERROR


def events_of(bag):
    """Returns the events in a bag's metadata; empty while the bag is being written."""
    if not (bag / "metadata.yaml").exists() or (bag / ".reserve").exists():
        return []
    return noted_events(RecordedRun(bag).facts.get("events", ""))


def bags_of(folder, cause):
    """Returns the finished bags that contain an event with a given cause."""
    bags = sorted(folder.iterdir())
    return [bag for bag in bags if cause in {event.cause for event in events_of(bag)}]


@pytest.mark.long
def test_a_bag_round_an_event_replays_bit_for_bit_and_tells_what_happened(tmp_path, domain):
    folder = tmp_path / "events"
    with nodes_and_robot(tmp_path, domain) as (group, robot):
        robot.push = swing(0.05)
        group.start(NodeProcess("recorder", (), {"output": str(folder), **EVENTS}))
        robot.until(lambda: robot.recorded >= {"estimator", "monitor"}, "the recorder")
        robot.for_seconds(3.0)
        robot.surface.msh = 0.03
        robot.until(lambda: robot.comparisons[-1].state == ERROR, "a limit event")
        robot.surface.msh = 0.0001
        robot.until(lambda: bags_of(folder, Cause.LIMIT), "the bag of a limit event")
        answer = robot.call(Trigger, topics.KEEP)
        assert answer.success
        robot.until(lambda: bags_of(folder, Cause.REQUEST), "the bag that was asked for")
    assert Path(answer.message) in bags_of(folder, Cause.REQUEST)
    for bag in files_at(folder):
        result = replayed_by_journal(bag)
        found = result.verified
        for name in ("estimate", "fused_estimate", "comparison"):
            assert found[name].exact, found[name].lines()
        assert found["estimate"].recorded > 100
        assert check_result(result, expectation_of(result)).passed
    run = RecordedRun(bags_of(folder, Cause.LIMIT)[0])
    report = make_report(run, replay_bag(run), Surroundings())
    assert any(note.startswith("event limit at ") for note in report.notes)


@pytest.mark.long
def test_a_recorder_of_everything_says_that_there_is_nothing_to_ask_for(tmp_path, domain):
    with nodes_and_robot(tmp_path, domain) as (group, robot):
        group.start(NodeProcess("recorder", (), {"output": str(tmp_path / "bag")}))
        robot.until(lambda: "recorder" in robot.health, "the recorder")
        answer = robot.call(Trigger, topics.KEEP)
        assert not answer.success
        assert "recorded already" in answer.message


def cut(source, folder, *at, before=5.0, after=5.0):
    """Writes event bags at times [s] of a recording, as its recorder would have done."""
    recorder = EventRecorder(
        folder, Windows(round(before * SECOND), round(after * SECOND), 10**9, 10**9), 100, 10**10,
        lambda topic, data: Place(data) if topic.endswith("/settings") else None,
    )  # fmt: skip
    reader, times = BagReader(source), list(at)
    for name, info in reader.topics().items():
        recorder.add_topic(name, info.message_type, Qos())
    begin_ns = None
    for message in reader.messages():
        begin_ns = begin_ns or message.log_ns
        recorder.add(message.topic, message.data, message.log_ns, message.publish_ns)
        if times and message.log_ns - begin_ns >= times[0] * SECOND:
            recorder.happen(Happening(Cause.REQUEST, message.log_ns, f"at {times.pop(0)} s"))
    recorder.close()
    return sorted(folder.iterdir())


def recorded(folder):
    """Writes the bag of an estimator with its states, during one motion of 3 s."""
    live = LiveBag()
    live.states = True
    return live.write(folder)


def test_a_bag_from_the_middle_of_a_run_replays_from_its_first_state_on(tmp_path):
    (bag,) = cut(recorded(tmp_path / "run"), tmp_path / "events", 2.5, before=1.0, after=1.0)
    result = replay_bag(bag)
    found = result.verification
    assert found.exact, found.lines()
    assert found.recorded + sum(found.unchecked.values()) == pytest.approx(1000, abs=3)
    assert list(found.unchecked) == ["before the first known state"]
    assert sum(found.unchecked.values()) <= 125
    assert check_result(result, expectation_of(result)).passed
    report = make_report(RecordedRun(bag), result, Surroundings())
    (note,) = [note for note in report.notes if note.startswith("event ")]
    assert note.startswith("event request at ")
    assert note.endswith(" s: at 2.5 s")
    assert replay_task(Task(bag, "bag")).differences[0] == note


def test_discover_takes_a_folder_of_event_bags_and_each_motion_once(tmp_path):
    """Two bags hold the motion, one of them not to its end; a third one is of the rest before."""
    run, folder = recorded(tmp_path / "run"), tmp_path / "all"
    cut(run, tmp_path / "part", 2.5, before=60.0, after=0.8)
    cut(run, tmp_path / "whole", 2.5, before=60.0, after=60.0)
    cut(run, tmp_path / "rest", 0.3, before=0.3, after=0.1)
    folder.mkdir()
    for number, name in enumerate(("part", "whole", "rest")):
        (tmp_path / name / "0001_request").rename(folder / f"{number:04d}_{name}")
    (folder / "0003_limit").mkdir()  # of a recorder that was killed on a full disk
    (folder / "0003_limit" / "0003_limit_0.mcap").write_bytes(b"\x89MCAP0\r\n and no more")
    told = []
    (found,) = day_motions(folder, tell=told.append)
    (wanted,) = day_motions(run)
    assert found.motion.name == "0001_whole#1"
    assert np.array_equal(found.motion.msh, wanted.motion.msh)
    for name in ("0002_rest", "0003_limit"):
        assert any(line.startswith("left out: ") and name in line for line in told)
    assert recorded_model(folder) == recorded_model(run)


def test_a_folder_of_event_bags_without_a_motion_is_refused_in_one_line(tmp_path):
    run = recorded(tmp_path / "run")
    (bag,) = cut(run, tmp_path / "rest", 0.3, before=0.3, after=0.1)
    with pytest.raises((SloshBagError, SloshDiscoveryError), match=bag.name):
        day_motions(tmp_path / "rest")
