"""Tests the recorder: errors, full disks, and how often it flushes."""

import contextlib
import errno
import itertools
import os
import resource
import threading

import pytest
import yaml
from mcap.reader import make_reader

from slosh_bag import recorder as recorder_module
from slosh_bag.bag_writer import BagWriter, Qos
from slosh_bag.mcap_files.mcap_file import McapFile
from slosh_bag.reader import BagReader
from slosh_bag.recorder import FLUSH_PERIOD, QUEUE_LENGTH, Recorder
from slosh_testing.live_processes import until

HEADER = "std_msgs/msg/Header"
# A Header of stamp 0 with the frame "a".
DATA = bytes.fromhex("000100000000000000000000020000006100")
SECOND = 1_000_000_000
PATIENCE = 20.0


def noise(number):
    """Returns incompressible bytes that differ for each number."""
    return DATA + number.to_bytes(4, "little") + os.urandom(2000)


def contents(folder):
    """Returns the message numbers in the order in which the bag gives them."""
    messages = BagReader(folder).messages()
    return [int.from_bytes(message.data[len(DATA) :][:4], "little") for message in messages]


def is_finished(path):
    with path.open("rb") as stream:
        return make_reader(stream, validate_crcs=True).get_summary() is not None


@pytest.fixture
def flushes(monkeypatch):
    """Records each flush of a writer as the number of messages written before it."""
    seen = []
    original = BagWriter.flush

    def flush(writer):
        original(writer)
        seen.append(sum(writer.counts.values()))

    monkeypatch.setattr(BagWriter, "flush", flush)
    return seen


@contextlib.contextmanager
def no_more_than(size):
    """Limits the size of files of this process, like a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture
def started(tmp_path):
    """A recorder that has written a hundred messages."""
    recorder = Recorder(tmp_path / "run")
    recorder.add_topic("/h", HEADER, Qos())
    for number in range(100):
        recorder.add("/h", noise(number), number)
    until(lambda: recorder.status().age == 0.0 and recorder.status().written == {"/h": 100})
    yield recorder
    recorder.close()


@pytest.mark.parametrize(
    "stamp",
    [lambda n: SECOND, lambda n: 100 * SECOND - n * SECOND, lambda n: SECOND + n],
    ids=["standing", "running back", "slow"],
)
def test_flushes_do_not_depend_on_the_messages_clock(tmp_path, flushes, stamp):
    steps = itertools.count()
    now = 0.0
    recorder = Recorder(tmp_path / "run", clock=lambda: now)
    recorder.add_topic("/h", HEADER, Qos())
    for number in range(100):
        now = 0.1 * FLUSH_PERIOD * next(steps)
        recorder.add("/h", DATA, stamp(number))
    recorder.close()
    inside = [count for count in flushes if 0 < count < 100]
    assert max(b - a for a, b in itertools.pairwise([0, *inside, 100])) <= 12


@pytest.mark.parametrize("text", [None, "float64 = {"], ids=["absent", "unreadable"])
def test_a_topic_without_a_definition_does_not_stop_the_others(tmp_path, monkeypatch, text):
    if text:
        folder = tmp_path / "install" / "share" / "odd_msgs" / "msg"
        folder.mkdir(parents=True)
        (folder / "Odd.msg").write_text(text)
        monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    recorder = Recorder(tmp_path / "run")
    recorder.add_topic("/h", HEADER, Qos())
    recorder.add_topic("/odd", "odd_msgs/msg/Odd", Qos())
    for number in range(3):
        recorder.add("/odd", b"\0\1\0\0", number)
        recorder.add("/h", DATA, number)
    recorder.close()
    status = recorder.status()
    assert (status.written, status.failure) == ({"/h": 3}, "")
    assert status.size == 3 * len(DATA)
    assert list(status.refused) == ["/odd"]
    assert "\n" not in status.refused["/odd"]
    assert [message.data for message in BagReader(tmp_path / "run").messages()] == [DATA] * 3


def test_any_failure_is_told_and_the_recorder_still_closes(tmp_path, monkeypatch):
    def fail(*_):
        raise MemoryError

    monkeypatch.setattr(BagWriter, "write", fail)
    recorder = Recorder(tmp_path / "run")
    recorder.add_topic("/h", HEADER, Qos())
    for number in range(QUEUE_LENGTH + 10):
        recorder.add("/h", DATA, number)
    recorder.close()
    status = recorder.status()
    assert status.failure.endswith(": MemoryError")
    assert status.lost == QUEUE_LENGTH + 10


def test_a_full_disk_loses_nothing_and_recording_goes_on_by_itself(started):
    with no_more_than(0):
        for number in range(100, 200):
            started.add("/h", noise(number), number)
        until(lambda: started.status().failure)
        status = started.status()
        assert os.strerror(errno.EFBIG) in status.failure
        assert str(started.path.parent / "run_0.mcap") in status.failure
        # What was written before the disk was full can be read while it is.
        assert contents(started.path.parent) == list(range(100))
    until(lambda: not started.status().failure)
    for number in range(200, 300):
        started.add("/h", noise(number), number)
    started.close()
    status = started.status()
    assert (status.lost, status.interruptions, status.failure) == (0, 1, "")
    assert status.written == {"/h": 300}
    assert contents(started.path.parent) == list(range(300))
    assert all(map(is_finished, started.path.parent.glob("*.mcap")))
    document = yaml.safe_load((started.path.parent / "metadata.yaml").read_text())
    files = document["rosbag2_bagfile_information"]["files"]
    assert [file["message_count"] for file in files] == [100, 200]


def test_a_recording_that_ends_on_a_full_disk_keeps_what_was_written(started):
    with no_more_than(0):
        for number in range(100, 150):
            started.add("/h", noise(number), number)
        until(lambda: started.status().failure)
        started.close()
    assert (started.status().lost, started.status().lost_meanwhile) == (50, 50)
    assert contents(started.path.parent) == list(range(100))


def test_a_failure_is_told_together_with_the_room_that_is_left(tmp_path):
    asked, answered = threading.Event(), threading.Event()

    def left():
        yield 6
        asked.set()
        assert answered.wait(PATIENCE)
        yield from itertools.repeat(5)

    free = left()
    recorder = Recorder(tmp_path / "run", clock=lambda: 0.0, free=lambda _: next(free))
    recorder.add_topic("/h", HEADER, Qos())
    recorder.add("/h", noise(0), -1)  # cannot be written
    assert asked.wait(PATIENCE)
    meanwhile = recorder.status()
    answered.set()
    assert not meanwhile.failure
    until(lambda: recorder.status().failure)
    assert recorder.status().free == 5
    recorder.close()


def test_a_new_file_waits_until_there_is_room_for_what_waits(tmp_path):
    free = 10**9
    now = 0.0
    recorder = Recorder(tmp_path / "run", clock=lambda: now, free=lambda _: free)
    recorder.add_topic("/h", HEADER, Qos())
    with no_more_than(0):
        recorder.add("/h", DATA, 1)
        now = 1.0
        free = recorder_module.ROOM
        until(lambda: recorder.status().failure)
    until(lambda: recorder.status().free == free)
    now = 100.0
    until(lambda: recorder._retry_at > now)
    assert recorder.status().failure
    assert recorder.status().since == pytest.approx(99.0)
    free += 2 * len(DATA)
    now = 200.0
    until(lambda: not recorder.status().failure)
    recorder.close()
    assert recorder.status().written == {"/h": 1}


def test_when_the_disk_will_be_full_is_known_from_the_rate(tmp_path):
    now, free = 0.0, 10_000_000
    recorder = Recorder(tmp_path / "run", clock=lambda: now, free=lambda _: free)
    recorder.add_topic("/h", HEADER, Qos())
    for second in range(1, 11):
        for number in range(10):
            recorder.add("/h", noise(number), number)
        now = float(second)
        until(lambda: recorder._sizes[-1][0] == now and recorder.status().age < 1.0)  # noqa: B023
    status = recorder.status()
    assert status.rate == pytest.approx(20_000.0, rel=0.2)
    assert status.time_left == pytest.approx(free / status.rate)
    recorder.close()


def test_a_failed_write_leaves_the_file_as_it_was(tmp_path):
    file = McapFile(tmp_path / "a.mcap", "ros2")
    channel = file.add_channel("/h", file.add_schema(HEADER, b"uint8 x"), {})
    for number in range(10):
        file.add(channel, number, number, number, noise(number))
    file.flush()
    good = file.path.read_bytes()
    file.add(channel, 10, 10, 10, noise(10))
    for limit in (len(good), len(good) + 7, len(good) + 1500):
        with no_more_than(limit), pytest.raises(OSError, match="File too large"):
            file.flush()
        assert file.path.read_bytes() == good
    file.finish({})
    with file.path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert len(list(reader.iter_messages())) == 11
        assert reader.get_summary().statistics.message_count == 11
