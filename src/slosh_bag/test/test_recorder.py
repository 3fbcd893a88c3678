"""The recorder's core: what stops it, what does not, and how often it flushes."""

import itertools

import pytest

from slosh_bag.bag_writer import BagWriter, Qos
from slosh_bag.reader import BagReader
from slosh_bag.recorder import FLUSH_PERIOD, QUEUE_LENGTH, Recorder

HEADER = "std_msgs/msg/Header"
# A Header of stamp 0 with the frame "a".
DATA = bytes.fromhex("000100000000000000000000020000006100")
SECOND = 1_000_000_000


@pytest.fixture
def flushes(monkeypatch):
    """Each flush of a writer, as the number of messages written before it."""
    seen = []
    original = BagWriter.flush

    def flush(writer):
        original(writer)
        seen.append(sum(writer.counts.values()))

    monkeypatch.setattr(BagWriter, "flush", flush)
    return seen


@pytest.mark.parametrize(
    "stamp",
    [lambda n: SECOND, lambda n: 100 * SECOND - n * SECOND, lambda n: SECOND + n],
    ids=["standing", "running back", "slow"],
)
def test_flushes_do_not_depend_on_the_messages_clock(tmp_path, flushes, stamp):
    steps = itertools.count()
    recorder = Recorder(tmp_path / "run", clock=lambda: 0.1 * FLUSH_PERIOD * next(steps))
    recorder.add_topic("/h", HEADER, Qos())
    for number in range(100):
        recorder.add("/h", DATA, stamp(number))
    recorder.close()
    inside = [count for count in flushes if 0 < count < 100]
    assert max(b - a for a, b in itertools.pairwise([0, *inside, 100])) <= 10


@pytest.mark.parametrize("text", [None, "no such type here"], ids=["absent", "unreadable"])
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
    assert recorder.status().failure == f"{recorder.path}: MemoryError"
