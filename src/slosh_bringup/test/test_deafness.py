"""Tests the distinction between a node that cannot receive a topic and a silent publisher."""

import time

import pytest
import rclpy
from rclpy.node import Node

from slosh_bringup.cell_watch import CellWatch, NodeReport
from slosh_bringup.live.deafness import AGAIN, CERTAIN, TRIAL, Deafness
from slosh_bringup.live.run import OtherCells, Supervision
from slosh_bringup.nodes.cell_listener import CellListener
from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_msgs.msg import SloshEstimate
from slosh_msgs_py import qos
from slosh_msgs_py.node.silence import UNHEARD

TOPIC = "/slosh/estimate"
CLAIM = {"monitor": f"{TOPIC} slosh_msgs/msg/SloshEstimate"}


class Listening:
    """Simulated topic with a message rate and a start time, and a count of test subscriptions."""

    def __init__(self, rate, begins=0.0):
        self.rate, self.begins, self.now, self.probes = rate, begins, 0.0, 0

    def __call__(self, topic, type_name):
        listening, started = self, self.now
        self.probes += 1

        class Probe:
            @property
            def count(self):
                heard_since = max(started, listening.begins)
                return max(0, int((listening.now - heard_since) * listening.rate))

            def close(self):
                listening.probes -= 1

        return Probe()

    def found(self, claims_until, until=60):
        """Returns the times at which a node is found unable to receive, checked once a second."""
        deafness, found = Deafness(self), []
        for self.now in map(float, range(until)):
            claims = CLAIM if self.now < claims_until else {}
            found += [(self.now, name) for name in deafness.look(claims, self.now).items()]
        return found


def test_what_others_hear_the_whole_time_is_a_deaf_node_and_it_is_found_once():
    topic = Listening(rate=60.0)
    found = topic.found(claims_until=1e9, until=int(AGAIN) + 5)
    (when, name), *later = found
    assert name == ("monitor", TOPIC)
    assert when == TRIAL + 1.0 + CERTAIN
    assert later == []  # nor soon again, if it stays deaf
    assert topic.found(claims_until=1e9, until=int(2 * AGAIN))[1:]
    assert topic.probes == 0


@pytest.mark.parametrize("begins", [float(second) for second in range(15)])
def test_a_publisher_that_goes_on_makes_nobody_deaf(begins):
    """The node reports missing messages up to a second after the publisher has started."""
    topic = Listening(1000.0, begins)
    assert topic.found(claims_until=begins + 2.0) == []
    assert topic.probes == 0


def test_a_type_that_cannot_be_listened_to_makes_nobody_deaf():
    deafness = Deafness(lambda topic, type_name: None)
    assert [deafness.look(CLAIM, float(now)) for now in range(60)] == [{}] * 60


def test_the_newest_report_says_what_is_not_heard():
    watch = CellWatch(("monitor",), 0.0)
    for facts, unheard in (({}, {}), ({UNHEARD: CLAIM["monitor"]}, CLAIM), ({}, {})):
        watch.take(NodeReport("monitor", 3, "", facts), 1.0)
        assert watch.unheard() == unheard


class Quiet:
    """Ignores all messages, since only topic probes are tested here."""

    def take_comparison(self, comparison):
        pass

    take_report = take_settings = take_comparison


@pytest.fixture
def listener(domain, monkeypatch):
    for name, value in node_environment(domain).items():
        monkeypatch.setenv(name, value)
    with CellListener("/slosh", Quiet()) as listener:
        yield listener


def test_a_node_that_hears_nothing_of_a_topic_is_started_again(listener, tmp_path, domain):
    told = []
    context = rclpy.Context()
    rclpy.init(context=context)
    robot = Node("robot", context=context)
    publisher = robot.create_publisher(SloshEstimate, TOPIC, qos.STREAM_OUT)
    with NodeGroup("/slosh", tmp_path, node_environment(domain)) as group:
        process = NodeProcess("monitor")
        group.start(process)
        before = group.pid("monitor")
        supervision = Supervision(group, [process], told.append, OtherCells())
        deafness, now, deaf = Deafness(listener.probe), 0.0, {}
        deadline = time.monotonic() + 20.0
        while not deaf and time.monotonic() < deadline:
            publisher.publish(SloshEstimate())
            listener.listen(0.01)
            now += 0.05  # a trial lasts long enough on a slow machine, too
            deaf = deafness.look(CLAIM, now)
        assert deaf == {"monitor": TOPIC}
        supervision.end_deaf(deaf)
        while group.pid("monitor") == before:
            assert time.monotonic() < deadline
            supervision.look(began=True, silences={"monitor": 0.0})
            time.sleep(0.02)
    context.try_shutdown()
    deaf = f"node monitor receives nothing on {TOPIC}, although other nodes do: it is killed"
    assert told[0] == deaf
    assert told[1].endswith("it is restarted")


def test_nothing_is_imported_for_a_name_from_the_network(listener):
    assert listener.probe("/topic", "antigravity/msg/Header") is None
    assert listener.probe("/topic", "sensor_msgs/msg/NoSuchThing") is None
    assert listener.probe("/topic", "sensor_msgs") is None
