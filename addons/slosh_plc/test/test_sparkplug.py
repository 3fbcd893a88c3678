"""Sparkplug B over a real broker, read by a decoder that knows the wire format only."""

import asyncio
import dataclasses
import math
import struct
import subprocess
import sys

import pytest

from slosh_plc.broker_client import MqttSettings, lost_state
from slosh_plc.cell_state import SIGNALS
from slosh_plc.cell_view import CellView
from slosh_plc.errors import SloshPlcError
from slosh_plc.sparkplug import SparkplugNode, values_of
from slosh_plc.tuning import TUNING
from slosh_testing.live_processes import until
from slosh_testing.plc import ServedCell, free_port, good_state

aiomqtt = pytest.importorskip("aiomqtt", reason="aiomqtt is not installed (requirements/plc.txt)")
pytest.importorskip("google.protobuf", reason="not installed (requirements/plc.txt)")
TOPIC = "spBv1.0/plant/{}/line_1"
GOOD, BAD, STALE = 192, 0, 500


def fields(data):
    """Numbers and raw values of a protobuf message: varints as integers, the rest as bytes."""
    place = 0

    def varint():
        nonlocal place
        value = shift = 0
        while True:
            byte, place = data[place], place + 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    while place < len(data):
        number, wire = divmod(varint(), 8)
        if wire == 0:
            yield number, varint()
            continue
        length = {1: 8, 5: 4}.get(wire) or varint()
        yield number, data[place : place + length]
        place += length


def metric_of(data):
    """A metric as a dictionary; units and qualities are among its properties."""
    found = {"value": None, "properties": {}}
    for number, raw in fields(data):
        if number in (2, 3, 4, 7):
            found[{2: "alias", 3: "time", 4: "type", 7: "null"}[number]] = raw
        elif number in (1, 15):
            found["name" if number == 1 else "value"] = raw.decode()
        elif number == 13:
            (found["value"],) = struct.unpack("<d", raw)
        elif number in (10, 11, 14):
            found["value"] = raw
        elif number == 9:
            parts = list(fields(raw))
            keys = [part.decode() for k, part in parts if k == 1]
            values = [dict(fields(part)) for k, part in parts if k == 2]
            for key, value in zip(keys, values, strict=True):
                text = value.get(8)
                found["properties"][key] = value[3] if text is None else text.decode()
    return found


def decoded(data):
    """A payload: time, number of the message (None: it has none) and metrics."""
    rows = list(fields(data))
    single = {number: raw for number, raw in rows if number != 2}
    return single[1], single.get(3), [metric_of(raw) for number, raw in rows if number == 2]


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr("slosh_plc.broker_client.TUNING", dataclasses.replace(TUNING, retry=0.2))


@pytest.fixture
def broker(new_broker, tmp_path):
    with new_broker(tmp_path, free_port()) as made:
        yield made


def edge(broker, session=4):
    return SparkplugNode(MqttSettings("line_1", "127.0.0.1", broker.port), "plant", session)


async def follow(broker, act):
    """Messages as a SCADA program hears them, until a function of them says that it is enough."""
    heard = []
    async with aiomqtt.Client("127.0.0.1", broker.port) as client:
        await client.subscribe([(TOPIC.format(kind), 1) for kind in ("NBIRTH", "NDATA", "NDEATH")])
        for command in act("subscribed", heard) or ():
            await client.publish(TOPIC.format("NCMD"), command)
        async for message in client.messages:
            kind = str(message.topic).split("/")[2]
            heard.append((kind, *decoded(message.payload), message.retain))
            answer = act(kind, heard)
            if answer is True:
                return heard
            for command in answer or ():
                await client.publish(TOPIC.format("NCMD"), command)
    return heard


def hear(broker, act):
    return asyncio.run(asyncio.wait_for(follow(broker, act), 60))


def by_name(metrics):
    return {metric["name"]: metric for metric in metrics}


NONSENSE = b"\xff\x01 no payload"
REBIRTH = bytes.fromhex("1218") + b"\x0a\x14Node Control/Rebirth\x70\x01"
"""A command as a program packs it: a metric (field 2) with a name (1) and a true value (14)."""


def test_birth_tells_all_values_and_data_only_the_changed_ones(broker):
    cell = ServedCell()
    cell.state = good_state(estimated_height=0.0125, state=1, measured_height=math.nan)
    threads = []

    def act(kind, heard):
        if kind == "subscribed":
            threads.append(cell.serve(edge(broker)))
            threads[0].__enter__()
        elif kind == "NBIRTH":
            cell.state = dataclasses.replace(
                cell.state, estimated_height=good_state(estimated_height=0.02).estimated_height
            )
        return kind == "NDATA"

    try:
        (birth, data) = hear(broker, act)
    finally:
        threads[0].__exit__(None, None, None)
    _, _, seq, metrics, retained = birth
    assert (seq, retained) == (0, 0)
    found = by_name(metrics)
    assert list(found) == ["bdSeq", "Node Control/Rebirth", *(one.name for one in SIGNALS)]
    assert found["bdSeq"]["value"] == 5
    assert found["Node Control/Rebirth"]["value"] == 0
    height = found["estimated_height"]
    assert (height["value"], height["type"]) == (0.0125, 10)
    assert height["properties"]["Quality"] == GOOD
    assert height["properties"]["engUnit"] == "m"
    assert (found["state"]["value"], found["state"]["type"]) == (1, 7)
    assert found["measured_height"]["null"] == 1
    aliases = [metric["alias"] for metric in metrics[2:]]
    assert len(set(aliases)) == len(SIGNALS)
    _, _, seq, metrics, _ = data
    assert seq == 1
    assert [(one["alias"], one["value"]) for one in metrics] == [(height["alias"], 0.02)]
    assert "name" not in metrics[0]


def test_a_lost_cell_is_stale_and_a_rebirth_command_is_obeyed(broker):
    cell = ServedCell()
    births = []

    def act(kind, heard):
        if kind == "NBIRTH":
            births.append(heard[-1])
            cell.lose()
        is_first = len(births) < 2
        # One that comes later asks for the birth that it has missed.
        return (
            (NONSENSE, REBIRTH) if is_first and kind in ("subscribed", "NDATA") else not is_first
        )

    with cell.serve(edge(broker)) as thread:
        until(lambda: thread.health()[0].is_good, "the connection")
        heard = hear(broker, act)
    assert {metric["properties"]["Quality"] for metric in births[0][3][2:]} == {GOOD}
    (lost,) = [one for one in heard if one[0] == "NDATA"]
    assert {metric["properties"]["Quality"] for metric in lost[3]} == {STALE}
    assert len(lost[3]) == len(SIGNALS)
    found = by_name(births[1][3])
    assert {metric["properties"]["Quality"] for metric in births[1][3][2:]} == {STALE}
    assert (births[1][2], found["bdSeq"]["value"]) == (0, 5)
    assert found["state"]["value"] == 3  # the monitor's STALE


class Sent:
    """What is published, in place of a connection."""

    def __init__(self):
        self.numbers = []

    async def publish(self, topic, data, **_):
        self.numbers.append(decoded(data)[1])


def test_the_numbers_of_messages_begin_again_after_255():
    node, sent = SparkplugNode(MqttSettings("a", "127.0.0.1", 1883), "plant", 0), Sent()

    async def publish():
        await node._bear(sent)
        for count in range(2, 300):
            node._state = good_state(heartbeat=count)
            await node._publish_changes(sent)
            await node._publish_changes(sent)  # nothing has changed: nothing is sent

    asyncio.run(publish())
    assert sent.numbers == [number % 256 for number in range(299)]


SERVE = """import sys, time
from slosh_plc.broker_client import MqttSettings
from slosh_plc.sparkplug import SparkplugNode
from slosh_testing.plc import ServedCell
settings = MqttSettings("line_1", "127.0.0.1", int(sys.argv[1]))
with ServedCell().serve(SparkplugNode(settings, "plant", 254)):
    time.sleep(600)
"""


def test_the_broker_sends_the_death_of_a_killed_node_with_its_session(broker):
    words = [sys.executable, "-c", SERVE, str(broker.port)]
    running = []

    def act(kind, heard):
        if kind == "subscribed":
            running.append(subprocess.Popen(words))
        elif kind == "NBIRTH":
            running[0].kill()
        return kind == "NDEATH"

    heard = hear(broker, act)
    running[0].wait()
    _, _, seq, metrics, _ = heard[-1]
    assert seq is None
    assert [(one["name"], one["value"]) for one in metrics] == [("bdSeq", 255)]
    assert by_name(heard[0][3])["bdSeq"]["value"] == 255


def test_each_connection_is_a_new_session_and_a_good_bye_tells_the_death(new_broker, tmp_path):
    port = free_port()
    broker = new_broker(tmp_path, port)
    sessions = []
    node = edge(broker, session=254)
    stopping = ServedCell().serve(node)
    thread = stopping.__enter__()
    for _ in range(2):
        with broker:
            until(lambda: thread.health()[0].is_good, "the connection")
            (birth,) = hear(broker, lambda kind, _: kind == "NBIRTH" or (REBIRTH,))[-1:]
            sessions.append(by_name(birth[3])["bdSeq"]["value"])
        until(lambda: not thread.health()[0].is_good, "the loss")
    assert sessions[1] != sessions[0]
    assert set(sessions) <= set(range(256))
    with broker:
        until(lambda: thread.health()[0].is_good, "the connection")

        def act(kind, heard):
            if kind == "subscribed":
                thread._loop.call_soon_threadsafe(lambda: thread._task.cancel())
            return kind == "NDEATH"

        death = hear(broker, act)[-1]
    assert [one["name"] for one in death[3]] == ["bdSeq"]
    stopping.__exit__(None, None, None)


def test_a_silent_cell_is_stale_within_a_second():
    view = CellView(0.0)
    assert TUNING.silence + 2.0 * TUNING.period < 1.0
    found = values_of(view.state(TUNING.silence + 1e-9))
    assert {value.quality for name, value in found.items() if name != "heartbeat"} == {STALE}
    assert found["heartbeat"].quality == GOOD
    assert {value.quality for value in values_of(lost_state()).values()} == {STALE}


@pytest.mark.parametrize("group", ["", "a/b", "a+", "#", "a\n", "x" * 61])
def test_a_group_that_is_no_name_is_refused(group):
    with pytest.raises(SloshPlcError, match=r"sparkplug_group = .*must be a name"):
        SparkplugNode(MqttSettings("a", "127.0.0.1", 1883), group, 0)
