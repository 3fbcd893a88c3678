"""A real broker keeps a cell's state, and never the last good one of a server that has gone."""

import asyncio
import dataclasses
import json
import threading

import pytest

from slosh_plc.broker_client import MqttSettings, read_settings
from slosh_plc.errors import SloshPlcError
from slosh_plc.mqtt import MqttPublisher
from slosh_plc.server import ServerThread
from slosh_plc.tuning import TUNING
from slosh_testing.live_processes import until
from slosh_testing.plc import ServedCell, free_port, good_state

aiomqtt = pytest.importorskip("aiomqtt", reason="aiomqtt is not installed (requirements/plc.txt)")
CELL = "line_1"


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr("slosh_plc.broker_client.TUNING", dataclasses.replace(TUNING, retry=0.2))


def hear(broker, condition, cell=CELL, **login):
    """The first document on a cell's topic that meets a condition, for one who joins now."""

    async def listen():
        async with aiomqtt.Client("127.0.0.1", broker.port, **login) as client:
            await client.subscribe(f"slosh/{cell}/state")
            async for message in client.messages:
                told = json.loads(message.payload)
                if condition(told):
                    break
        return told, message.retain

    return asyncio.run(asyncio.wait_for(listen(), 60))


def is_good(told):
    return told["values"]["state"]["quality"] == "good"


def is_lost(told):
    return not is_good(told)


def publisher(port, cell=CELL, **given):
    return MqttPublisher(MqttSettings(cell, "127.0.0.1", port, **given))


def test_a_broker_that_hangs_does_not_hold_up_the_end(new_broker, tmp_path, monkeypatch):
    monkeypatch.setattr("slosh_plc.server.TUNING", dataclasses.replace(TUNING, starting=20.0))
    cell = ServedCell()
    with new_broker(tmp_path, free_port()) as broker:
        with cell.serve(publisher(broker.port)):
            hear(broker, is_good)
            broker.pause()
        assert "plc servers" not in [thread.name for thread in threading.enumerate()]


def test_a_late_reader_finds_the_state_with_units_and_qualities(new_broker, tmp_path):
    cell = ServedCell()
    cell.state = good_state(estimated_height=0.0125, state=1, calm=False)
    with new_broker(tmp_path, free_port()) as broker, cell.serve(publisher(broker.port)):
        hear(broker, is_good)
        told, retained = hear(broker, is_good)  # from the second time on it is kept
    assert told["cell"] == CELL
    assert told["stamp"].endswith("+00:00")
    values = told["values"]
    assert values["estimated_height"] == {"value": 0.0125, "quality": "good", "unit": "m"}
    assert values["state"] == {"value": 1, "quality": "good", "name": "WARN"}
    assert values["calm"] == {"value": False, "quality": "good"}
    assert retained


def test_a_server_that_ends_leaves_a_lost_cell(new_broker, tmp_path):
    with new_broker(tmp_path, free_port()) as broker:
        with ServedCell().serve(publisher(broker.port)):
            hear(broker, is_good)
        told, retained = hear(broker, lambda _: True)
    assert retained
    assert {value["quality"] for value in told["values"].values()} == {"bad"}
    assert told["values"]["state"]["name"] == "STALE"
    assert told["values"]["estimated_height"]["value"] is None


def test_a_lost_cell_is_published_while_the_server_works(new_broker, tmp_path):
    cell = ServedCell()
    with new_broker(tmp_path, free_port()) as broker, cell.serve(publisher(broker.port)):
        hear(broker, is_good)
        cell.lose()
        told, _ = hear(broker, is_lost)
    assert told["values"]["blind"] == {"value": True, "quality": "bad"}


def test_two_cells_share_a_broker(new_broker, tmp_path):
    one, other = ServedCell(), ServedCell()
    other.lose()
    with (
        new_broker(tmp_path, free_port()) as broker,
        one.serve(publisher(broker.port)),
        other.serve(publisher(broker.port, "line_2/b")),
    ):
        assert hear(broker, is_good)[0]["cell"] == CELL
        assert hear(broker, is_lost, "line_2/b")[0]["cell"] == "line_2/b"


def test_a_broker_that_is_absent_or_goes_is_told_and_found_again(new_broker, tmp_path):
    port = free_port()
    with ServedCell().serve(publisher(port)) as thread:

        def health():
            return thread.health()[0]

        until(lambda: "refused" in health().sentence.lower(), "the refusal")
        assert not health().is_good
        assert f"127.0.0.1:{port} is not connected" in health().sentence
        broker = new_broker(tmp_path, port)
        for _ in range(2):
            with broker:
                until(lambda: health().is_good, "the connection")
                hear(broker, is_good)
            until(lambda: not health().is_good, "the loss")
        assert not thread.failure


def test_a_wrong_password_is_told(new_broker, tmp_path):
    lines = ("allow_anonymous false",)
    with (
        new_broker(tmp_path, free_port(), *lines) as broker,
        ServedCell().serve(publisher(broker.port, user="plc", password="wrong")) as thread,
    ):
        until(lambda: "uthori" in thread.health()[0].sentence, "the refusal")
        assert "\n" not in thread.health()[0].sentence


def test_settings_are_checked(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("open sesame\n")
    own = read_settings("slosh", "broker.local:1999", "plc", str(secret))
    assert (own.host, own.port, own.password) == ("broker.local", 1999, "open sesame")
    assert read_settings("slosh", "[::1]").address == "::1:1883"
    assert MqttPublisher(own).topic == "slosh/slosh/state"
    for given, reason in [
        (("mqtt://x",), "mqtt_broker = 'mqtt://x' must be HOST or HOST:PORT"),
        (("host:99999",), "must be HOST or HOST:PORT"),
        (("host", "", str(secret)), "needs mqtt_user"),
        (("host", "plc", str(tmp_path / "absent")), "mqtt_password_file: .*No such file"),
        (("host", "", "", str(tmp_path / "absent")), "mqtt_authority: .*No such file"),
        (("host", "", "", str(secret)), "mqtt_authority: .* is no certificate"),
    ]:
        with pytest.raises(SloshPlcError, match=reason):
            read_settings("slosh", *given)


def test_a_server_that_fails_later_is_told_and_ends_the_others(tmp_path):
    class Failing:
        stopped, updates = False, 0

        async def start(self, state):
            pass

        async def update(self, state):
            Failing.updates += 1
            if Failing.updates > 2:
                raise RuntimeError("broken")

        async def stop(self):
            Failing.stopped = True

        def health(self):
            return None

    thread = ServerThread([Failing()], good_state)
    thread.start()
    until(lambda: thread.failure, "the end")
    assert "broken" in thread.failure
    thread.stop()
    assert Failing.stopped
