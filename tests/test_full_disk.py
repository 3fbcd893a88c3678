"""Tests a recorder on a full disk: its report, the stored data, and that it continues."""

import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Header

from slosh_bag.bag_writer import Qos
from slosh_bag.reader import BagReader
from slosh_bag.recorder import Recorder
from slosh_bringup.processes import node_environment
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.run import make_executor
from slosh_testing.live_processes import until
from slosh_testing.small_disk import small_disk

BAG = Path(__file__).resolve().parents[1] / "bags" / "cut"
PATIENCE = 30.0
MEGABYTE = 2**20
# A Header of stamp 0 with the frame "a".
DATA = bytes.fromhex("000100000000000000000000020000006100")


class FullDisk:
    """A file system of 48 MB, filled by other files and a recording."""

    def __init__(self, folder):
        self.ballast, self.bag = folder / "ballast", folder / "bag"
        self.ballast.write_bytes(bytes(40 * MEGABYTE))
        self.recorder = Recorder(self.bag)
        self.recorder.add_topic("/h", "std_msgs/msg/Header", Qos())
        self.count = 0
        until(lambda: self.recorder.status().failure, "the disk to be full", act=self.add)

    def add(self):
        """Records a message with its number and incompressible bytes."""
        number = self.count.to_bytes(4, "little")
        self.recorder.add("/h", DATA + number + os.urandom(100_000), self.count)
        self.count += 1


@pytest.fixture
def disk(tmp_path):
    folder = tmp_path / "disk"
    folder.mkdir()
    with small_disk(folder, "size=48m"):
        yield FullDisk(folder)


def test_a_small_disk_fills_up_and_recording_goes_on_when_there_is_room(disk):
    recorder = disk.recorder
    status = recorder.status()
    assert "No space left on device" in status.failure
    assert status.free < MEGABYTE
    kept = [numbered(message.data) for message in BagReader(disk.bag).messages()]
    assert kept == list(range(len(kept)))
    assert len(kept) * 100_000 > 5 * MEGABYTE
    for _ in range(20):
        disk.add()
    disk.ballast.unlink()
    until(lambda: not recorder.status().failure, "the recording to go on")
    disk.add()
    recorder.close()
    status = recorder.status()
    assert (status.lost, status.interruptions) == (0, 1)
    reader = BagReader(disk.bag)
    assert [numbered(message.data) for message in reader.messages()] == list(range(disk.count))
    assert reader.warnings == []


def test_a_deleted_bag_is_noticed_counted_and_begun_anew(tmp_path):
    recorder = Recorder(tmp_path / "bag")
    recorder.add_topic("/h", "std_msgs/msg/Header", Qos())
    for number in range(10):
        recorder.add("/h", DATA + number.to_bytes(4, "little"), number)
    until(lambda: recorder.status().age == 0.0 and recorder.status().size, "a flush")
    shutil.rmtree(tmp_path / "bag")
    until(lambda: recorder.status().lost, "the loss to be noticed")
    assert recorder.status().lost == 10
    recorder.add("/h", DATA + (10).to_bytes(4, "little"), 10)
    recorder.close()
    reader = BagReader(tmp_path / "bag")
    assert [numbered(message.data) for message in reader.messages()] == [10]
    assert reader.metadata()["messages_lost"] == "10"
    assert {path.suffix for path in (tmp_path / "bag").iterdir()} == {".mcap", ".yaml"}


def numbered(data):
    return int.from_bytes(data[len(DATA) :][:4], "little")


@pytest.fixture
def node(domain):
    rclpy.init()
    node = rclpy.create_node("watcher")
    yield node
    node.destroy_node()
    rclpy.shutdown()


def test_the_node_lives_on_and_says_so_in_the_diagnostics(node, domain, tmp_path):
    heard = []

    def hear(message):
        heard.extend(status for status in message.status if status.name == "/recorder")

    publisher = node.create_publisher(Header, "full/header", qos.STREAM_OUT)
    node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, hear, qos.DIAGNOSTICS)
    executor = make_executor()
    executor.add_node(node)
    bag = tmp_path / "bag"
    command = [sys.executable, "-m", "slosh_bag.nodes.recorder_node", "--ros-args"]
    parameters = ["-p", f"output:={bag}", "-p", "topics:=^/full/", "-p", "exclude:=^/diagnostics"]
    recorder = subprocess.Popen([*command, *parameters], env=node_environment(domain))

    def spin():
        executor.spin_once(timeout_sec=0.05)

    def publish(number):
        publisher.publish(Header(frame_id=str(number)))

    def last(level, part):
        return bool(heard) and heard[-1].level == level and part in heard[-1].message

    def facts():
        return {pair.key: pair.value for status in heard[-1:] for pair in status.values}

    def limit(size):
        _, hard = resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (size, hard))

    try:
        until(lambda: publisher.get_subscription_count() > 0, "the recorder", act=spin)
        publish(0)
        until(lambda: facts().get("messages") == "1", "the first message", act=spin)
        until(lambda: facts()["oldest unwritten message [s]"] == "0.00", "its flush", act=spin)
        limit(0)
        publish(1)
        until(lambda: last(DiagnosticStatus.ERROR, "nothing has been written"), "ERROR", act=spin)
        for part in (str(bag / "bag_0.mcap"), "MB free", "free some space"):
            assert part in heard[-1].message
        publish(2)
        until(lambda: facts()["queue"] == "2", "both messages to wait", act=spin)
        limit(resource.RLIM_INFINITY)
        until(lambda: last(DiagnosticStatus.WARN, "resumed in bag_"), "the new file", act=spin)
        assert "0 messages were lost" in heard[-1].message
        publish(3)
        until(lambda: facts()["messages"] == "4", "the last message", act=spin)
        assert recorder.poll() is None
        recorder.terminate()
        assert recorder.wait(PATIENCE) == 0
    finally:
        recorder.kill()
        recorder.wait()
    reader = BagReader(bag)
    frames = [reader.decode(message).frame_id for message in reader.messages()]
    assert frames == ["0", "1", "2", "3"]
    assert len(list(bag.glob("*.mcap"))) == 2


@pytest.mark.long
@pytest.mark.parametrize(
    "words",
    [
        ("slosh_bringup.cli", "demo", "-o"),
        ("slosh_bringup.cli", "replay", str(BAG), "-o"),
        ("slosh_bag.nodes.recorder_node", "--ros-args", "-p"),
    ],
    ids=["demo", "replay", "recorder"],
)
def test_a_folder_that_is_read_only_is_one_line_before_anything_starts(tmp_path, words):
    folder = tmp_path / "disk"
    folder.mkdir()
    output = folder / "out"
    with small_disk(folder, "ro"):
        last = f"output:={output}" if words[-1] == "-p" else str(output)
        done = subprocess.run(
            [sys.executable, "-m", *words, last], capture_output=True, text=True, timeout=PATIENCE
        )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.endswith(f"{output}: Read-only file system")
