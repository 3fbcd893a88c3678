"""A recorder of events beside an estimator and a monitor: its bags replay bit for bit."""

from pathlib import Path

import pytest
from std_srvs.srv import Trigger

from slosh_bringup.processes import NodeProcess
from slosh_bringup.replay.page import make_report
from slosh_discovery.discover_data.reading import files_at
from slosh_msgs_py import topics
from slosh_msgs_py.node.domain import own_domain
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import replay_bag
from slosh_replay.replay.checking import check_result, expectation_of
from slosh_replay.replay.report import Surroundings
from slosh_testing.robot import nodes_and_robot, swing

EVENTS = {"mode": "events", "event_before": "2.0", "event_after": "1.0"}


def finished(folder, name):
    """Whether a bag has been ended: its space in reserve is given up then."""
    bag = folder / name
    return (bag / "metadata.yaml").exists() and not (bag / ".reserve").exists()


@pytest.mark.long
def test_a_bag_round_an_event_replays_bit_for_bit_and_tells_what_happened(tmp_path):
    folder = tmp_path / "events"
    with own_domain() as domain, nodes_and_robot(tmp_path, domain) as (group, robot):
        robot.push = swing(1.0)
        group.start(NodeProcess("recorder", (), {"output": str(folder), **EVENTS}))
        robot.until(lambda: "recorder" in robot.health, "the recorder")
        robot.for_seconds(3.0)
        assert list(folder.iterdir()) == []
        robot.surface.msh = 0.03
        robot.until(lambda: any(folder.iterdir()), "a bag")
        robot.surface.msh = 0.0001
        robot.until(lambda: finished(folder, "0001_limit"), "the end of the bag")
        answer = robot.call(Trigger, topics.KEEP)
        assert answer.success
        kept = Path(answer.message)
        robot.until(lambda: finished(folder, kept.name), "the end of the bag that was asked for")
    for bag in files_at(folder):
        run = RecordedRun(bag)
        result = replay_bag(run)
        found = result.verified
        assert found["estimate"].exact, found["estimate"].lines()
        assert found["estimate"].recorded > 500
        assert found["comparison"].exact, found["comparison"].lines()
        # Nothing in the bag tells the observer's state: that is said, and is no failure.
        assert found["fused_estimate"].recorded == found["fused_estimate"].missing == 0
        assert "not in it" in " ".join(found["fused_estimate"].unchecked)
        assert check_result(result, expectation_of(result)).passed
        assert result.seconds < 30.0
    first = RecordedRun(folder / "0001_limit")
    report = make_report(first, replay_bag(first), Surroundings())
    assert any(note.startswith("event limit at ") for note in report.notes)
    assert kept.name.endswith("_request")


@pytest.mark.long
def test_a_recorder_of_everything_says_that_there_is_nothing_to_ask_for(tmp_path):
    with own_domain() as domain, nodes_and_robot(tmp_path, domain) as (group, robot):
        group.start(NodeProcess("recorder", (), {"output": str(tmp_path / "bag")}))
        robot.until(lambda: "recorder" in robot.health, "the recorder")
        answer = robot.call(Trigger, topics.KEEP)
        assert not answer.success
        assert "recorded already" in answer.message
