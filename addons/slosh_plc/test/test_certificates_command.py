"""Tests `slosh certificates`: it creates, trusts and lists, and replaces nothing unasked."""

import json
import subprocess
from datetime import datetime, timedelta

import pytest

from slosh_bringup.cli.main import main

pytest.importorskip("cryptography", reason="not installed (requirements/plc.txt)")


@pytest.fixture
def folder(tmp_path, capsys):
    made = tmp_path / "certificates"
    assert main(["certificates", str(made), "--create", "cell-1.local", "10.0.0.5"]) == 0
    capsys.readouterr()
    return made


def listed(folder, capsys, *options, code=0):
    assert main(["certificates", str(folder), "--json", *options]) == code
    return json.loads(capsys.readouterr().out)


def test_openssl_finds_what_was_asked_for(folder):
    words = ["openssl", "x509", "-in", folder / "server.pem", "-noout", "-text"]
    text = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert "DNS:cell-1.local, IP Address:10.0.0.5" in text
    assert "URI:urn:cell-1.local:slosh" in text
    assert "Digital Signature, Non Repudiation, Key Encipherment, Data Encipherment" in text


def test_clients_are_trusted_and_listed(folder, tmp_path, capsys):
    main(["certificates", str(tmp_path / "client"), "--create", "plc", "--days", "20"])
    capsys.readouterr()
    rows = listed(folder, capsys, "--trust", str(tmp_path / "client" / "server.pem"))
    assert [(row["of"], row["hosts"]) for row in rows] == [
        ("server", ["cell-1.local", "10.0.0.5"]), ("client", ["plc"]),
    ]  # fmt: skip
    assert "expires on" in rows[1]["complaint"]
    assert main(["certificates", str(folder)]) == 0
    text = capsys.readouterr().out
    assert rows[1]["sha256"][:16] in text
    assert "renew it" in text.splitlines()[-1]


def test_a_certificate_is_replaced_only_when_asked(folder, capsys):
    (before,) = listed(folder, capsys)
    assert main(["certificates", str(folder), "--create", "b"]) == 2
    assert "--replace makes a new one" in capsys.readouterr().err
    assert listed(folder, capsys) == [before]
    (after,) = listed(folder, capsys, "--create", "b", "--replace")
    assert after["hosts"] == ["b"]
    assert after["sha256"] != before["sha256"]


class Tomorrow(datetime):
    @classmethod
    def now(cls, tz=None):
        return datetime.now(tz) + timedelta(days=1)


def test_an_expired_one_fails_the_check(folder, capsys, monkeypatch):
    main(["certificates", str(folder), "--create", "b", "--replace", "--days", "0.5"])
    capsys.readouterr()
    monkeypatch.setattr("slosh_plc.certificates_command.datetime", Tomorrow)
    (row,) = listed(folder, capsys, code=1)
    assert "expired on" in row["complaint"]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--create", "a b"], "must be a host's name"),
        (["--create", "ü.local"], "must be a host's name"),
        (["--create", "a", "--days", "nan"], "--days nan: must be between"),
        (["--create", "a", "--days", "-3"], "--days -3: must be between"),
        (["--replace"], "needs --create"),
        (["--trust", "absent.der"], "--trust: no such file: absent.der"),
        (["--trust", __file__], "is no certificate in PEM or DER"),
        ([], "no such folder; --create HOST makes it"),
    ],
)
def test_wrong_input_is_told_in_one_line(tmp_path, capsys, options, reason):
    folder = tmp_path / "new"
    assert main(["certificates", str(folder), *options]) == 2
    said = capsys.readouterr().err
    assert reason in said
    assert said.count("\n") == 1
    assert not folder.exists()
