"""A cell begins when its nodes are ready, and says who is not."""

import json
import os
import signal
import time

import pytest

from slosh_bag.reader import BagReader
from slosh_testing.live_processes import PATIENCE, live_process

pytestmark = pytest.mark.long
COMPILATION = 300.0
"""Of everything, on a busy machine [s]."""


@pytest.mark.timeout(2 * COMPILATION)
def test_a_demo_without_compiled_code_waits_for_it_and_misses_nothing(tmp_path):
    folder = tmp_path / "out" / "latest"
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    words = ("demo", "--motion", "l", "-o", str(folder.parent))
    with live_process(*words, output=tmp_path / "words", environment=environment) as running:
        assert running.process.wait(COMPILATION) == 0, running.said
        said = running.said
    for node in ("estimator", "camera"):
        waiting = f"{node}: compiling, once on this machine"
        assert said.index(waiting) < said.index(f"{node}: ready") < said.index("ready: recording")
    result = json.loads((folder / "result.json").read_text())
    assert result["agreements"][0]["count"] > 50
    sent = dict.fromkeys(("/slosh/accel", "/slosh/free_surface", "/slosh/estimate"), 0)
    first = dict(sent)
    for message in BagReader(folder / "bag").messages(list(sent)):
        sent[message.topic] += 1
        first[message.topic] = first[message.topic] or message.log_ns
    assert sent["/slosh/accel"] == 6465
    # From the very first sample on, not from the middle of the motion.
    assert abs(first["/slosh/estimate"] - first["/slosh/accel"]) < 1_000_000_000
    assert abs(first["/slosh/free_surface"] - first["/slosh/accel"]) < 1_000_000_000
    for node in ("estimator", "camera"):
        log = (folder / "logs" / f"{node}.log").read_text()
        assert "not ready yet: compiling slosh_" in log
        assert log.count("compiling") == 1
    # Where it is no terminal each line is kept, and 32 functions are compiled by five nodes.
    assert len(said.partition("ready: recording")[0].splitlines()) <= 20


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
    assert "camera has sent no diagnostics for 6" in (folder / "report.html").read_text()
    assert not recorded_motion(folder / "bag")


def recorded_motion(bag):
    """Whether the motion has begun."""
    return any(True for _ in BagReader(bag).messages(["/slosh/accel"]))
