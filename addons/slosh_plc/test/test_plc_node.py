"""The node over DDS: it serves what the cell's nodes say, and that they are gone."""

import asyncio
import json
import os
import socket
import subprocess
import time

import pytest
import rclpy
from std_msgs.msg import Header

from slosh_bringup.processes import NodeProcess, node_environment
from slosh_estimator.comparison import Condition
from slosh_msgs.msg import Calm, LimitEvent, NodeSettings, SloshComparison
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_time
from slosh_plc.cell_state import REGISTERS, Quality
from slosh_plc.errors import SloshPlcError
from slosh_plc.modbus import registers
from slosh_plc.nodes.plc_node import PlcNode
from slosh_testing.hearing_robot import Graph
from slosh_testing.plc import free_port

pytest.importorskip("pymodbus", reason="pymodbus is not installed (requirements/plc.txt)")
aiomqtt = pytest.importorskip("aiomqtt", reason="aiomqtt is not installed (requirements/plc.txt)")
CELL = "/line_1"


@pytest.fixture
def graph():
    rclpy.init()
    made = Graph(namespace=CELL)
    yield made
    for node in made.nodes:
        if isinstance(node, PlcNode):
            node.close()
    made.close()
    rclpy.try_shutdown()


def serve(graph, **given):
    own = {"opc_ua_port": 0, "modbus_port": free_port()} | given
    return graph.with_parameters(PlcNode, CELL, **own)


def header(age=0.0):
    return Header(stamp=to_time(time.time_ns() - round(age * 1e9)))


def comparison(height=0.004, age=0.0):
    return SloshComparison(
        header=header(age), state=int(Condition.WARN), measured=height,
        estimated_nonlinear=2.0 * height,
    )  # fmt: skip


def test_what_the_cell_says_is_served_and_a_silent_one_is_lost(graph):
    node = serve(graph)
    compare = graph.publisher(SloshComparison, topics.COMPARISON)
    event = graph.publisher(LimitEvent, topics.LIMIT_EVENT, qos.EVENT)
    calm = graph.publisher(Calm, topics.CALM)
    settings = graph.publisher(NodeSettings, topics.SETTINGS, qos.EVENT)
    document = "parameters: {measured_limit: 0.02}\nfiles: {}\n"
    settings.publish(NodeSettings(node="monitor", document=document))
    event.publish(LimitEvent(kind=LimitEvent.KIND_START, source=LimitEvent.SOURCE_MEASURED))

    def state():
        compare.publish(comparison())
        calm.publish(Calm(header=header(), calm=True, time_until_calm=0.0))
        return node._view.state(max(node._view._heard_at, 0.0))

    graph.until(
        lambda: (
            {one.quality for one in map(state().readings().get, ("calm", "measured_limit"))}
            == {Quality.GOOD}
        )
    )
    graph.until(lambda: state().measured_events.value == 1)
    found = state()
    assert (found.state.value, found.measured_height.value) == (Condition.WARN, 0.004)
    assert found.estimated_height.value == 0.008
    assert found.measured_limit.value == 0.02
    assert len(registers(found)) == REGISTERS
    graph.until(lambda: node._servers._state().is_lost, "the loss")
    assert "values have bad quality" in node._health()[1]


@pytest.mark.parametrize("age", [3600.0, -3600.0])
def test_an_hour_between_stamps_and_clock_is_bad_and_told(graph, age):
    node = serve(graph)
    compare = graph.publisher(SloshComparison, topics.COMPARISON)
    calm = graph.publisher(Calm, topics.CALM)

    def told():
        compare.publish(comparison(age=age))
        calm.publish(Calm(header=header(age), calm=True))
        return "stamps are 3.6e+03 s" in node._health()[1]

    graph.until(told)
    found = node._view.state(node._view._heard_at)
    assert not found.is_lost
    assert {found.state.quality, found.calm.quality, found.measured_height.quality} == {
        Quality.BAD
    }
    assert ("behind" if age > 0.0 else "ahead of") in node._health()[1]


def test_messages_that_waited_while_the_node_stood_still_are_not_new(graph):
    node = serve(graph)
    compare = graph.publisher(SloshComparison, topics.COMPARISON)
    event = graph.publisher(LimitEvent, topics.LIMIT_EVENT, qos.EVENT)
    node._looked -= 10.0  # as if the process had been stopped
    compare.publish(comparison())
    event.publish(LimitEvent(kind=LimitEvent.KIND_START, source=LimitEvent.SOURCE_ESTIMATED))
    graph.until(lambda: node._view._events["estimated_events"] == 1)
    assert node._view.state(time.monotonic()).is_lost
    graph.until(lambda: (compare.publish(comparison()), node._view._heard_at > 0.0)[1])


def test_a_broken_message_costs_nothing_else(graph):
    node = serve(graph)
    compare = graph.publisher(SloshComparison, topics.COMPARISON)
    settings = graph.publisher(NodeSettings, topics.SETTINGS, qos.EVENT)
    settings.publish(NodeSettings(node="monitor", document="{{{"))
    compare.publish(SloshComparison(state=99, measured=float("inf")))
    graph.until(lambda: node._view._heard_at > 0.0)
    found = node._view.state(node._view._heard_at)
    assert found.state.quality is Quality.BAD
    assert found.measured_height.quality is Quality.BAD


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"modbus_port": 0}, "set at least one of them"),
        ({"opc_ua_port": 4840, "certificate": "a.pem"}, "must be given together"),
        ({"mqtt_broker": "a b"}, "must be HOST or HOST:PORT"),
    ],
)
def test_parameters_that_do_not_fit_are_refused(graph, given, reason):
    with pytest.raises(SloshPlcError, match=reason):
        serve(graph, **given)


def test_a_second_cell_on_the_same_port_ends_with_one_line():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        given = {"opc_ua_port": "0", "modbus_port": str(other.getsockname()[1])}
        words = NodeProcess("plc", parameters=given).command("/line_2")
        done = subprocess.run(words, env=node_environment(), capture_output=True, text=True)
    assert done.returncode == 2
    assert "choose another port for each cell" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_killed_node_leaves_a_lost_cell_at_the_broker(new_broker, graph, tmp_path):
    with new_broker(tmp_path, free_port()) as broker:
        given = {"opc_ua_port": "0", "mqtt_broker": f"127.0.0.1:{broker.port}"}
        words = NodeProcess("plc", parameters=given).command(CELL)
        with subprocess.Popen(words, env=node_environment()) as process:
            compare = graph.publisher(SloshComparison, topics.COMPARISON)
            told = asyncio.run(asyncio.wait_for(follow(broker, compare, process), 60))
    states = [(one["values"]["state"]["quality"], one["values"]["state"]["name"]) for one in told]
    assert ("good", "WARN") in states
    assert states[-1] == ("bad", "STALE")


async def follow(broker, compare, process):
    """Documents until the state is good, and then, the node being killed, until it is not."""
    found = []
    async with aiomqtt.Client("127.0.0.1", broker.port) as client:
        await client.subscribe("slosh/line_1/state")
        beat = asyncio.create_task(publish(compare))
        async for message in client.messages:
            found.append(json.loads(message.payload))
            is_good = found[-1]["values"]["state"]["quality"] == "good"
            if is_good and process.poll() is None:
                os.kill(process.pid, 9)
                process.wait()
            elif not is_good and process.returncode is not None:
                break
        beat.cancel()
    return found


async def publish(compare):
    while True:
        compare.publish(comparison())
        await asyncio.sleep(0.02)
