"""A real broker over TLS: user and password, own certificates, and what does not fit is named."""

import asyncio
import dataclasses
import ipaddress
import json
import ssl
import subprocess
import sys
from datetime import UTC, datetime, timedelta

import pytest

from slosh_plc.broker_client import read_settings
from slosh_plc.errors import SloshPlcError
from slosh_plc.mqtt import MqttPublisher
from slosh_plc.tuning import TUNING
from slosh_testing.live_processes import until
from slosh_testing.plc import ServedCell, free_port

aiomqtt = pytest.importorskip("aiomqtt", reason="aiomqtt is not installed (requirements/plc.txt)")
x509 = pytest.importorskip("cryptography.x509", reason="not installed (requirements/plc.txt)")
hashes = pytest.importorskip("cryptography.hazmat.primitives.hashes")
form = pytest.importorskip("cryptography.hazmat.primitives.serialization")
ec = pytest.importorskip("cryptography.hazmat.primitives.asymmetric.ec")

PASSWORD = "open sesame"
HOST = "127.0.0.1"


class Authority:
    """A certificate authority of a plant, with its files in a folder."""

    def __init__(self, folder, name):
        self._folder, self._key = folder, ec.generate_private_key(ec.SECP256R1())
        self._name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
        self.path = folder / f"{name}.pem"
        made = self._signed(self._name, self._key.public_key(), 10, ca=True)
        self.path.write_bytes(made.public_bytes(form.Encoding.PEM))

    def issue(self, name, host=HOST, days=10):
        """Files of a certificate and its key."""
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
        made = self._signed(subject, key.public_key(), days, host=host)
        path, key_path = (self._folder / f"{name}{end}.pem" for end in ("", ".key"))
        path.write_bytes(made.public_bytes(form.Encoding.PEM))
        plain = (form.Encoding.PEM, form.PrivateFormat.PKCS8, form.NoEncryption())
        key_path.write_bytes(key.private_bytes(*plain))
        return path, key_path

    def _signed(self, subject, key, days, ca=False, host=HOST):
        now = datetime.now(UTC)
        hosts = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address(host))])
        return (
            x509.CertificateBuilder()
            .subject_name(subject).issuer_name(self._name).public_key(key)
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - timedelta(days=20))
            .not_valid_after(now + timedelta(days=days))
            .add_extension(x509.BasicConstraints(ca=ca, path_length=None), critical=True)
            .add_extension(hosts, critical=False)
            .sign(self._key, hashes.SHA256())
        )  # fmt: skip


class Plant:
    """An authority, a broker's configuration and the publisher's parameters."""

    def __init__(self, new_broker, folder):
        self._new_broker = new_broker
        self.folder, self.port = folder, free_port()
        self.authority = Authority(folder, "authority")
        self.own = self.authority.issue("publisher")
        (folder / "password").write_text(PASSWORD + "\n")
        users = folder / "users"
        words = ["mosquitto_passwd", "-b", "-c", str(users), "plc", PASSWORD]
        subprocess.run(words, check=True, capture_output=True)

    def broker(self, host=HOST, days=10):
        """A broker that asks for certificate, user and password."""
        path, key = self.authority.issue("broker", host, days)
        lines = (
            "user root", f"cafile {self.authority.path}", f"certfile {path}", f"keyfile {key}",
            "require_certificate true", "allow_anonymous false",
            f"password_file {self.folder / 'users'}",
        )  # fmt: skip
        return self._new_broker(self.folder, self.port, *lines)

    def parameters(self, **given):
        """Arguments of read_settings."""
        return {
            "cell": "line_1", "broker": f"{HOST}:{self.port}", "user": "plc",
            "password_file": str(self.folder / "password"), "authority": str(self.authority.path),
            "certificate": str(self.own[0]), "private_key": str(self.own[1]), **given,
        }  # fmt: skip

    def publisher(self, **given):
        return MqttPublisher(read_settings(**self.parameters(**given)))

    def hear(self, condition):
        """The first document that meets a condition, for another client over TLS."""

        async def listen():
            context = ssl.create_default_context(cafile=self.authority.path)
            context.load_cert_chain(*self.authority.issue("reader"))
            login = {"username": "plc", "password": PASSWORD, "tls_context": context}
            async with aiomqtt.Client(HOST, self.port, **login) as client:
                await client.subscribe("slosh/line_1/state")
                async for message in client.messages:
                    told = json.loads(message.payload)["values"]["state"]
                    if condition(told):
                        break
                return told

        return asyncio.run(asyncio.wait_for(listen(), 60))


@pytest.fixture
def plant(new_broker, tmp_path, monkeypatch):
    monkeypatch.setattr("slosh_plc.broker_client.TUNING", dataclasses.replace(TUNING, retry=0.2))
    return Plant(new_broker, tmp_path)


def is_good(told):
    return told["quality"] == "good"


def test_a_publisher_with_its_own_certificate_and_password_is_let_in(plant):
    with plant.broker(), ServedCell().serve(plant.publisher()) as thread:
        assert plant.hear(is_good)["name"] == "WARN"  # as the served state has it
        assert thread.health()[0].is_good


@pytest.mark.parametrize(
    ("given", "reasons"),
    [
        ({"password_file": "wrong"}, ("uthori",)),
        ({"authority": "other"}, ("mqtt_authority: the broker's certificate verify failed",)),
        ({"certificate": "", "private_key": ""}, ("certificate required", "mqtt_certificate")),
    ],
)
def test_what_does_not_fit_is_told_in_one_line(plant, given, reasons):
    (plant.folder / "wrong").write_text("guess")
    files = {"wrong": plant.folder / "wrong", "other": Authority(plant.folder, "other").path}
    given = {name: str(files.get(value, value)) for name, value in given.items()}
    with plant.broker(), ServedCell().serve(plant.publisher(**given)) as thread:

        def sentence():
            return thread.health()[0].sentence

        until(lambda: "not connected yet" not in sentence(), "the refusal")
        assert any(reason in sentence() for reason in reasons), sentence()
        assert "\n" not in sentence()
        assert "_ssl.c" not in sentence()
        assert not thread.health()[0].is_good


@pytest.mark.parametrize(
    ("broker", "reason"),
    [({"host": "10.0.0.9"}, "not valid for '127.0.0.1'"), ({"days": -1}, "has expired")],
)
def test_a_broker_with_the_wrong_certificate_is_named(plant, broker, reason):
    with plant.broker(**broker), ServedCell().serve(plant.publisher()) as thread:
        until(lambda: reason in thread.health()[0].sentence, "the refusal")


def test_a_broker_that_goes_and_comes_back_is_found_again(plant):
    with ServedCell().serve(plant.publisher()) as thread:
        for _ in range(2):
            with plant.broker():
                plant.hear(is_good)
                until(lambda: thread.health()[0].is_good, "the connection")
            until(lambda: not thread.health()[0].is_good, "the loss")


SERVE = """import json, sys, time
from slosh_plc.broker_client import read_settings
from slosh_plc.mqtt import MqttPublisher
from slosh_testing.plc import ServedCell
with ServedCell().serve(MqttPublisher(read_settings(**json.loads(sys.argv[1])))):
    time.sleep(600)
"""


def test_another_client_sees_the_last_will_of_a_killed_publisher(plant):
    words = [sys.executable, "-c", SERVE, json.dumps(plant.parameters())]
    with plant.broker(), subprocess.Popen(words) as process:
        plant.hear(is_good)
        process.kill()
        told = plant.hear(lambda told: not is_good(told))
    assert (told["quality"], told["name"]) == ("bad", "STALE")


def test_files_that_do_not_fit_are_refused_at_the_start(plant):
    late = plant.authority.issue("late", days=-1)
    text = plant.folder / "text"
    text.write_text("no key")
    cases = [
        ({"private_key": ""}, "must be given together"),
        ({"authority": ""}, "mqtt_certificate: needs mqtt_authority"),
        ({"certificate": str(text)}, "mqtt_certificate: .*text is no certificate"),
        ({"private_key": str(text)}, "mqtt_private_key: .*text: is not the key of"),
        ({"private_key": str(late[1])}, "mqtt_private_key: .*late.key.pem: is not the key of"),
        ({"private_key": "absent"}, "mqtt_private_key: absent: no such file"),
        ({"certificate": str(late[0]), "private_key": str(late[1])}, "late.pem expired on"),
    ]
    for given, reason in cases:
        with pytest.raises(SloshPlcError, match=reason) as caught:
            read_settings(**plant.parameters(**given))
        assert "\n" not in str(caught.value)
