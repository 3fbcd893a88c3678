"""Tests bags of several files: each one is complete, and together they are one bag."""

import os

import pytest
import yaml
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader

from slosh_bag.bag_writer import BagWriter, Qos, Split
from slosh_bag.reader import BagReader

HEADER = "std_msgs/msg/Header"
DATA = bytes.fromhex("000100000000000000000000020000006100")
SECOND = 1_000_000_000


def information(folder):
    return yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


def records(path):
    with path.open("rb") as stream:
        return list(StreamReader(stream, validate_crcs=True).records)


def summary(path):
    with path.open("rb") as stream:
        return make_reader(stream, validate_crcs=True).get_summary()


@pytest.fixture
def bag(tmp_path):
    """Writes a bag of twelve files of ten messages each, with one early latched message."""
    folder = tmp_path / "run"
    with BagWriter(folder, custom={"run": "7"}, split=Split(duration=10 * SECOND)) as writer:
        writer.add_topic("/h", HEADER)
        writer.add_topic("/latched", HEADER, Qos(durability="transient_local"))
        writer.add_topic("/silent", "slosh_msgs/msg/LimitEvent")
        writer.write("/latched", DATA, 5 * SECOND)
        for number in range(120):
            writer.write("/h", DATA, (5 + number) * SECOND, (4 + number) * SECOND)
    return folder


def test_each_file_is_complete_in_itself(bag):
    for number in range(12):
        found = records(bag / f"run_{number}.mcap")
        first = next(i for i, record in enumerate(found) if isinstance(record, Message))
        before = found[:first]
        assert {r.topic for r in before if isinstance(r, Channel)} == {"/h", "/latched", "/silent"}
        assert {r.name for r in before if isinstance(r, Schema)} == {
            HEADER, "slosh_msgs/msg/LimitEvent",
        }  # fmt: skip
        end = summary(bag / f"run_{number}.mcap")
        assert end.statistics.message_count == 10 + (number == 0)
        assert end.statistics.message_start_time == (5 + 10 * number) * SECOND
        assert end.statistics.message_end_time == (14 + 10 * number) * SECOND
        assert BagReader(bag / f"run_{number}.mcap").metadata() == {"run": "7"}


def test_metadata_lists_the_files_with_their_own_times(bag):
    facts = information(bag)
    names = [f"run_{number}.mcap" for number in range(12)]
    assert facts["relative_file_paths"] == names
    assert facts["message_count"] == 121
    assert facts["starting_time"] == {"nanoseconds_since_epoch": 5 * SECOND}
    assert facts["duration"] == {"nanoseconds": 119 * SECOND}
    assert facts["files"][11] == {
        "path": "run_11.mcap",
        "starting_time": {"nanoseconds_since_epoch": 115 * SECOND},
        "duration": {"nanoseconds": 9 * SECOND},
        "message_count": 10,
    }
    counts = {
        topic["topic_metadata"]["name"]: topic["message_count"]
        for topic in facts["topics_with_message_count"]
    }
    assert counts == {"/h": 120, "/latched": 1, "/silent": 0}


def test_metadata_is_there_from_the_start_and_follows(tmp_path):
    folder = tmp_path / "run"
    writer = BagWriter(folder, split=Split(duration=10 * SECOND))
    assert information(folder)["relative_file_paths"] == ["run_0.mcap"]
    writer.add_topic("/h", HEADER)
    writer.write("/h", DATA, 0)
    writer.flush()
    assert information(folder)["topics_with_message_count"][0]["message_count"] == 1
    writer.write("/h", DATA, 10 * SECOND)
    facts = information(folder)
    assert facts["relative_file_paths"] == ["run_0.mcap", "run_1.mcap"]
    assert facts["files"][0]["message_count"] == 1
    writer.close()
    assert information(folder)["message_count"] == 2
    assert sorted(path.name for path in folder.iterdir()) == [
        "metadata.yaml", "run_0.mcap", "run_1.mcap",
    ]  # fmt: skip


def test_a_half_written_metadata_never_replaces_a_whole_one(tmp_path, monkeypatch):
    writer = BagWriter(tmp_path / "run")
    before = information(tmp_path / "run")
    writer.add_topic("/h", HEADER)
    writer.write("/h", DATA, 0)
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError(5, "cut")))
    with pytest.raises(OSError, match="cut"):
        writer.flush()
    assert information(tmp_path / "run") == before


def test_a_file_that_is_large_enough_is_followed_by_the_next(tmp_path):
    folder = tmp_path / "run"
    with BagWriter(folder, split=Split(size=50_000)) as writer:
        writer.add_topic("/h", HEADER)
        for number in range(100):
            writer.write("/h", DATA + os.urandom(4000), number)
            writer.flush()
    sizes = [(folder / file["path"]).stat().st_size for file in information(folder)["files"]]
    assert len(sizes) == 9
    assert all(50_000 <= size < 60_000 for size in sizes[:-1])
    assert information(folder)["message_count"] == 100
