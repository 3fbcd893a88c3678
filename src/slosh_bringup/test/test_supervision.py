"""Tests that a hanging node of a run is restarted, using real processes."""

import os
import signal
import subprocess
import sys
import time

import pytest

from slosh_bringup.live.run import HANGS, OtherCells, Supervision
from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment, restarted


@pytest.fixture
def cell(tmp_path, domain):
    """Yields a running monitor node, its supervision and the printed lines."""
    told = []
    with NodeGroup("/slosh", tmp_path, node_environment(domain)) as group:
        process = NodeProcess("monitor")
        group.start(process)
        yield group, Supervision(group, [process], told.append, OtherCells()), told


def look_until_it_runs_again(group, supervision, before):
    deadline = time.monotonic() + 20.0
    while group.pid("monitor") == before:
        assert time.monotonic() < deadline
        assert supervision.look(began=True, silences={"monitor": 0.0, "camera": 0.0}) is None
        time.sleep(0.02)


def test_a_node_that_hangs_is_killed_and_started_again(cell):
    group, supervision, told = cell
    before = group.pid("monitor")
    os.kill(before, signal.SIGSTOP)  # what hangs hears no SIGTERM
    silences = {"monitor": HANGS + 1.0, "camera": 0.5}
    assert supervision.look(began=True, silences=silences) is None
    look_until_it_runs_again(group, supervision, before)
    hangs, again = told
    assert hangs == "node monitor runs but has sent no diagnostics for 31 s: it is killed"
    assert again.startswith("node monitor ended with exit code -9: Killed")
    assert again.endswith("it is restarted")
    assert supervision.problems == told
    # It is as old as its start, not as the silence: nobody heard the one before.
    after = group.pid("monitor")
    assert supervision.look(began=True, silences=silences) is None
    assert supervision.look(began=True, silences=silences) is None
    assert (group.pid("monitor"), len(told)) == (after, 2)


def test_a_node_is_not_killed_without_reason(cell):
    group, supervision, told = cell
    before = group.pid("monitor")
    for began, silences in (
        (True, {"monitor": HANGS - 1.0, "camera": 0.5}),  # not long enough
        (True, {"monitor": 60.0, "camera": 60.0}),  # nobody is heard: it is not its fault
        (False, {"monitor": 60.0, "camera": 0.5}),  # still starting
        (True, {"monitor": 0.5, "camera": 60.0}),  # another, which is gone
    ):
        assert supervision.look(began=began, silences=silences) is None
        os.kill(before, 0)
        assert group.pid("monitor") == before
        assert group.ended() == {}
        assert told == []


# A second signal while the report is made ends the process, wherever it comes.


IN_A_CALLBACK = """
import ctypes, os, signal
from slosh_bringup.stop_request import StopRequest

def called_from_c():
    os.kill(os.getpid(), signal.SIGTERM)
    return sum(range(1000))

with StopRequest() as stop:
    called_from_c()
    with stop.finishing(lambda: os._exit(7)):
        {again}
    called_from_c()
    print(stop.reason)
"""


def ends(again):
    script = IN_A_CALLBACK.format(again=again)
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stderr == ""
    return done.returncode, done.stdout.strip()


def test_it_is_not_lost_in_a_function_that_a_library_calls():
    """A stop request arrives even during a C callback, where an exception would be ignored."""
    assert ends("ctypes.CFUNCTYPE(ctypes.c_int)(called_from_c)()") == (7, "")


def test_before_and_after_it_asks_for_the_end_and_no_more():
    assert ends("pass") == (0, "SIGTERM")


def test_a_node_that_is_restarted_does_not_believe_that_the_liquid_is_at_rest():
    name = "estimator"
    first = NodeProcess(name, parameters={"starts_at_rest": "true", "rate": "50.0"})
    assert restarted(first, 1).parameters == {"starts_at_rest": "false", "rate": "50.0"}
    # A file may say so, too: the single parameter wins.
    assert restarted(NodeProcess(name), 1).parameters["starts_at_rest"] == "false"
