"""Tests that a repeatedly stopped recorder reports one count of missed messages everywhere."""

import json
import os
import re
import signal
import time

import pytest

from slosh_bag.reader import BagReader
from slosh_bringup.live.run_data import read_run
from slosh_replay.recorded_run import RecordedRun
from slosh_testing.live_processes import live_process, until

pytestmark = pytest.mark.long

TIMES, PAUSE, BETWEEN = 2, 2.5, 0.5
"""How often it is stopped, for how long and how soon again [s]: longer than a publisher at 1 kHz
keeps its messages for a reader that does not fetch them."""
INPUT = "/slosh/accel"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stopped")
    words = "demo", "--motion", "l", "--repeat", "2", "-o", str(folder / "out")
    with live_process(*words, output=folder / "words") as demo:
        demo.wait_until_ready()
        demo.wait_for_recording(folder / "out" / "latest" / "bag")
        recorder = demo.nodes()["recorder"]
        try:
            for _ in range(TIMES):
                os.kill(recorder, signal.SIGSTOP)
                time.sleep(PAUSE)
                os.kill(recorder, signal.SIGCONT)
                time.sleep(BETWEEN)
        except ProcessLookupError:
            pass
        until(lambda: demo.process.poll() is not None, "the end of the demonstration")
        yield folder / "out" / "latest", demo.process.returncode, demo.said


def test_what_is_lost_is_one_count_everywhere_and_fails_the_run(run):
    folder, code, said = run
    data = read_run(RecordedRun(folder / "bag"))
    lost = sum(data.lost().values())
    assert lost > 0, "nothing was lost: the recorder was stopped too shortly"
    assert code == 1
    assert int(BagReader(folder / "bag").metadata()["messages_lost"]) == lost
    assert re.search(rf"^lost messages +{lost} \(", said, re.MULTILINE)
    assert f"{lost} messages are lost" in said
    figures = json.loads((folder / "result.json").read_text())
    assert sum(figures["lost"].values()) == lost
    log = (folder / "logs" / "recorder.log").read_text()
    assert f", {lost} lost" in log
    assert f">{lost}<" in (folder / "report.html").read_text()


def test_the_count_is_what_the_bag_lacks(run):
    """The simulated cell tells how much it has published."""
    data = read_run(RecordedRun(run[0] / "bag"))
    if not data.published:
        pytest.skip("the cell's summary, a single message, was lost with the others")
    for topic in (INPUT, "/slosh/imu", "/slosh/pose", "/slosh/cell/truth"):
        lacking = data.published[topic] - data.topics[topic].count
        assert data.noted_lost.get(topic, 0) == lacking
