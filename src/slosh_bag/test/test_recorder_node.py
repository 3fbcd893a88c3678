"""Tests the recorder node over DDS: all bytes, late joiners and publishers' QoS."""

import itertools
import os
import random
import re
import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy as Reliability
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage, Image, PointCloud2
from std_msgs.msg import Header

from slosh_bag.nodes.recorder_node import RecorderNode
from slosh_bag.nodes.topic_input import Received
from slosh_bag.reader import BagReader
from slosh_motion.recorded.sources import shared_topics_line
from slosh_msgs.msg import FreeSurface, LimitEvent, NodeSettings, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.diagnostics import WARN
from slosh_msgs_py.node.readiness import RECORDED
from slosh_testing.hearing_robot import Graph

DATA = serialize_message(FreeSurface())
BEST_EFFORT = QoSProfile(depth=10, reliability=Reliability.BEST_EFFORT)


class Recording(Graph):
    """A recorder and a publishing node, with unique topics for this test."""

    def __init__(self, folder, prefix):
        rclpy.init()
        super().__init__("talker")
        self.folder, self.prefix, self.recorder = folder, prefix, None

    def record(self, **parameters):
        given = {"output": str(self.folder), "topics": f"^{self.prefix}", **parameters}
        self.recorder = self.with_parameters(RecorderNode, **given)

    def silent_publisher(self, kind, topic, profile=qos.STREAM_OUT):
        return self.node.create_publisher(kind, f"{self.prefix}/{topic}", profile)

    def publisher(self, kind, topic, profile=qos.STREAM_OUT):
        return super().publisher(kind, f"{self.prefix}/{topic}", profile)

    def recorded(self, topic):
        return self.recorder._core.status().written.get(f"{self.prefix}/{topic}", 0)

    def finish(self):
        """Returns the messages of the finished bag, raw and decoded."""
        self.recorder.close()
        reader = BagReader(self.folder)
        messages = [m for m in reader.messages() if m.topic.startswith(self.prefix)]
        return messages, [reader.decode(message) for message in messages]

    def close(self):
        super().close()
        rclpy.shutdown()


@pytest.fixture(params=["events", pytest.param("single", marks=pytest.mark.long)])
def graph(request, tmp_path, monkeypatch):
    monkeypatch.setenv("SLOSH_EXECUTOR", request.param)
    graph = Recording(tmp_path / "bag", "/" + re.sub(r"\W", "_", request.node.name))
    yield graph
    graph.close()


def test_every_message_is_recorded_byte_for_byte(graph):
    graph.record()
    publisher = graph.publisher(FreeSurface, "surface")
    # What another raw reader gets: the padding between fields is whatever the sender had there.
    heard = []
    graph.node.create_subscription(
        FreeSurface, publisher.topic_name, heard.append, qos.STREAM_OUT, raw=True
    )
    graph.until(lambda: publisher.get_subscription_count() == 2)
    for number in range(300):
        heights = [float(number)] * number
        publisher.publish(FreeSurface(msh=0.001 * number, profile_height=heights))
    graph.until(lambda: graph.recorded("surface") == len(heard) == 300)
    recorded, contents = graph.finish()
    assert [message.data for message in recorded] == heard
    assert [content.msh for content in contents] == [0.001 * number for number in range(300)]
    assert {message.message_type for message in recorded} == {"slosh_msgs/msg/FreeSurface"}


def test_latched_messages_from_before_the_start_are_recorded(graph):
    publisher = graph.silent_publisher(LimitEvent, "event", qos.EVENT)
    publisher.publish(LimitEvent(id=7))
    graph.record()
    graph.until(lambda: graph.recorded("event") == 1)
    _, (event,) = graph.finish()
    assert event.id == 7


def test_what_comes_while_the_topics_are_taken_is_recorded_in_the_order_in_which_it_came(graph):
    """On a slow machine, messages keep arriving while the topics are polled."""
    graph.record()
    publishers = [graph.publisher(FreeSurface, name) for name in ("first", "second")]
    now = time.time_ns()
    came = {publisher.topic_name: [] for publisher in publishers}
    for k in range(60):  # one every 50 ms on each topic, for 3 s from now on
        for publisher in publishers:
            arrived = now + 50_000_000 * k + 1000 * len(came[publisher.topic_name])
            came[publisher.topic_name].append(arrived)

    class Slow:
        """Wraps a topic input so that messages up to a moment during polling are taken."""

        def __init__(self, entry, passes):
            self.entry, self.passes, self.given = entry, passes, 0

        def take(self, give):
            until = now + self.passes.pop(0)
            times = came[self.entry.topic]
            while self.given < len(times) and times[self.given] <= until:
                arrived = times[self.given]
                give(Received(arrived, arrived, self.entry.topic, DATA))
                self.given += 1

        def __getattr__(self, name):
            return getattr(self.entry, name)

    s = 10**9
    passes = {
        publishers[0].topic_name: [0, 2 * s, 9 * s],
        publishers[1].topic_name: [s, 3 * s, 9 * s],
    }
    inputs = graph.recorder._inputs
    for topic, moments in passes.items():
        inputs[topic] = Slow(inputs[topic], moments)
    graph.recorder._take()
    graph.recorder._take()
    recorded, _ = graph.finish()
    assert [m.publish_ns for m in recorded] == sorted(itertools.chain(*came.values()))


def test_it_tells_at_once_whose_settings_it_has(graph):
    """Other processes that wait for settings must not wait for the periodic diagnostics."""
    said = []
    graph.node.create_subscription(DiagnosticArray, "/diagnostics", said.append, qos.DIAGNOSTICS)
    graph.record(topics=".*/settings$")

    def told():
        return [
            value.value
            for array in said
            for status in array.status
            for value in status.values
            if value.key == RECORDED
        ]

    graph.until(lambda: "" in told())
    for node in ("monitor", "camera"):
        publisher = graph.silent_publisher(NodeSettings, "settings", qos.EVENT)
        publisher.publish(NodeSettings(node=node))
    graph.until(lambda: "camera, monitor" in told())


def test_a_later_publisher_that_offers_less_is_recorded_too(graph):
    graph.record()
    first = graph.publisher(Header, "header")
    first.publish(Header(frame_id="reliable"))
    graph.until(lambda: graph.recorded("header") == 1)
    second = graph.publisher(Header, "header", BEST_EFFORT)
    second.publish(Header(frame_id="best effort"))
    graph.until(lambda: graph.recorded("header") == 2)
    graph.until(lambda: first.get_subscription_count() > 0)
    first.publish(Header(frame_id="reliable again"))
    graph.until(lambda: graph.recorded("header") == 3)
    _, contents = graph.finish()
    frames = [content.frame_id for content in contents]
    assert frames == ["reliable", "best effort", "reliable again"]


def test_a_lost_publisher_is_named_and_recorded_again_when_it_is_back(graph):
    graph.record()
    first = graph.publisher(Header, "header")
    other = graph.publisher(Header, "other")
    first.publish(Header(frame_id="first"))
    graph.until(lambda: graph.recorded("header") == 1)
    topic = first.topic_name
    graph.node.destroy_publisher(first)
    graph.until(lambda: graph.recorder._absent())
    level, sentence = graph.recorder._health()
    assert (level, list(graph.recorder._absent())) == (WARN, [topic])
    assert re.search(rf"publisher lost: {topic} \(for \d+ s\)", sentence)
    assert other.topic_name not in sentence
    assert graph.recorder._facts()["topics without a publisher"] == topic
    second = graph.publisher(Header, "header", BEST_EFFORT)
    graph.until(lambda: not graph.recorder._absent())
    second.publish(Header(frame_id="second"))
    graph.until(lambda: graph.recorded("header") == 2)
    graph.node.destroy_publisher(second)
    graph.until(lambda: graph.recorder._absent())
    # What it latched before the recorder found it comes too.
    third = graph.silent_publisher(Header, "header", qos.EVENT)
    third.publish(Header(frame_id="third"))
    graph.until(lambda: graph.recorded("header") == 3)
    _, contents = graph.finish()
    assert [content.frame_id for content in contents] == ["first", "second", "third"]


def test_latched_messages_of_a_late_joiner_are_recorded_once(graph):
    graph.record()
    early = graph.silent_publisher(LimitEvent, "event", qos.EVENT)
    early.publish(LimitEvent(id=1))
    graph.until(lambda: graph.recorded("event") == 1)
    late = graph.silent_publisher(LimitEvent, "event", qos.EVENT)
    late.publish(LimitEvent(id=2))
    graph.until(lambda: graph.recorded("event") == 2)
    early.publish(LimitEvent(id=3))
    graph.until(lambda: graph.recorded("event") == 3)
    _, events = graph.finish()
    assert [event.id for event in events] == [1, 2, 3]
    # Latched messages of which only the last were kept are not lost ones.
    assert not graph.recorder._lost_on_the_way()


def test_two_that_speak_where_one_may_are_told_and_noted(graph):
    graph.record()
    both = [graph.publisher(FreeSurface, "surface") for _ in range(2)]
    topic = both[0].topic_name
    graph.until(lambda: len(graph.recorder._inputs[topic]._known) == 2)
    for number in range(20):
        both[number % 2].publish(FreeSurface(msh=0.001))
        graph.until(lambda n=number: graph.recorded("surface") == n + 1)
    level, sentence = graph.recorder._health()
    assert level == WARN
    assert f"several publishers on {topic}" in sentence
    assert "several" not in graph.recorder._health()[1]
    graph.finish()
    line = shared_topics_line(BagReader(graph.folder).metadata())
    assert line.startswith(f"several publishers were mixed on {topic} (of 2 x /talker), ")


def test_a_bag_is_split_as_the_parameters_say(graph):
    graph.record(max_bag_size=20_000)
    publisher = graph.publisher(FreeSurface, "surface")
    rng = random.Random(1)
    for number in range(2):
        heights = [rng.random() for _ in range(5000)]
        publisher.publish(FreeSurface(msh=float(number), profile_height=heights))
        graph.until(lambda n=number: graph.recorded("surface") == n + 1)
        graph.until(lambda: graph.recorder._core.status().age == 0.0)
    _, contents = graph.finish()
    assert [content.msh for content in contents] == [0.0, 1.0]
    assert len(list(graph.folder.glob("bag_?.mcap"))) == 2


class Cell:
    """A cell in its own namespace with renamed camera and input topics."""

    def __init__(self, graph):
        self.graph, self.namespace = graph, f"{graph.prefix}/cell"
        self.node = Node("estimator", namespace=self.namespace)
        graph.executor.add_node(self.node)
        self.settings = self.node.create_publisher(NodeSettings, "settings", qos.EVENT)
        self.settings.publish(NodeSettings(node="estimator"))

    def read(self, kind, topic):
        return self.node.create_subscription(kind, topic, lambda _: None, qos.STREAM_IN)

    def record(self, **parameters):
        self.graph.record(topics="", namespace=self.namespace, **parameters)

    def recorded(self):
        return set(self.graph.recorder._inputs)

    def close(self):
        self.graph.executor.remove_node(self.node)
        self.node.destroy_node()


@pytest.fixture
def cell(graph):
    cell = Cell(graph)
    yield cell
    cell.close()


def test_by_default_a_cells_own_topics_and_its_inputs_are_recorded(graph, cell):
    other = graph.silent_publisher(FreeSurface, "other_cell/free_surface")
    robot = graph.silent_publisher(AccelStamped, "robot/acceleration")
    cell.read(AccelStamped, robot.topic_name)
    points = graph.silent_publisher(PointCloud2, "cell/camera/points")
    own = cell.node.create_publisher(SloshEstimate, "estimate", qos.STREAM_OUT)
    cell.record()
    wanted = {own.topic_name, robot.topic_name, cell.settings.topic_name, "/diagnostics"}
    graph.until(lambda: cell.recorded() == wanted)
    robot.publish(AccelStamped())
    graph.until(lambda: graph.recorded("robot/acceleration") == 1)
    assert other.get_subscription_count() == points.get_subscription_count() == 0
    facts = graph.recorder._facts()
    assert robot.topic_name in facts["recorded [kB/s]"]
    assert other.topic_name in facts["left out"]
    # A subscriber that has ended costs nothing: it may come back.
    cell.close()
    graph.recorder._discover()
    assert robot.topic_name in cell.recorded()


def test_raw_images_are_recorded_where_there_are_no_compressed_ones(graph, cell):
    raw = cell.node.create_publisher(Image, "camera/image_raw", qos.IMAGE_OUT)
    cell.record()
    graph.until(lambda: raw.topic_name in cell.recorded())
    graph.until(lambda: raw.get_subscription_count() == 1)
    raw.publish(Image(width=3))
    graph.until(lambda: graph.recorded("cell/camera/image_raw") == 1)
    # Compressed ones come later.
    small = cell.node.create_publisher(CompressedImage, f"{raw.topic_name}/compressed", 10)
    graph.until(lambda: small.topic_name in cell.recorded())
    assert raw.topic_name not in cell.recorded()
    reason = f"{raw.topic_name}: {small.topic_name} is recorded, with the same images"
    assert reason in graph.recorder._facts()["left out"]
    graph.until(lambda: raw.get_subscription_count() == 0)
    # And go again.
    cell.node.destroy_publisher(small)
    graph.until(lambda: raw.get_subscription_count() == 1)
    raw.publish(Image(width=4))
    graph.until(lambda: graph.recorded("cell/camera/image_raw") == 2)
    recorded, contents = graph.finish()
    images = [topic == raw.topic_name for topic in (m.topic for m in recorded)]
    widths = [content.width for content, own in zip(contents, images, strict=True) if own]
    assert widths == [3, 4]


def test_old_bags_of_earlier_runs_are_deleted_and_told(graph, tmp_path):
    runs = tmp_path / "cell"
    old = runs / "2026-01-01T10-00-00" / "bag"
    old.mkdir(parents=True)
    (old / "bag_0.mcap").write_bytes(bytes(5_000_000))
    os.utime(old / "bag_0.mcap", (time.time() - 9 * 86400.0,) * 2)
    (runs / "2026-01-10T10-00-00").mkdir()
    told = graph.listen(DiagnosticArray, topics.DIAGNOSTICS, qos.DIAGNOSTICS)
    graph.folder = runs / "2026-01-10T10-00-00" / "bag"
    graph.record(store_days=7.0)

    def facts():
        found = [one for array in told for one in array.status if one.name == "/recorder"]
        return {pair.key: pair.value for pair in found[-1].values} if found else {}

    graph.until(lambda: facts().get("deleted bags") == "1", "the deletion")
    assert not old.exists()
    assert graph.folder.is_dir()
    graph.recorder.close()
