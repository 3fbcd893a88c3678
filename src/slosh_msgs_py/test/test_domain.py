"""Tests that each run reserves its own DDS domain, which a killed run releases."""

import subprocess
import sys

import rclpy

from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.node import domain
from slosh_msgs_py.node.domain import (
    DOMAINS,
    claimed_namespace,
    own_domain,
    spoken_domains,
)

HOLDER = """
import time
from slosh_msgs_py.node.domain import own_domain
with own_domain() as number:
    print(number, flush=True)
    time.sleep(60.0)
"""


def refused(monkeypatch, *numbers):
    """Returns whether none of the given domain ids can be reserved."""
    monkeypatch.setattr(domain, "DOMAINS", numbers)
    try:
        with own_domain() as number:
            assert number in numbers
            return False
    except SloshMessageError as error:
        assert "\n" not in str(error)
        return True


def test_no_two_have_the_same(monkeypatch):
    with own_domain() as one, own_domain() as other:
        assert one != other
        assert {one, other} <= {*DOMAINS}
        assert refused(monkeypatch, one, other)


def test_another_process_has_its_own_until_it_is_killed(monkeypatch):
    with subprocess.Popen([sys.executable, "-c", HOLDER], stdout=subprocess.PIPE) as holder:
        number = int(holder.stdout.readline())
        try:
            assert refused(monkeypatch, number)
        finally:
            holder.kill()
    assert not refused(monkeypatch, number)


def test_where_somebody_speaks_already_is_left_to_them(monkeypatch):
    with own_domain() as number:
        assert number not in spoken_domains()
    rclpy.init(domain_id=number)
    node = rclpy.create_node("speaker")
    try:
        assert number in spoken_domains()
        assert refused(monkeypatch, number)
    finally:
        node.destroy_node()
        rclpy.shutdown()


def test_where_the_kernel_tells_nothing_nothing_is_known(tmp_path):
    assert spoken_domains(tmp_path / "none") == set()


def test_a_cells_name_is_claimed_by_one_run_of_a_domain():
    long = "/cell" * 60
    with claimed_namespace(7, long) as first:
        assert first
        for domain_id, namespace, free in ((7, long, False), (8, long, True), (7, "/a", True)):
            with claimed_namespace(domain_id, namespace) as own:
                assert own is free
    with claimed_namespace(7, long) as again:
        assert again
