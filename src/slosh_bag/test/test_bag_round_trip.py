"""Bags: written, read by others, killed."""

import subprocess
import sys
import time

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from slosh_bag.bag_writer import BagWriter, Qos
from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_bag.recorder import Recorder
from slosh_testing.bags import HEADER, header

SURFACE = "slosh_msgs/msg/FreeSurface"


def write(folder, count=50):
    with BagWriter(folder, custom={"clocks": "unrelated"}) as bag:
        bag.add_topic("/header", HEADER, Qos("reliable", "transient_local", 5))
        bag.add_topic("/empty", SURFACE)
        for number in range(count):
            bag.write("/header", header(number), 1_000_000_000 + number * 1000)
    return folder


@pytest.fixture
def bag(tmp_path):
    return write(tmp_path / "run")


def test_bytes_come_back_untouched(bag):
    reader = BagReader(bag)
    messages = list(reader.messages())
    assert [message.data for message in messages] == [header(n) for n in range(50)]
    assert [message.log_ns for message in messages] == [
        1_000_000_000 + n * 1000 for n in range(50)
    ]
    assert reader.decode(messages[3]).frame_id == "frame 3"
    assert reader.topics()["/header"].count == 50
    assert reader.metadata() == {"clocks": "unrelated"}
    assert reader.warnings == []


def test_rosbags_and_mcap_ros2_decode_every_message(bag):
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        frames = [
            reader.deserialize(data, connection.msgtype).frame_id
            for connection, _, data in reader.messages()
        ]
    assert frames == [f"frame {number}" for number in range(50)]
    with (bag / "run_0.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        decoded = [message.frame_id for *_, message in reader.iter_decoded_messages()]
    assert decoded == frames


def test_what_rosbag2_wants_is_there(bag):
    document = yaml.safe_load((bag / "metadata.yaml").read_text())
    information = document["rosbag2_bagfile_information"]
    assert information["version"] == 9
    assert information["storage_identifier"] == "mcap"
    assert information["message_count"] == 50
    assert information["relative_file_paths"] == ["run_0.mcap"]
    topic = information["topics_with_message_count"][0]
    assert topic["topic_metadata"]["type_description_hash"].startswith("RIHS01_")
    with (bag / "run_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
    (channel,) = [c for c in summary.channels.values() if c.topic == "/header"]
    assert channel.message_encoding == "cdr"
    (offered,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
    assert (offered["reliability"], offered["durability"]) == ("reliable", "transient_local")
    schema = summary.schemas[channel.schema_id]
    assert (schema.name, schema.encoding) == (HEADER, "ros2msg")
    assert b"MSG: builtin_interfaces/Time" in schema.data


def test_an_existing_bag_is_not_overwritten(bag):
    before = (bag / "run_0.mcap").read_bytes()
    with pytest.raises(SloshBagError, match="exists already"):
        BagWriter(bag)
    assert (bag / "run_0.mcap").read_bytes() == before


def test_an_unknown_type_is_named(tmp_path):
    with BagWriter(tmp_path / "b") as writer:
        with pytest.raises(SloshBagError, match="nowhere_msgs"):
            writer.add_topic("/t", "nowhere_msgs/msg/Thing")
        writer.add_topic("/h", HEADER)
        writer.write("/h", header(1), 5)


def test_what_is_no_bag_is_named(tmp_path):
    empty = tmp_path / "empty.mcap"
    empty.touch()
    text = tmp_path / "text.mcap"
    text.write_text("hello")
    for path, match in (
        (tmp_path / "nothing", "no such file"),
        (tmp_path, "no|empty|not an MCAP"),
        (empty, "empty file"),
        (text, "not an MCAP file"),
    ):
        with pytest.raises(SloshBagError, match=match):
            BagReader(path)


def test_the_recorder_keeps_order_and_counts(tmp_path):
    recorder = Recorder(tmp_path / "run")
    recorder.add_topic("/header", HEADER, Qos())
    for number in range(5000):
        recorder.add("/header", header(number), 10**9 + number * 1_000_000)
    recorder.close()
    status = recorder.status()
    assert (status.written, status.lost, status.failure) == ({"/header": 5000}, 0, "")
    data = [message.data for message in BagReader(tmp_path / "run").messages()]
    assert data == [header(number) for number in range(5000)]


KILLED = """
import sys, time
from pathlib import Path
sys.path.insert(0, {tests!r})
from slosh_testing.bags import HEADER, header
from slosh_bag.bag_writer import Qos
from slosh_bag.recorder import Recorder
recorder = Recorder(Path({folder!r}))
recorder.add_topic("/header", HEADER, Qos())
data = header(1)
for number in range(100000):
    now = time.time_ns()
    recorder.add("/header", data, now)
    print(now, flush=True)
    time.sleep(0.001)
"""


def test_a_killed_process_loses_less_than_a_second(tmp_path):
    folder = tmp_path / "run"
    code = KILLED.format(tests=str(__file__).rsplit("/", 1)[0], folder=str(folder))
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True
    ) as process:
        sent = [int(process.stdout.readline())]
        started = time.monotonic()
        while time.monotonic() - started < 2.5:
            sent.append(int(process.stdout.readline()))
        process.kill()
        sent += [int(line) for line in process.stdout.read().split("\n") if len(line) == 19]
    reader = BagReader(folder)
    stamps = [message.log_ns for message in reader.messages()]
    assert sent[-1] - stamps[-1] < 1_000_000_000
    assert stamps == sent[: len(stamps)]  # nothing before that is missing
    assert "unfinished" in reader.warnings[0]
