"""What comes while a process does not run waits for it, longer than the sender keeps it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from slosh_bringup.processes import node_environment
from slosh_msgs_py.node.domain import own_domain

HERE = Path(__file__).parent


def test_a_reader_that_stands_still_for_two_seconds_misses_nothing():
    """As a recorder that starts on a loaded machine: the sender keeps one second."""
    with own_domain() as domain:
        given = {**os.environ, **node_environment(domain)}
        source = subprocess.Popen([sys.executable, HERE / "paced_source.py", "20"], env=given)
        reader = subprocess.Popen(
            [sys.executable, HERE / "late_reader.py", "6"],
            env=given, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert reader.stdout is not None
        assert reader.stdout.readline() == "reads\n"
        reader.send_signal(signal.SIGSTOP)
        time.sleep(2.0)
        reader.send_signal(signal.SIGCONT)
        *_, said = reader.communicate(timeout=30)[0].splitlines()
        source.kill()
        source.wait()
    missing, _, _, count = said.split()
    assert (int(missing), int(count) > 4000) == (0, True), said
