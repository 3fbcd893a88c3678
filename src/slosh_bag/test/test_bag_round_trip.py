"""Tests that bags are complete, readable by other libraries and robust to a killed recorder."""

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from slosh_bag.bag_writer import BagWriter, Qos
from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
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
