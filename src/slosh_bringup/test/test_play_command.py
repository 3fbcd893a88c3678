"""Tests `slosh play`: one-line errors and a regular end."""

import os
import signal
import subprocess
import sys
import time

import pytest
from geometry_msgs.msg import AccelStamped
from rclpy.serialization import serialize_message

from slosh_bag.bag_writer import BagWriter
from slosh_bringup.cli.main import main

PATIENCE = 30.0
BEGIN = 1_700_000_000_000_000_000


@pytest.fixture
def bag(tmp_path):
    folder = tmp_path / "bag"
    with BagWriter(folder) as writer:
        for topic in ("/slosh/accel", "/slosh/other"):
            writer.add_topic(topic, "geometry_msgs/msg/AccelStamped")
            for k in range(500):
                writer.write(topic, serialize_message(AccelStamped()), BEGIN + k * 1_000_000)
    return folder


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--rate", "0"], "rate = 0: must lie in [0.01, 1000]"),
        (["--rate", "nan"], "rate = nan"),
        (["--start", "2"], "start = 2 s: the bag ends after 0.499 s"),
        (["--duration", "-1"], "duration = -1 s"),
        (["--clock", "1e9"], "clock = 1e+09 Hz"),
        (["--topics", "/nothing"], "no topic is selected (topics: /slosh/accel, /slosh/other)"),
        (["--exclude", "."], "nothing to play"),
        (["--topics", "("], "not a regular expression"),
        (["--namespace", "a b"], "not a valid ROS name"),
        (["--wait", "-1"], "--wait -1: must be from 0 to 3600 s"),
        (["--subscribers", "-1"], "--subscribers -1: must be from 0 to 1000"),
    ],
)
def test_a_wrong_request_is_one_line(bag, options, said, capsys):
    assert main(["play", str(bag), *options]) == 2
    told = capsys.readouterr().err
    assert told.startswith("slosh play: ")
    assert told.count("\n") == 1
    assert said in told


@pytest.fixture
def start(bag, tmp_path):
    """Starts `slosh play` on the bag, with its output in a file."""
    processes = []
    words = tmp_path / "words"

    def begin(*options):
        command = [sys.executable, "-m", "slosh_bringup.cli", "play", str(bag), *options]
        with words.open("w") as output:
            processes.append(
                subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True)
            )
        return processes[-1], words

    yield begin
    for process in processes:
        process.kill()
        process.wait()


@pytest.mark.long
def test_it_plays_to_the_end_with_a_bar(start):
    process, words = start("--wait", "0", "--rate", "20", "--inputs")
    assert process.wait(PATIENCE) == 0
    told = words.read_text()
    assert "500 messages played" in told
    assert "play bag: 100%" in told


@pytest.mark.long
def test_an_interrupt_tells_how_far_it_came(start):
    process, words = start("--wait", "0", "--rate", "0.01")
    wait_for(words, "playback starts anyway")
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(PATIENCE) == 0
    assert "play bag: 0%" in words.read_text()
    assert "100%" not in words.read_text()


def wait_for(words, text):
    deadline = time.monotonic() + PATIENCE
    while text not in words.read_text():
        assert time.monotonic() < deadline, "it did not begin to play"
        time.sleep(0.02)


@pytest.mark.first(1)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_an_interrupt_ends_it_without_a_traceback(start, number):
    process, words = start("--wait", "0", "--loop")
    wait_for(words, "playback starts anyway")
    os.killpg(process.pid, number)
    assert process.wait(PATIENCE) == 0
    told = words.read_text()
    assert "messages played" in told
    assert "Traceback" not in told
