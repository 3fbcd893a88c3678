"""What systemd hears of a cell that it runs."""

import socket

import pytest

from slosh_bringup.live.service_manager import ServiceManager


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr("slosh_bringup.live.service_manager.time.monotonic", lambda: now[0])
    return now


@pytest.fixture(params=["file", "abstract"])
def manager(request, tmp_path):
    """Provides a bound socket like systemd's and an environment that names it."""
    name = str(tmp_path / "notify") if request.param == "file" else f"@{tmp_path}"
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
    with listening:
        listening.bind(name.replace("@", "\0"))
        yield listening, {"NOTIFY_SOCKET": name, "OTHER": "1"}


def heard(listening):
    try:
        return listening.recv(1000).decode().splitlines()
    except BlockingIOError:
        return None


def test_it_hears_of_the_start_the_work_and_the_end(manager, clock):
    listening, environment = manager
    service = ServiceManager(environment)
    assert environment == {"OTHER": "1"}  # nodes do not inherit it
    service.look(is_ready=False, status="waiting for camera")
    assert heard(listening) == ["WATCHDOG=1", "STATUS=waiting for camera"]
    service.look(is_ready=False, status="waiting for camera")
    assert heard(listening) is None
    service.look(is_ready=True, status="")
    assert heard(listening) == ["READY=1", "WATCHDOG=1", "STATUS=running"]
    for _ in range(10):
        clock[0] += 0.125
        service.look(is_ready=True, status="")
    assert heard(listening) == ["WATCHDOG=1", "STATUS=running"]
    assert heard(listening) is None
    service.stopping()
    assert heard(listening)[0] == "STOPPING=1"


def test_without_a_manager_or_with_one_that_has_gone_nothing_happens(tmp_path, clock):
    for environment in ({}, {"NOTIFY_SOCKET": str(tmp_path / "none")}):
        service = ServiceManager(environment)
        service.look(is_ready=True, status="")
        service.stopping()


def test_a_sentence_cannot_say_what_the_cell_does_not(manager, clock):
    listening, environment = manager
    ServiceManager(environment).look(is_ready=False, status="waiting\nREADY=1")
    lines = heard(listening)
    assert len(lines) == 2
    assert "READY=1" not in lines
