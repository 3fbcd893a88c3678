"""The recorder node over DDS: every byte, late joiners, publishers that offer different things."""

import time

import pytest
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSDurabilityPolicy as Durability
from rclpy.qos import QoSProfile
from rclpy.qos import QoSReliabilityPolicy as Reliability
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

from slosh_bag.errors import SloshBagError
from slosh_bag.nodes.recorder_node import RecorderNode, matching
from slosh_bag.reader import BagReader
from slosh_msgs.msg import FreeSurface, LimitEvent
from slosh_msgs_py import qos
from slosh_msgs_py.node.run import make_executor

DOMAIN = "31"
PATIENCE = 20.0
BEST_EFFORT = QoSProfile(depth=10, reliability=Reliability.BEST_EFFORT)


class Graph:
    """A recorder and a node that publishes, in one executor."""

    def __init__(self, folder):
        rclpy.init()
        self.folder = folder
        self.node = Node("talker")
        self.executor = make_executor()
        self.executor.add_node(self.node)
        self.recorder = None

    def record(self, **parameters):
        given = {"output": str(self.folder), "topics": "^/tested", **parameters}
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        # The node takes its parameters from the command line: they come as overrides here.
        original = Node.__init__

        def start(node, name, **options):
            original(node, name, parameter_overrides=overrides, **options)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Node, "__init__", start)
            self.recorder = RecorderNode()
        self.executor.add_node(self.recorder)

    def until(self, condition):
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, "what was awaited did not come"
            self.executor.spin_once(timeout_sec=0.05)

    def publisher(self, kind, topic, profile=qos.STREAM_OUT):
        publisher = self.node.create_publisher(kind, topic, profile)
        self.until(lambda: publisher.get_subscription_count() > 0)
        return publisher

    def recorded(self, topic):
        return self.recorder._core.status().written.get(topic, 0)

    def finish(self):
        self.recorder.close()
        return list(BagReader(self.folder).messages())

    def close(self):
        for node in (self.node, self.recorder):
            if node is not None:
                self.executor.remove_node(node)
                node.destroy_node()
        rclpy.shutdown()


@pytest.fixture(params=["events", "single"])
def graph(request, tmp_path, monkeypatch):
    monkeypatch.setenv("SLOSH_EXECUTOR", request.param)
    monkeypatch.setenv("ROS_DOMAIN_ID", DOMAIN)
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    graph = Graph(tmp_path / "bag")
    yield graph
    graph.close()


def test_every_message_is_recorded_byte_for_byte(graph):
    graph.record()
    publisher = graph.publisher(FreeSurface, "/tested/surface")
    messages = [FreeSurface(msh=0.001 * n, profile_height=[float(n)] * n) for n in range(300)]
    for message in messages:
        publisher.publish(message)
    graph.until(lambda: graph.recorded("/tested/surface") == len(messages))
    recorded = graph.finish()
    assert [m.data for m in recorded] == [serialize_message(m) for m in messages]
    assert {m.message_type for m in recorded} == {"slosh_msgs/msg/FreeSurface"}


def test_latched_messages_from_before_the_start_are_recorded(graph):
    publisher = graph.node.create_publisher(LimitEvent, "/tested/event", qos.EVENT)
    publisher.publish(LimitEvent(id=7))
    graph.record()
    graph.until(lambda: graph.recorded("/tested/event") == 1)
    (message,) = graph.finish()
    assert BagReader(graph.folder).decode(message).id == 7


def test_a_later_publisher_that_offers_less_is_recorded_too(graph):
    graph.record()
    first = graph.publisher(Header, "/tested/header")
    first.publish(Header(frame_id="reliable"))
    graph.until(lambda: graph.recorded("/tested/header") == 1)
    second = graph.publisher(Header, "/tested/header", BEST_EFFORT)
    second.publish(Header(frame_id="best effort"))
    graph.until(lambda: graph.recorded("/tested/header") == 2)
    graph.until(lambda: first.get_subscription_count() > 0)
    first.publish(Header(frame_id="reliable again"))
    graph.until(lambda: graph.recorded("/tested/header") == 3)
    reader = BagReader(graph.folder)
    frames = [reader.decode(message).frame_id for message in graph.finish()]
    assert frames == ["reliable", "best effort", "reliable again"]


def test_only_what_was_asked_for_is_recorded(graph):
    graph.record(exclude="secret")
    secret = graph.node.create_publisher(Header, "/tested/secret", qos.STREAM_OUT)
    other = graph.node.create_publisher(Header, "/other", qos.STREAM_OUT)
    wanted = graph.publisher(Header, "/tested/header")
    for publisher in (secret, other, wanted):
        publisher.publish(Header(frame_id="x"))
    graph.until(lambda: graph.recorded("/tested/header") == 1)
    assert {message.topic for message in graph.finish()} == {"/tested/header"}
    assert secret.get_subscription_count() == other.get_subscription_count() == 0


def test_a_pattern_that_is_none_is_named(graph):
    with pytest.raises(SloshBagError, match=r"parameter topics = '\['"):
        graph.record(topics="[")


@pytest.mark.parametrize(
    ("offered", "reliability", "durability"),
    [
        ([qos.STREAM_OUT], Reliability.RELIABLE, Durability.VOLATILE),
        ([qos.EVENT], Reliability.RELIABLE, Durability.TRANSIENT_LOCAL),
        ([qos.EVENT, qos.STREAM_OUT], Reliability.RELIABLE, Durability.VOLATILE),
        ([qos.EVENT, BEST_EFFORT], Reliability.BEST_EFFORT, Durability.VOLATILE),
        ([], Reliability.BEST_EFFORT, Durability.VOLATILE),
    ],
)
def test_the_most_that_all_publishers_offer_is_asked_for(offered, reliability, durability):
    profile = matching(offered)
    assert (profile.reliability, profile.durability) == (reliability, durability)
    assert profile.depth >= 1000
