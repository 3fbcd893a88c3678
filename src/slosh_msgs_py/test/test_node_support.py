"""Tests the common parts of nodes: parameters, diagnostics, start and end of the process."""

import os
import re
import signal
import subprocess
import sys
import time
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from slosh_msgs_py import qos, topics
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.node.diagnostics import ERROR, OK, STALE, WARN, DiagnosticsReporter
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.rivals import AGAIN, Rivals
from slosh_msgs_py.node.run import make_executor
from slosh_msgs_py.node.silence import LONG, UNHEARD, SilentTopic

SPECS = (
    ParameterSpec("size", 1.0, "size [m]", (0.0, 2.0), read_only=False),
    ParameterSpec("count", 3, "count", (1, 5), read_only=False),
    ParameterSpec("kind", "a", "kind", choices=("a", "b"), read_only=False),
    ParameterSpec("place", [0.0, 0.0], "place [m]", (-1.0, 1.0), length=2, read_only=False),
    ParameterSpec("fixed", 1.0, "fixed"),
)


@pytest.fixture
def make_node():
    rclpy.init()
    nodes = []

    def make(**overrides):
        given = [Parameter(name, value=value) for name, value in overrides.items()]
        nodes.append(GuardedNode("tested", parameter_overrides=given))
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()
    rclpy.shutdown()


def spin_until(node, condition, patience=20.0):
    executor = make_executor()
    executor.add_node(node)
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline, "what was awaited did not come"
        executor.spin_once(timeout_sec=0.05)
    executor.remove_node(node)
    executor.shutdown()


def test_integers_are_taken_for_floats(make_node):
    """YAML files and `ros2 param set` write whole numbers as integers."""
    node = make_node(size=1, place=[0, 1])
    values = declare(node, SPECS)
    assert (values["size"], values["place"]) == (1.0, [0.0, 1.0])
    assert [type(value) for value in (values["size"], *values["place"])] == [float] * 3
    changes = []
    node.add_post_set_parameters_callback(changes.extend)
    results = node.set_parameters([Parameter("size", value=2), Parameter("place", value=[1, -1])])
    assert all(result.successful for result in results)
    assert [change.type_ for change in changes] == [
        Parameter.Type.DOUBLE,
        Parameter.Type.DOUBLE_ARRAY,
    ]
    assert node.get_parameter("size").value == 2.0
    assert list(node.get_parameter("place").value) == [1.0, -1.0]


def test_a_parameter_that_nobody_has_is_named(make_node, capfd):
    declare(make_node(size=1.5, sise=1.0, use_sim_time=False), SPECS)
    said = capfd.readouterr().err
    assert "parameter sise is unknown to this node" in said
    assert said.count("is unknown to this node") == 1


@pytest.mark.parametrize(
    ("override", "match"),
    [
        ({"size": 5.0}, r"size = 5.0 must lie in \[0, 2\]"),
        ({"size": 5}, r"size = 5.0 must lie in \[0, 2\]"),
        ({"size": "big"}, "size = 'big': type double is needed, not string"),
        ({"size": True}, "size = True: type double is needed, not bool"),
        ({"size": [1]}, r"size = \[1\]: type double is needed, not integer array"),
        ({"count": 3.0}, "count = 3.0: type integer is needed, not double"),
        ({"kind": 1}, "kind = 1: type string is needed, not integer"),
        ({"size": None}, "size has no value: type double is needed"),
        ({"place": 1}, "place = 1: type double array is needed, not integer"),
        ({"place": ["0", "1"]}, "place = .*: type double array is needed, not string array"),
        ({"place": [0, 5]}, r"place = .* must lie in \[-1, 1\]"),
        ({"place": [0]}, "place = .* must have 2 numbers"),
        ({"count": 9}, r"count = 9 must lie in \[1, 5\]"),
        ({"kind": "c"}, "kind = 'c' must be one of a, b"),
        ({"place": [0.0]}, "place = .* must have 2 numbers"),
        ({"place": [0.0, 5.0]}, r"place = .* must lie in \[-1, 1\]"),
    ],
)
def test_a_bad_start_value_is_refused_with_the_reason(make_node, override, match):
    with pytest.raises(SloshMessageError, match=match) as caught:
        declare(make_node(**override), SPECS)
    assert "\n" not in str(caught.value)


def test_a_callback_that_fails_loses_its_message_and_nothing_else(make_node, capfd):
    node = make_node()
    reports, heard = [], []
    node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, reports.append, 10)
    DiagnosticsReporter(node, lambda: (OK, "well"))
    publisher = node.create_publisher(Header, "words", qos.EVENT)

    def hear(message):
        heard.append(1 / (message.stamp.sec - 3))

    node.create_subscription(Header, "words", hear, qos.EVENT)
    node.create_service(Trigger, "ask", lambda request, response: heard[99])
    client = node.create_client(Trigger, "ask")
    for number in range(6):
        publisher.publish(Header(stamp=Time(sec=number)))
    answer = client.call_async(Trigger.Request())
    spin_until(node, lambda: len(heard) == 5 and answer.done())
    spin_until(node, lambda: any(report.status[0].level == ERROR for report in reports))
    (told,) = next(r for r in reports if r.status[0].level == ERROR).status
    assert "ZeroDivisionError in test_node_support.py" in told.message or "ask" in told.message
    assert {pair.key: pair.value for pair in told.values}[
        "messages that could not be handled"
    ] == "2"
    assert not answer.result().success
    assert "ask: a message could not be handled: IndexError" in answer.result().message
    spin_until(node, lambda: reports[-1].status[0].level == OK)
    said = capfd.readouterr().err
    assert said.count("words: a message could not be handled: ZeroDivisionError") == 1
    assert "Traceback" not in said


def test_options_of_a_log_line_cost_no_message_and_count_for_its_place_alone(make_node, capfd):
    node = make_node()
    publisher = node.create_publisher(Header, "words", qos.EVENT)
    heard = []

    def hear(message):
        logger = node.get_logger()
        logger.warning("first, once", once=True)
        logger.warning("second, once", once=True)
        logger.warning("always")
        logger.warning("rarely", throttle_duration_sec=60.0)
        getattr(logger, "info" if heard else "error")("by turns")
        heard.append(message)
        raise ValueError("wrong\nwords")

    node.create_subscription(Header, "words", hear, qos.EVENT)
    for number in range(3):
        publisher.publish(Header(stamp=Time(sec=number)))
    spin_until(node, lambda: node.faults.total == 3)
    assert len(heard) == 3
    said = capfd.readouterr().err
    told = ("first, once", "second, once", "always", "rarely", "by turns", r"wrong\nwords")
    assert [said.count(words) for words in told] == [1, 1, 3, 1, 3, 1]


def test_the_topic_of_log_lines_tells_where_they_were_logged(make_node):
    node, lines = make_node(), []
    node.create_subscription(Log, "/rosout", lines.append, qos.EVENT)
    node.get_logger().warning("here", once=True)
    spin_until(node, lambda: any(line.msg == "here" for line in lines))
    (line,) = (line for line in lines if line.msg == "here")
    assert line.file.endswith("test_node_support.py")
    assert line.function == "test_the_topic_of_log_lines_tells_where_they_were_logged"


def test_a_bad_later_value_is_refused_and_the_old_one_stays(make_node):
    node = make_node()
    applied = []

    def check(values):
        if values["size"] == 0.5:
            raise SloshMessageError("no")

    given = declare(node, SPECS, check, applied.append)

    def attempt(name, value):
        return node.set_parameters([Parameter(name, value=value)])[0]

    assert attempt("kind", "b").successful
    assert "one of a, b" in attempt("kind", "z").reason
    assert attempt("size", 0.5).reason == "no"
    assert not attempt("size", 7.0).successful
    assert "size" in attempt("size", 7).reason
    assert attempt("size", "7").reason == "size = '7': type double is needed, not string"
    assert attempt("count", 2.5).reason == "count = 2.5: type integer is needed, not double"
    assert not node.set_parameters_atomically([Parameter("size", value=False)]).successful
    assert attempt("fixed", 2.0).reason == (
        "fixed is read at the start only: restart the node with -p fixed:=VALUE"
    )
    assert node.get_parameter("size").value == 1.0
    assert node.get_parameter("kind").value == "b"
    assert applied == [("kind",)]
    assert given["kind"] == "b"


def test_several_values_change_together_or_not_at_all(make_node):
    node = make_node()
    applied = []

    def check(values):
        if values["size"] > values["count"]:
            raise SloshMessageError("size must not be above count")

    given = declare(node, SPECS, check, applied.append)

    def attempt(**values):
        changes = [Parameter(name, value=value) for name, value in values.items()]
        return node.set_parameters_atomically(changes)

    assert attempt(size=1.5, count=1).reason == "size must not be above count"
    assert "fixed is read at the start only" in attempt(size=1.5, fixed=2.0).reason
    assert (given["size"], given["count"], applied) == (1.0, 3, [])
    assert attempt(size=2.0, count=2, place=[0.0, 0.0]).successful
    assert (given["size"], given["count"]) == (2.0, 2)
    assert applied == [("size", "count")], "the place is what it was"


def test_every_parameter_is_described(make_node):
    node = make_node()
    declare(node, SPECS)
    descriptor = node.describe_parameter("kind")
    assert descriptor.description == "kind (one of a, b)"
    bounds = node.describe_parameter("size").floating_point_range[0]
    assert (bounds.from_value, bounds.to_value) == (0.0, 2.0)


def test_diagnostics_tell_rates_totals_and_latency(make_node):
    node = make_node()
    received = []
    node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, received.append, qos.DIAGNOSTICS)
    reporter = DiagnosticsReporter(node, lambda: (WARN, "careful"), lambda: {"extra": 5})
    for latency in (1_000_000, 3_000_000, 50_000_000):
        reporter.counts["input"] += 1
        reporter.latency(latency)
    spin_until(node, lambda: received)
    (status,) = received[0].status
    values = {pair.key: pair.value for pair in status.values}
    assert (status.level, status.name, status.message) == (WARN, "/tested", "careful")
    assert values["input total"] == "3"
    assert values["latency median [ms]"] == "3.00"
    assert values["latency maximum [ms]"] == "50.00"
    assert values["extra"] == "5"


def test_a_node_reports_while_simulated_time_stands_still(make_node):
    node = make_node(use_sim_time=True)
    assert node.get_clock().now().nanoseconds == 0
    received = []
    node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, received.append, qos.DIAGNOSTICS)
    reporter = DiagnosticsReporter(node, lambda: (WARN, "what follows from it"))
    spin_until(node, lambda: received)
    assert received[0].status[0].message.startswith("simulated time does not advance:")
    assert received[0].status[0].level == STALE
    assert reporter.latency_percentiles()[0] != reporter.latency_percentiles()[0]  # NaN: none yet


ASKS_FOR_MORE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
OFFERS_LESS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def test_a_node_names_who_cannot_be_heard_or_hear_for_another_qos(make_node):
    node = make_node()
    node.create_publisher(Header, "out", qos.STREAM_OUT)
    node.create_subscription(Header, "in", print, qos.PLANNED_IN)
    said = []
    node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, said.append, qos.DIAGNOSTICS)
    DiagnosticsReporter(node, lambda: (OK, "fine"))
    other = rclpy.create_node("other")
    try:
        reader = other.create_subscription(Header, "out", print, ASKS_FOR_MORE)
        speaker = other.create_publisher(Header, "in", OFFERS_LESS)

        def newest():
            return said[-1].status[0] if said else None

        heard = "/in: /other cannot be received, its QoS is incompatible: Best effort publisher"
        hears = "/out: /other receives nothing, its QoS is incompatible: Volatile publisher"
        spin_until(node, lambda: newest() and all(w in newest().message for w in (heard, hears)))
        assert newest().level == WARN
        other.destroy_subscription(reader)
        other.destroy_publisher(speaker)
        spin_until(node, lambda: newest().message == "fine")
        assert newest().level == OK
    finally:
        other.destroy_node()


@pytest.mark.parametrize("executor", ["events", "single"])
def test_a_stream_outlives_a_stall_of_its_reader(make_node, monkeypatch, executor):
    """Publishes 200 messages at 1 kHz while the subscriber is busy for 200 ms."""
    monkeypatch.setenv("SLOSH_EXECUTOR", executor)
    node = make_node()
    received = []
    node.create_subscription(Header, "stream", received.append, qos.STREAM_IN)
    publisher = node.create_publisher(Header, "stream", qos.STREAM_OUT)
    spin_until(node, lambda: publisher.get_subscription_count() == 1)
    for number in range(200):
        publisher.publish(Header(frame_id=str(number)))
    spin_until(node, lambda: received and received[-1].frame_id == "199")
    assert [message.frame_id for message in received] == [str(n) for n in range(200)]


NODE = """
import os
import signal
import sys
from rclpy.node import Node
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.node.run import run_node

class Plain(Node):
    def __init__(self):
        super().__init__("plain")
        if "wrong" in sys.argv:
            raise SloshMessageError("parameter size = 5 is wrong")
        if "early" in sys.argv:
            os.kill(os.getpid(), signal.SIGTERM)
        self.create_timer(0.01, lambda: print("alive", flush=True))

    def close(self):
        print("closed", flush=True)

sys.exit(run_node(Plain))
"""


@pytest.mark.first(3)
@pytest.mark.parametrize("executor", ["events", "single"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_node_cleanly(executor, number):
    environment = {**os.environ, "SLOSH_EXECUTOR": executor}
    with subprocess.Popen(
        [sys.executable, "-c", NODE], stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert "alive\n" in iter(process.stdout.readline, "")
        process.send_signal(number)
        rest = process.stdout.read()
        assert process.wait(20) == 0
    assert rest.endswith("closed\n")


def test_a_signal_during_the_start_ends_a_node_cleanly_too():
    command = [sys.executable, "-c", NODE, "early"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0
    # Before it, on a busy machine, Fast DDS may have said words of its own.
    assert done.stdout.endswith("closed\n")
    assert "alive" not in done.stdout


def test_a_wrong_start_is_one_line_and_exit_code_two():
    command = [sys.executable, "-c", NODE, "wrong"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert done.stderr.strip() == "SloshMessageError: parameter size = 5 is wrong"


SLOW = """
import sys
import time
from types import SimpleNamespace
from typing import Any
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.node.diagnostics import OK
from slosh_msgs_py.node.prepared import PreparedNode
from slosh_msgs_py.node.run import run_node

class Slow(PreparedNode):
    def __init__(self):
        super().__init__("slow")
        self._watch(lambda: (OK, "works"), dict)
        self._get_ready(later=True)

    def prepare(self, progress):
        progress("the first of two")
        progress("the second of two")
        print("prepares", flush=True)
        sys.stdin.readline()
        if "wrong" in sys.argv:
            raise SloshMessageError("the still image shows no liquid")

    def begin(self):
        print("begins", flush=True)

    def close(self):
        print("closed", flush=True)

sys.exit(run_node(Slow))
"""


@pytest.fixture
def slow():
    """Starts a node that becomes ready when it reads a line from standard input."""
    processes = []

    def start(*words):
        processes.append(
            subprocess.Popen(
                [sys.executable, "-c", SLOW, *words],
                text=True,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
        )
        assert "prepares\n" in iter(processes[-1].stdout.readline, "")
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def test_a_node_tells_that_it_compiles_and_that_it_is_ready(make_node, slow):
    node = make_node()
    told = []

    def take(message):
        for status in message.status:
            facts = {pair.key: pair.value for pair in status.values}
            told.append((facts["state"], status.level, status.message))

    node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, take, qos.DIAGNOSTICS)
    process = slow()
    compiling = ("compiling", WARN, "not ready, compiling: the second of two")
    spin_until(node, lambda: told.count(compiling) >= 3)
    process.stdin.write("\n")
    process.stdin.flush()
    spin_until(node, lambda: told[-1] == ("ready", OK, "works"))
    assert "begins\n" in iter(process.stdout.readline, "")
    process.terminate()
    said = process.stderr.read()
    assert "not ready yet: the first of two" in said
    assert "compiled; ready" in said


def test_what_fails_while_it_is_prepared_is_one_line(slow):
    process = slow("wrong")
    process.stdin.write("\n")
    process.stdin.flush()
    assert process.wait(20) == 2
    last = process.stderr.read().strip().splitlines()[-1]
    assert last == "SloshMessageError: the still image shows no liquid"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--params-file", "/nowhere/cell.yaml"], "/nowhere/cell.yaml"),
        (["-p", "size:=[1"], "size:=[1"),
        (["--no-such-option"], "--no-such-option"),
    ],
)
def test_a_command_line_that_ros_cannot_read_is_named_in_the_last_line(arguments, reason):
    command = [sys.executable, "-c", NODE, "--ros-args", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    line = done.stderr.strip().splitlines()[-1]
    assert line.startswith("SloshMessageError: ROS cannot start: ")
    assert reason in line


def test_a_home_that_cannot_be_written_is_named_with_the_way_out():
    command = [sys.executable, "-c", NODE]
    environment = {name: os.environ[name] for name in os.environ if name != "ROS_LOG_DIR"}
    done = subprocess.run(
        command, env=environment | {"HOME": "/proc"}, capture_output=True, text=True, timeout=60,
        check=False,
    )  # fmt: skip
    assert done.returncode == 2
    line = done.stderr.strip().splitlines()[-1]
    assert re.search(r"ROS cannot start: .*'/proc/\.ros/log'.*; set ROS_LOG_DIR to a .*$", line)


def test_an_unknown_executor_is_named(monkeypatch):
    monkeypatch.setenv("SLOSH_EXECUTOR", "multi")
    with pytest.raises(SloshMessageError, match="'multi' must be one of events, single"):
        make_executor()


def test_a_node_says_what_it_alone_may_not_hear(make_node, monkeypatch):
    node = make_node()
    topic = SilentTopic(node, "input", "std_msgs/msg/Header")
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now)
    facts = []
    for seconds, total in ((LONG - 1.0, 0), (LONG + 1.0, 0)):
        now += seconds
        facts.append(topic.facts(total))
    assert facts == [{}, {}]  # nobody publishes
    node.create_publisher(Header, "input", qos.STREAM_OUT)
    told = {UNHEARD: "/input std_msgs/msg/Header"}
    assert topic.facts(0) == told
    assert topic.facts(7) == {}  # heard, be it of use or not
    now += LONG - 1.0
    assert topic.facts(7) == {}
    now += 1.0
    assert topic.facts(7) == told
    assert SilentTopic(node, "input", "std_msgs/msg/String").facts(0) == {}  # of another type


def test_rivals_are_told_by_the_time_that_the_journal_has():
    """So that a replay, which takes less time, flags the same messages."""
    info = SimpleNamespace(
        node_name="robot", node_namespace="/", topic_type="T", endpoint_gid=bytes(24)
    )
    other = SimpleNamespace(**{**vars(info), "node_name": "twin"})
    times = iter([5_000_000_000, 6_000_000_000, 5_000_000_000 + round(AGAIN * 1e9)])
    node: Any = SimpleNamespace(
        steady_ns=lambda: next(times), resolve_topic_name=lambda name: f"/{name}",
        get_publishers_info_by_topic=lambda _: [info, other],
    )  # fmt: skip
    rivals = Rivals(node, "accel", "T")
    assert [bool(rivals.look()) for _ in range(3)] == [False, False, True]
