"""Tests the replay of nodes by the journals of what they took."""

import json
import math
import time
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
import rclpy
from geometry_msgs.msg import AccelStamped, WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.nodes.recorder_node import RecorderNode
from slosh_bag.reader import BagMessage, BagReader
from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_estimator.nodes.monitor_node import MonitorNode
from slosh_estimator.nodes.sensor_node import SensorNode
from slosh_msgs.msg import FreeSurface, Journal, NodeSettings, SloshComparison, SloshEstimate
from slosh_msgs_py import topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.stamps import to_time
from slosh_replay.journaled.outputs import UNTAKEN
from slosh_replay.journaled.replay import CHANGED, NO_ROW, ROWS, replay_journals
from slosh_replay.replay.verification import Tally
from slosh_testing.hearing_robot import Graph
from slosh_testing.journaled import assert_same_by_journal

CUP = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\n"
PAYLOAD = {
    "natural_frequency": {"value": 18.9}, "sloshing_mass": {"value": 0.17},
    "payload_mass": {"value": 1.0, "error": 0.002}, "delay": {"value": 0.0},
    "directions": [{"container": [1, 0, 0], "sensor": [0, -1, 0]}],
    "residual_at_rest": 0.01, "residual_in_motion": 0.02,
}  # fmt: skip
NONE = Tally("none").result()
CELL, STEP_NS, COUNT = "/slosh", 4_000_000, 400
STATE_EVERY = 64
"""Inputs from one state of the estimator to the next."""


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory, domain: int) -> Path:
    """Records estimator, observer, monitor and a force sensor; measured heights come late.

    A request comes between.

    A second process of the estimator takes the place of the first one.
    """
    folder = tmp_path_factory.mktemp("run")
    (folder / "cup.yaml").write_text(CUP)
    rclpy.init()
    graph = Graph("robot", CELL)
    try:
        add = graph.with_parameters
        recorder = add(RecorderNode, CELL, output=str(folder / "bag"))
        add(MonitorNode, CELL, timeout=0.4)
        (folder / "payload.json").write_text(json.dumps(PAYLOAD))
        add(SensorNode, CELL, payload=str(folder / "payload.json"), beside_camera=True)
        for _ in range(2):
            estimator = add(EstimatorNode, CELL, model=str(folder / "cup.yaml"), max_age=600.0)
            _drive(graph)
            graph.executor.remove_node(estimator)
            graph.nodes.remove(estimator)
            estimator.destroy_node()
        _drain(graph)
        recorder.close()
    finally:
        graph.close()
        rclpy.shutdown()
    return folder / "bag"


def _drive(graph: Graph) -> None:
    heard = graph.listen(SloshEstimate, topics.ESTIMATE)
    accel = graph.publisher(AccelStamped, topics.ACCEL)
    graph.until(lambda: accel.get_subscription_count() >= 2, "recorder and estimator")
    surface = graph.publisher(FreeSurface, topics.FREE_SURFACE)
    graph.until(lambda: surface.get_subscription_count() >= 3, "recorder and both nodes")
    force = graph.publisher(WrenchStamped, topics.FORCE)
    graph.until(lambda: force.get_subscription_count() >= 2, "recorder and sensor")
    begin, late = time.time_ns() - COUNT * STEP_NS, []
    for k in range(COUNT):
        stamp = begin + k * STEP_NS
        message = AccelStamped()
        message.header.stamp, message.header.frame_id = to_time(stamp), "world"
        message.accel.linear.x = 2.0 * math.sin(0.1 * k)
        accel.publish(message)
        wrench = WrenchStamped()
        wrench.header.stamp, wrench.wrench.force.y = message.header.stamp, math.sin(0.08 * k)
        force.publish(wrench)
        if k % 5 == 0:
            late.append(filled(
                FreeSurface, stamp_ns=stamp, frame_id="container", msh=2e-3 + 1e-5 * k,
                msh_stddev=1e-3, flags=0,
            ))  # fmt: skip
        if k % 7 == 0 and late:
            surface.publish(late.pop(0))
        if k == COUNT // 2:
            graph.call(Trigger, topics.RESET, Trigger.Request())
        graph.executor.spin_once(timeout_sec=0.001)
    graph.until(lambda: len(heard) >= COUNT, "all estimates")


def _drain(graph: Graph) -> None:
    """Runs the nodes until the recorder has taken what was sent."""
    end = time.monotonic() + 0.3
    graph.until(lambda: time.monotonic() > end)


def copied(bag: Path, target: Path, change: Callable[[int, BagMessage], bytes | None]) -> Path:
    """Writes a copy of a bag with other bytes of messages; None leaves one out."""
    counts: Counter[str] = Counter()
    with BagWriter(target) as writer:
        for message in BagReader(bag).messages():
            data = change(counts[message.topic], message)
            counts[message.topic] += 1
            if data is not None:
                writer.add_topic(message.topic, message.message_type)
                writer.write(message.topic, data, message.log_ns, message.publish_ns)
    return target


def test_what_no_installed_package_replays_is_not_checked_and_named(bag: Path) -> None:
    known = {name: row for name, row in ROWS.items() if name != "monitor"}
    found = replay_journals(bag, rows=known).verified
    assert found[topics.ESTIMATE].exact
    unchecked = found[topics.COMPARISON].unchecked
    assert list(unchecked) == [f"{NO_ROW} monitor"]
    assert unchecked == {f"{NO_ROW} monitor": BagReader(bag).topics()[f"{CELL}/comparison"].count}


def test_each_process_gives_the_same_again(bag: Path) -> None:
    assert_same_by_journal(bag, ("estimator", "monitor", "sensor"))
    found = replay_journals(bag)
    assert [one.node for one in found.processes].count("estimator") == 2
    assert found.verified[topics.ESTIMATE].identical == 2 * COUNT
    for name in (
        topics.ESTIMATE, topics.FUSED_ESTIMATE, topics.CALM, topics.COMPARISON,
        topics.SENSED_SURFACE,
    ):  # fmt: skip
        assert found.verified[name].exact, found.verified[name].lines()


def test_a_monitor_on_simulated_time_gives_the_same_again(tmp_path: Path, domain: int) -> None:
    """The clock begins late, at another time than the steady one, and runs as fast as it can."""
    rclpy.init()
    graph = Graph("robot", CELL)
    try:
        recorder = graph.with_parameters(RecorderNode, CELL, output=str(tmp_path / "bag"))
        graph.with_parameters(MonitorNode, CELL, timeout=0.2, use_sim_time=True)
        heard = graph.listen(SloshComparison, topics.COMPARISON)
        journals = graph.listen(Journal, topics.JOURNAL)
        graph.until(lambda: len(heard) > 2, "comparisons before the clock")
        clock = graph.publisher(Clock, "/clock")
        estimates = graph.publisher(SloshEstimate, topics.ESTIMATE)
        surfaces = graph.publisher(FreeSurface, topics.FREE_SURFACE)
        graph.until(lambda: estimates.get_subscription_count() >= 2, "recorder and monitor")
        graph.until(lambda: surfaces.get_subscription_count() >= 2, "recorder and monitor")
        graph.until(lambda: clock.get_subscription_count() >= 2, "recorder and monitor")
        before = len(heard)
        for k in range(COUNT):
            now = to_time(5 * SECOND + k * STEP_NS)
            clock.publish(Clock(clock=now))
            estimate = SloshEstimate()
            estimate.header.stamp, estimate.nonlinear.msh = now, 3e-3
            estimates.publish(estimate)
            if k % 5 == 0 and k < COUNT // 2:  # later it is blind
                seen = filled(
                    FreeSurface, frame_id="container", msh=2e-3, msh_stddev=1e-3, flags=0
                )
                seen.header.stamp = now
                surfaces.publish(seen)
            graph.executor.spin_once(timeout_sec=0.001)
        graph.until(lambda: len(heard) >= before + COUNT // 10, "comparisons")
        written = len(journals)
        graph.until(lambda: len(journals) > written, "the journal of all that was taken")
        _drain(graph)
        recorder.close()
    finally:
        graph.close()
        rclpy.shutdown()
    compared = replay_journals(tmp_path / "bag").verified[topics.COMPARISON]
    assert compared.exact, compared.lines()
    assert compared.recorded > COUNT // 10


def test_settings_that_the_recorder_heard_seconds_later_are_used(
    bag: Path, tmp_path: Path
) -> None:
    """A recorder finds a latched topic late on a busy machine."""
    late = f"{CELL}/{topics.SETTINGS}"
    with BagWriter(tmp_path / "late") as writer:
        for message in sorted(
            BagReader(bag).messages(),
            key=lambda one: one.log_ns + 5 * SECOND * (one.topic == late),
        ):
            writer.add_topic(message.topic, message.message_type)
            log_ns = message.log_ns + 5 * SECOND * (message.topic == late)
            writer.write(message.topic, message.data, log_ns, message.publish_ns)
    found = replay_journals(tmp_path / "late")
    assert not any(one.lacking for one in found.processes)
    assert found.verified[topics.COMPARISON] == replay_journals(bag).verified[topics.COMPARISON]


def test_a_message_that_was_not_recorded_is_named_and_ends_the_comparison_until_a_state(
    bag: Path, tmp_path: Path
) -> None:
    lost = f"{CELL}/{topics.ACCEL}"
    kept = copied(
        bag, tmp_path / "bag", lambda k, m: None if m.topic == lost and k == 100 else m.data
    )
    found = replay_journals(kept)
    first = next(one for one in found.processes if one.node == "estimator")
    assert first.lacking == f"a message on {lost}"
    compared = found.verified[topics.ESTIMATE]
    assert compared.identical == compared.recorded
    assert not compared.missing
    why = f"{UNTAKEN}, first a message on {lost}"
    assert compared.unchecked == {why: 2 * COUNT - compared.identical}
    assert compared.identical >= 2 * COUNT - STATE_EVERY
    for name in (topics.FUSED_ESTIMATE, topics.CALM, topics.COMPARISON):
        one = found.verified[name]
        assert one.identical == one.recorded, one.lines()
        assert not one.missing, one.lines()
    fused = found.verified[topics.FUSED_ESTIMATE]
    whole = replay_journals(bag).verified[topics.FUSED_ESTIMATE].recorded
    assert sum(fused.unchecked.values()) + fused.recorded == whole
    assert fused.recorded > 0.6 * whole


def test_a_recording_from_the_middle_of_a_run_is_compared_from_the_first_state_on(
    bag: Path, tmp_path: Path
) -> None:
    """Of the first process the recorder missed the first journals, and of all inputs a part."""
    journals = f"{CELL}/{topics.JOURNAL}"
    mine = [m for m in BagReader(bag).messages({journals}) if _journal(m).node == "estimator"]
    lost, accel = mine[0].data, f"{CELL}/{topics.ACCEL}"

    def late(k: int, message: BagMessage) -> bytes | None:
        return (
            None if message.data == lost or (message.topic == accel and k < 40) else message.data
        )

    found = replay_journals(copied(bag, tmp_path / "bag", late))
    first = next(one for one in found.processes if one.node == "estimator")
    assert first.lacking == "the beginning of its journal"
    assert not found.mixed
    for name in (topics.ESTIMATE, topics.FUSED_ESTIMATE, topics.CALM, topics.ESTIMATOR_STATE):
        one = found.verified[name]
        assert one.identical == one.recorded, one.lines()
        assert not one.missing, one.lines()
        assert sum(one.unchecked.values()) > 0
    estimates = found.verified[topics.ESTIMATE]
    assert estimates.recorded > COUNT + 100
    assert estimates.recorded + sum(estimates.unchecked.values()) == 2 * COUNT


def test_messages_of_a_type_that_has_changed_since_are_not_checked_and_counted(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No node is given their bytes, which it would take for others."""
    changed, text = "slosh_msgs/msg/SloshComparison", Definitions.text
    monkeypatch.setattr(
        Definitions, "text", lambda one, kind: text(one, kind) + "x" * (kind == changed)
    )
    found = replay_journals(bag).verified
    count = BagReader(bag).topics()[f"{CELL}/{topics.COMPARISON}"].count
    assert found[topics.COMPARISON].unchecked == {CHANGED: count}
    assert not found[topics.COMPARISON].total
    assert found[topics.ESTIMATE].exact


def test_two_processes_of_one_node_at_once_are_told(bag: Path, tmp_path: Path) -> None:
    """The second one's journals come between those of the first one."""
    journals = f"{CELL}/{topics.JOURNAL}"
    mine = [m for m in BagReader(bag).messages({journals}) if _journal(m).node == "estimator"]
    second = next(k for k, m in enumerate(mine) if k and not _journal(m).first)
    order = [*mine[: second - 1], mine[second], mine[second - 1], *mine[second + 1 :]]
    moved = {one.data: other.data for one, other in zip(mine, order, strict=True)}
    kept = copied(bag, tmp_path / "bag", lambda k, m: moved.get(m.data, m.data))
    assert replay_journals(kept).mixed == ("estimator",)


def test_a_part_of_the_journal_that_was_not_recorded_is_named(bag: Path, tmp_path: Path) -> None:
    journals = f"{CELL}/{topics.JOURNAL}"
    mine = [m for m in BagReader(bag).messages({journals}) if _journal(m).node == "monitor"]
    lost = mine[0].data
    found = replay_journals(
        copied(bag, tmp_path / "bag", lambda k, m: None if m.data == lost else m.data)
    )
    monitor = next(one for one in found.processes if one.node == "monitor")
    assert monitor.lacking == "the beginning of its journal"
    compared = found.verified[topics.COMPARISON]
    assert compared.identical == compared.recorded, compared.lines()
    assert not compared.missing
    assert sum(compared.unchecked.values()) > 0


def test_settings_that_a_node_cannot_have_had_are_told_and_end_nothing(
    bag: Path, tmp_path: Path
) -> None:
    """A stranger may publish what it likes; the other nodes are replayed all the same."""

    def forged(_: int, message: BagMessage) -> bytes:
        if not message.topic.endswith(topics.SETTINGS):
            return message.data
        settings = deserialize_message(message.data, NodeSettings)
        if settings.node == "monitor":
            settings.document = "{parameters: {timeout: none}, files: {}}"
        return bytes(serialize_message(settings))

    found = replay_journals(copied(bag, tmp_path / "bag", forged))
    monitor = next(one for one in found.processes if one.node == "monitor")
    assert monitor.lacking.startswith("usable settings: ")
    assert found.verified[topics.ESTIMATE].exact
    assert not found.verified.get(topics.COMPARISON, NONE).recorded


def test_another_order_gives_other_estimates(bag: Path, tmp_path: Path) -> None:
    """The comparison fails where the order in which a node took its inputs is not kept."""
    journals = f"{CELL}/{topics.JOURNAL}"

    def swapped(_: int, message: BagMessage) -> bytes:
        if message.topic != journals:
            return message.data
        journal = deserialize_message(message.data, Journal)
        accel = [k for k, name in enumerate(journal.sources) if name.endswith(topics.ACCEL)]
        rows = [k for k, source in enumerate(journal.source) if source in accel]
        for a, b in pairwise(rows[:20:2]):
            check = journal.check
            check[a], check[b] = check[b], check[a]
        return bytes(serialize_message(journal))

    found = replay_journals(copied(bag, tmp_path / "bag", swapped)).verified[topics.ESTIMATE]
    assert found.identical < found.recorded + found.missing
    assert found.first is not None


def _journal(message: BagMessage) -> Journal:
    return deserialize_message(message.data, Journal)
