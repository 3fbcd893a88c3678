"""Tests that a recorder killed at a random moment loses at most the last second."""

import random
import signal
import struct
import subprocess
import sys
import time

import numpy as np
import pytest
import yaml

from slosh_bag.reader import BagReader
from slosh_bringup.processes import node_environment

NAMESPACE = "/killed"
PATIENCE = 30.0


FILE_SIZE = 30_000_000  # bytes; the recorder is killed near a split now and then


def start(folder, domain):
    """Starts a message source and a recorder; waits until 5 MB have been recorded."""
    environment = node_environment(domain)
    notes = folder / "sent"
    notes.mkdir(parents=True)
    parameters = {"output": folder / "bag", "topics": f"^{NAMESPACE}", "max_bag_size": FILE_SIZE}
    arguments = [part for name, value in parameters.items() for part in ("-p", f"{name}:={value}")]
    commands = (
        ["-m", "slosh_testing.recorder_source", NAMESPACE, str(notes)],
        ["-m", "slosh_bag.nodes.recorder_node", "--ros-args", *arguments],
    )
    processes = [subprocess.Popen([sys.executable, *c], env=environment) for c in commands]
    deadline = time.monotonic() + PATIENCE
    while sum(file.stat().st_size for file in (folder / "bag").glob("*.mcap")) < 5_000_000:
        assert time.monotonic() < deadline, "nothing is recorded"
        assert all(process.poll() is None for process in processes)
        time.sleep(0.02)
    return processes


def kill_once(folder, domain, moment):
    """Kills a recorder some time after it has begun to record.

    Returns:
        the bag, when it was killed [ns], and the times of sending by topic.
    """
    source, recorder = start(folder, domain)
    try:
        time.sleep(moment)
        killed = time.time_ns()
        recorder.send_signal(signal.SIGKILL)
    finally:
        for process in (recorder, source):
            process.kill()
            process.wait()
    sent = {
        name: np.frombuffer((folder / "sent" / name).read_bytes(), np.int64)
        for name in ("accel", "image")
    }
    return folder / "bag", killed, sent


def numbers(bag):
    """Returns the numbers of the recorded messages by topic, and the reader's warnings."""
    reader = BagReader(bag)
    found = {"accel": [], "image": []}
    for message in reader.messages([f"{NAMESPACE}/{name}" for name in found]):
        name = message.topic.rsplit("/", 1)[-1]
        found[name].append(struct.unpack_from("<i", message.data, 4)[0])
        if name == "image":
            assert len(message.data) > 1280 * 720
    return {name: np.array(found[name]) for name in found}, reader.warnings


def check(bag, killed, sent):
    """Returns the lost time [s] of each topic; fails if earlier messages are missing."""
    recorded, warnings = numbers(bag)
    lost = {}
    for name, found in recorded.items():
        assert len(found) > 0
        first, last = found[0], found[-1]
        assert np.array_equal(found, np.arange(first, last + 1)), f"{name}: some are missing"
        times = sent[name]
        missing = times[(np.arange(len(times)) > last) & (times <= killed)]
        lost[name] = 1e-9 * float(killed - missing[0]) if len(missing) else 0.0
    files = sorted(bag.glob("*.mcap"), key=lambda path: int(path.stem.rsplit("_", 1)[-1]))
    assert sum("unfinished" in line for line in warnings) <= 1  # all but the last are whole
    for file in files[:-1]:
        reader = BagReader(file)
        assert sum(1 for _ in reader.messages()) > 0
        assert reader.warnings == []
    facts = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    listed = facts["relative_file_paths"]
    assert [file.name for file in files][: len(listed)] == listed
    assert len(files) - len(listed) <= 1
    return lost


def kill_and_check(folder, domain, count, seed):
    rng = random.Random(seed)
    for number in range(count):
        moment = rng.uniform(0.0, 4.0)
        lost = check(*kill_once(folder / str(number), domain, moment))
        print(f"killed after {moment:.2f} s: lost", {k: round(v, 3) for k, v in lost.items()})
        assert max(lost.values()) < 1.0, f"killed after {moment:.2f} s"


def test_a_killed_recorder_loses_less_than_a_second(tmp_path, domain):
    """After 3.4 s, when files have been split."""
    kill_and_check(tmp_path, domain, 1, seed=0)


@pytest.mark.long
def test_six_killed_recorders_lose_less_than_a_second(tmp_path, domain):
    kill_and_check(tmp_path, domain, 6, seed=2)
