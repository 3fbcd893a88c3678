"""Tests the player node over DDS: all bytes in order, /clock and latched topics."""

import re
import time

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import AccelStamped
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy as Reliability
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock

from slosh_bag.bag_writer import BagWriter, Qos
from slosh_bag.nodes.player_node import PlayerNode
from slosh_bag.nodes.player_thread import PlayerThread
from slosh_bag.playing.play_plan import PlayRequest, make_plan
from slosh_bag.playing.playback import PlaybackSettings
from slosh_bag.reader import BagReader
from slosh_estimator.estimator import Estimator
from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_model.model_text import read_model
from slosh_motion.inputs.sampling import Sample
from slosh_msgs.msg import LimitEvent, SloshEstimate
from slosh_msgs_py import qos
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.hearing_robot import Graph

PATIENCE = 30.0
BEGIN = 1_700_000_000_123_456_789


DEEP = QoSProfile(depth=20_000, reliability=Reliability.RELIABLE)
MODEL = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07, rim_height: 0.1}
damping_ratio: auto
effects: [{name: vertical_acceleration}]
"""


def acceleration(t):
    """Returns a fast move along x and a slower one along y [m/s²]."""
    return 4.0 * np.sin(9.0 * t) * np.exp(-t), 1.5 * np.sin(5.0 * t), 0.5 * np.cos(7.0 * t)


def write_bag(folder, prefix, seconds=1.0, rate=1000.0):
    """Writes a bag with accelerations and two latched events."""
    with BagWriter(folder) as writer:
        accel, event = f"{prefix}/accel", f"{prefix}/limit_event"
        writer.add_topic(accel, "geometry_msgs/msg/AccelStamped")
        writer.add_topic(
            event, "slosh_msgs/msg/LimitEvent", Qos(durability="transient_local", depth=5)
        )
        for k in range(round(seconds * rate)):
            stamp = BEGIN + round(k * 1e9 / rate)
            message = AccelStamped()
            message.header.stamp, message.header.frame_id = to_time(stamp), "world"
            vector = message.accel.linear
            vector.x, vector.y, vector.z = (float(value) for value in acceleration(k / rate))
            # As in a recording: it was received a moment after its stamp.
            writer.write(accel, serialize_message(message), stamp + 100_000)
            if k in (20, 60):
                writer.write(event, serialize_message(LimitEvent(id=k)), stamp + 200_000)
    return folder


class Players(Graph):
    """A listening node and a player process, with unique topics for this test."""

    def __init__(self, prefix):
        rclpy.init()
        super().__init__("listener")
        self.prefix = prefix

    def with_parameters(self, make, namespace=None, **given):
        return super().with_parameters(make, namespace or self.prefix, **given)

    def play(self, folder, **given):
        plan = make_plan(PlayRequest(folder, PlaybackSettings(**given)))
        return self.with_parameters(lambda: PlayerNode(plan), patience=PATIENCE)

    def listen(self, kind, topic, profile=DEEP, raw=False):
        return super().listen(kind, topic, profile, raw=raw)

    def close(self):
        for node in self.nodes:
            if isinstance(node, PlayerNode):
                node.close()
        super().close()
        rclpy.shutdown()


@pytest.fixture
def prefix(request):
    return "/" + re.sub(r"\W+", "_", request.node.name).strip("_")


@pytest.fixture
def graph(prefix):
    graph = Players(prefix)
    yield graph
    graph.close()


@pytest.mark.first(1)
@pytest.mark.parametrize("rate", [0.5, 1.0, 20.0])
def test_every_message_arrives_as_it_was_in_order_and_with_it_the_time(
    graph, prefix, tmp_path, rate
):
    folder = write_bag(tmp_path / "bag", prefix, seconds=0.4 * max(rate, 1.0) ** 0.5)
    stored = list(BagReader(folder).messages())
    accel = graph.listen(AccelStamped, f"{prefix}/accel", raw=True)
    events = graph.listen(LimitEvent, f"{prefix}/limit_event", raw=True)
    times = graph.listen(Clock, "/clock")
    player = graph.play(folder, rate=rate)
    graph.until(lambda: player.finished)
    graph.until(lambda: len(accel) + len(events) == len(stored))
    assert accel == [m.data for m in stored if m.topic.endswith("accel")]
    assert events == [m.data for m in stored if m.topic.endswith("event")]
    said = [to_nanoseconds(message.clock) for message in times]
    assert said == sorted(said)
    # Who comes while the player waits is told the time at once.
    assert said[0] == stored[0].log_ns
    assert said[-1] == stored[-1].log_ns
    assert not player.failure


def test_a_late_joiner_gets_what_is_latched(graph, prefix, tmp_path):
    folder = write_bag(tmp_path / "bag", prefix, seconds=0.2)
    graph.listen(AccelStamped, f"{prefix}/accel")
    player = graph.play(folder, loop=True)
    graph.until(lambda: player.played > 0.1)
    events = graph.listen(LimitEvent, f"{prefix}/limit_event", qos.EVENT)
    graph.until(lambda: len(events) >= 2)
    assert [event.id for event in events[:2]] == [20, 60]


def test_it_waits_for_as_many_subscribers_as_it_is_told_to(graph, prefix, tmp_path):
    folder = write_bag(tmp_path / "bag", prefix, seconds=0.05)
    plan = make_plan(PlayRequest(folder))
    first = graph.listen(AccelStamped, f"{prefix}/accel")
    player = graph.with_parameters(lambda: PlayerNode(plan), subscribers=2, patience=PATIENCE)
    graph.until(lambda: player._thread._subscribers() == 1)
    ready = time.monotonic() + 0.8  # longer than one subscriber would have to be there
    graph.until(lambda: time.monotonic() > ready)
    assert not player._thread.began_ns
    second = graph.listen(AccelStamped, f"{prefix}/accel")
    graph.until(lambda: player.finished)
    graph.until(lambda: len(first) == len(second) == 50)


@pytest.mark.long
def test_an_estimator_on_the_bags_time_gives_the_cores_own_numbers(graph, prefix, tmp_path):
    # As many samples as its queue holds: not even a machine that stands still loses one.
    rate, seconds = 333.0, 3.0
    folder = write_bag(tmp_path / "bag", prefix, seconds, rate)
    model = tmp_path / "model.yaml"
    model.write_text(MODEL)
    node = graph.with_parameters(
        EstimatorNode, model=str(model), use_sim_time=True, max_age=60.0, max_gap=0.1
    )
    estimates = graph.listen(SloshEstimate, f"{prefix}/estimate")
    player = graph.play(folder, rate=5.0)
    graph.until(lambda: player.finished)
    graph.until(lambda: len(estimates) == round(rate * seconds))
    core = Estimator(read_model(model))
    for k, estimate in enumerate(estimates):
        stamp = BEGIN + round(k * 1e9 / rate)
        ax, ay, az = (float(value) for value in acceleration(k / rate))
        expected = core.update(Sample(stamp, ax, ay, az, 0.0, k == 0))
        assert to_nanoseconds(estimate.header.stamp) == stamp
        for name in ("linear", "nonlinear"):
            got, wanted = getattr(estimate, name), getattr(expected, name)
            for field in ("msh", "azimuth", "sh_x", "sh_y"):
                assert getattr(got, field) == getattr(wanted, field), (k, name, field)
        assert estimate.flags == expected.flags
        assert (estimate.samples_used, estimate.samples_dropped) == (k + 1, 0)
    assert max(estimate.nonlinear.msh for estimate in estimates) > 1e-3
    # Its clock is the bag's: an age is one of bag time, not the years since the recording.
    assert node.get_clock().now().nanoseconds == player._plan.playback.last_ns
    median, greatest = node._report.latency_percentiles()
    assert 0.0 <= median <= greatest < 60.0


# --- the thread alone ----------------------------------------------------------------------------


class FakePublisher:
    """Records what is published, and when."""

    def __init__(self, name, out, subscribers=1):
        self.name, self.out, self.subscribers = name, out, subscribers

    def publish(self, message):
        if isinstance(message, Clock):
            self.out.append(to_nanoseconds(message.clock))
        else:
            self.out.append((self.name, message))

    def get_subscription_count(self):
        return self.subscribers

    def wait_for_all_acked(self, timeout):
        return True


def run_thread(plan, subscribers=1):
    out, warnings = [], []
    publishers = {topic: FakePublisher(topic, out, subscribers) for topic in plan.topics}
    thread = PlayerThread(plan, publishers, FakePublisher("/clock", out), warnings.append)
    thread.start(1, PATIENCE if subscribers else 0.0)
    deadline = time.monotonic() + PATIENCE
    while not thread.finished:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    thread.stop()
    return thread, out, warnings


def test_a_damaged_bag_ends_it_with_one_line(tmp_path):
    folder = write_bag(tmp_path / "bag", "/x", 0.05)
    plan = make_plan(PlayRequest(folder))
    file = folder / "bag_0.mcap"
    data = bytearray(file.read_bytes())
    data[len(data) // 4] ^= 0xFF
    file.write_bytes(data)
    thread, _, _ = run_thread(plan)
    assert "damaged" in thread.failure
    assert "\n" not in thread.failure


def test_of_a_cut_bag_is_played_what_is_there(tmp_path):
    folder = write_bag(tmp_path / "bag", "/x", 0.05)
    file = folder / "bag_0.mcap"
    data = file.read_bytes()
    file.write_bytes(data[: data.rindex(b"/x/accel")])  # in the index behind the only chunk
    plan = make_plan(PlayRequest(folder))
    thread, _, warnings = run_thread(plan)
    assert thread.count == 51
    assert len(plan.warnings) == 1  # said once, at the start
    assert "cut off" in plan.warnings[0]
    assert not warnings


# --- the program ---------------------------------------------------------------------------------
