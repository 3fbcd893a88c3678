"""What comes while a process does not run waits for it, longer than the sender keeps it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from slosh_bringup.processes import node_environment
from slosh_msgs_py.node.domain import own_domain

HERE = Path(__file__).parent


@pytest.mark.long
def test_a_reader_that_stands_still_for_a_moment_misses_nothing():
    """As a recorder that starts on a loaded machine: the sender keeps one second.

    From two seconds on Fast DDS takes a process for dead.
    """
    with own_domain() as domain:
        given = {**os.environ, **node_environment(domain)}
        source = subprocess.Popen([sys.executable, HERE / "paced_source.py", "20"], env=given)
        try:
            said = heard_by_a_reader_that_stands_still(given)
        finally:
            source.kill()
            source.wait()
    missing, _, _, count = said.split()
    assert (int(missing), int(count) > 4000) == (0, True), said


def heard_by_a_reader_that_stands_still(environment: dict[str, str]) -> str:
    """What it says in the end."""
    with subprocess.Popen(
        [sys.executable, HERE / "late_reader.py", "6"],
        env=environment, stdout=subprocess.PIPE, text=True,
    ) as reader:  # fmt: skip
        try:
            assert reader.stdout is not None
            # The middleware may say things before.
            assert "reads\n" in iter(reader.stdout.readline, "")
            reader.send_signal(signal.SIGSTOP)
            time.sleep(1.6)
            reader.send_signal(signal.SIGCONT)
            *_, said = reader.communicate(timeout=30)[0].splitlines()
        finally:
            reader.kill()
    return said
