"""Tests that a cell begins when its nodes are ready, and names those that are not."""

import os
import re
import signal
import time

import pytest

from slosh_bag.reader import BagReader
from slosh_testing.live_processes import PATIENCE, live_process

pytestmark = pytest.mark.long


@pytest.mark.timeout(2 * PATIENCE)
def test_a_node_that_never_gets_ready_ends_the_run_with_its_name(tmp_path):
    folder = tmp_path / "out" / "latest"
    with live_process("demo", "-o", str(folder.parent), output=tmp_path / "words") as running:
        running.wait_for(lambda: "camera" in running.nodes(), "the camera")
        camera = running.nodes()["camera"]
        os.kill(camera, signal.SIGSTOP)
        deadline = time.monotonic() + PATIENCE
        while "waiting for camera (no diagnostics received yet)" not in running.said:
            assert time.monotonic() < deadline, running.said
            time.sleep(0.05)
        assert running.process.wait(PATIENCE) == 1
        said = running.said
    assert "nothing was measured, because not all nodes became ready: camera has sent no" in said
    report = (folder / "report.html").read_text()
    assert re.search(r"became ready: camera has sent no diagnostics for \d+ s", report)
    assert not recorded_motion(folder / "bag")


def recorded_motion(bag):
    """Returns whether the bag contains an acceleration, so that the motion has begun."""
    return any(True for _ in BagReader(bag).messages(["/slosh/accel"]))
