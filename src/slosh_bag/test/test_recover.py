"""Tests that `slosh recover` copies all intact messages and reports the rest."""

import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import Writer

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_metadata import Qos
from slosh_bag.reader import BagReader
from slosh_bag.recover import recover_bag
from slosh_testing.bags import chunk_places, header_bag


@pytest.fixture
def bag(tmp_path):
    """A bag with 50 messages in five chunks."""
    offered = Qos("best_effort", "transient_local", 3)
    facts = {"clocks": "unrelated"}
    return header_bag(
        tmp_path / "bag", topic_of=lambda _: "/header", offered=offered, custom=facts
    )


def entries(path):
    return [tuple(message) for message in BagReader(path).messages()]


def test_a_whole_bag_is_copied_as_it_is(bag, tmp_path):
    recovery = recover_bag(bag, tmp_path / "new")
    assert recovery.notes == ()
    assert recovery.counts == {"/header": 50}
    assert entries(tmp_path / "new") == entries(bag)
    assert BagReader(tmp_path / "new").metadata() == {"clocks": "unrelated"}
    old, new = (
        yaml.safe_load((path / "metadata.yaml").read_text()) for path in (bag, tmp_path / "new")
    )
    topics = [
        document["rosbag2_bagfile_information"]["topics_with_message_count"]
        for document in (old, new)
    ]
    assert topics[0] == topics[1]


def test_a_cut_bag_becomes_a_finished_one(bag, tmp_path):
    original = entries(bag)
    file = bag / "bag_0.mcap"
    content = file.read_bytes()
    _, end = chunk_places(content)[3]
    file.write_bytes(content[: end - 1])
    recovery = recover_bag(bag, tmp_path / "new")
    reader = BagReader(tmp_path / "new")
    assert [tuple(message) for message in reader.messages()] == original[:30]
    assert reader.warnings == []
    assert recovery.counts == {"/header": 30}
    assert any("1.300 s to 1.390 s: a record is cut off" in note for note in recovery.notes)
    assert any("taken from metadata.yaml, unchecked" in note for note in recovery.notes)
    with (tmp_path / "new" / "new_0.mcap").open("rb") as stream:
        assert make_reader(stream).get_summary().statistics.message_count == 30


@pytest.mark.parametrize(
    ("place", "value"), [(60, 0xFF), (0, 0x86), (1, 0xFF), (7, 0xFF), (41, 0)]
)
def test_a_damaged_chunk_costs_itself_alone(bag, tmp_path, place, value):
    """Damages a chunk's content, opcode, length or compression."""
    original = entries(bag)
    file = bag / "bag_0.mcap"
    content = bytearray(file.read_bytes())
    start, _ = chunk_places(content)[2]
    content[start + place] ^= value or 0x20
    file.write_bytes(content)
    recovery = recover_bag(bag, tmp_path / "new")
    assert entries(tmp_path / "new") == original[:20] + original[30:]
    assert any("40 of 50 messages of /header recovered" in note for note in recovery.notes)


@pytest.mark.parametrize("damage", [b"", b"\x00" * 8, b"\x89MCAP0\r\n\xff"])
def test_a_damaged_beginning_costs_no_message(bag, tmp_path, damage):
    original = entries(bag)
    file = bag / "bag_0.mcap"
    content = file.read_bytes()
    file.write_bytes(damage + content[len(damage) or 8 :])
    recovery = recover_bag(bag, tmp_path / "new")
    assert entries(tmp_path / "new") == original
    assert recovery.notes


def test_definitions_hashes_and_qos_are_those_of_the_file(tmp_path):
    path = tmp_path / "old.mcap"
    kind = "gone_msgs/msg/Old"
    qos = "- history: 1\n  depth: 7\n  reliability: 1\n  durability: 2\n"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema(kind, "ros2msg", b"uint8 old\n")
        noted = {"offered_qos_profiles": qos, "topic_type_hash": "RIHS01_00"}
        channel = writer.register_channel("/t", "cdr", schema, noted)
        bare = writer.register_channel("/bare", "cdr", schema)
        text = writer.register_channel("/json", "json", schema)
        for number in (channel, bare, text):
            writer.add_message(number, 5, b"\x00\x01\x00\x00\x2a", 4)
        writer.finish()
    path.write_bytes(path.read_bytes()[:-40])
    recovery = recover_bag(path, tmp_path / "new")
    assert recovery.counts == {"/t": 1, "/bare": 1, "/json": 1}
    reader = BagReader(tmp_path / "new")
    assert [reader.decode(message).old for message in reader.messages(["/t", "/bare"])] == [42, 42]
    with (tmp_path / "new" / "new_0.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    channels = {channel.topic: channel for channel in summary.channels.values()}
    assert channels["/t"].metadata == noted
    assert channels["/bare"].metadata["offered_qos_profiles"] == ""
    (schema,) = summary.schemas.values()
    assert (schema.name, schema.data) == (kind, b"uint8 old\n")
    document = yaml.safe_load((tmp_path / "new" / "metadata.yaml").read_text())
    topics = document["rosbag2_bagfile_information"]["topics_with_message_count"]
    assert topics[0]["topic_metadata"]["offered_qos_profiles"] == yaml.safe_load(qos)
    assert topics[0]["topic_metadata"]["type_description_hash"] == "RIHS01_00"
    assert topics[1]["topic_metadata"]["offered_qos_profiles"] == []


def test_what_is_no_bag_gives_one_line_and_no_folder(tmp_path):
    text = tmp_path / "a.mcap"
    text.write_text("hello " * 100)
    with pytest.raises(SloshBagError, match="not an MCAP file: it is a text file"):
        recover_bag(text, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    with pytest.raises(SloshBagError, match="no such file"):
        recover_bag(tmp_path / "nothing", tmp_path / "new")


KINDS = {
    "lfs": (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"),
    "page": (b"\n<!DOCTYPE html>\n<html>", "a web page; .* sign in"),
    "gzip": (b"\x1f\x8b\x08\0" + bytes(range(90)), "a gzip file; unpack it first"),
    "zip": (b"PK\x03\x04\x14\0", "a zip file; unpack it first"),
    "sqlite": (b"SQLite format 3\0" + bytes(50), "an SQLite file.*slosh import rosbag"),
    "ros1": (b"#ROSBAG V2.0\n\x45\0\0\0", "a ROS 1 bag; convert it with slosh import rosbag"),
    "tar": (b"a" * 257 + b"ustar\0", "a tar file; unpack it first"),
    "zeros": (bytes(5000), "a file of zeros; the copy was interrupted"),
    "nothing": (b"", "the file is empty"),
    "json": (b'{"a": 1}', "a text file"),
}


@pytest.mark.parametrize("name", KINDS)
def test_another_kind_of_file_is_named_and_what_to_do(tmp_path, name):
    content, match = KINDS[name]
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(SloshBagError, match=f"a.mcap: .*{match}"):
        recover_bag(path, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    with pytest.raises(SloshBagError, match=r"it is|empty"):
        BagReader(path)


def test_messages_of_every_encoding_and_schema_are_recovered(tmp_path):
    path, found = tmp_path / "mixed.mcap", []
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("lab")
        for topic, encoding, schema in (
            ("/json", "json", ("Pose", "jsonschema", b"{}")),
            ("/proto", "protobuf", ("lab.Pose", "protobuf", b"\xff\0binary")),
            ("/ros1", "ros1", ("std_msgs/String", "ros1msg", b"string data\n")),
            ("/cbor", "cbor", None),
        ):
            number = writer.register_schema(*schema) if schema else 0
            channel = writer.register_channel(topic, encoding, number, {"md5sum": topic})
            for k in range(20):
                writer.add_message(channel, k + 1, f"{topic} {k}".encode(), k + 1)
            found.append((topic, encoding, schema))
        writer.finish()
    path.write_bytes(path.read_bytes()[:-50])
    assert recover_bag(path, tmp_path / "new").counts == dict.fromkeys(
        ("/json", "/proto", "/ros1", "/cbor"), 20
    )
    with (tmp_path / "new" / "new_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "lab"
        rows = list(reader.iter_messages(log_time_order=False))
    for topic, encoding, schema in found:
        mine = [row for row in rows if row[1].topic == topic]
        assert [row[2].data for row in mine] == [f"{topic} {k}".encode() for k in range(20)]
        assert mine[0][1].message_encoding == encoding
        assert mine[0][1].metadata["md5sum"] == topic
        kept = mine[0][0]
        assert (kept and (kept.name, kept.encoding, kept.data)) == schema


def test_the_only_bag_in_a_folder_is_meant(bag, tmp_path):
    (tmp_path / "all").mkdir()
    inner = bag.rename(tmp_path / "all" / "bag")
    reader = BagReader(tmp_path / "all")
    assert len(list(reader.messages())) == 50
    assert any("reading the bag bag in it" in line for line in reader.warnings)
    assert recover_bag(tmp_path / "all", tmp_path / "new").counts == {"/header": 50}
    recover_bag(inner, tmp_path / "all" / "other")
    with pytest.raises(SloshBagError, match="holds 2 bags; name one of them: bag, other"):
        BagReader(tmp_path / "all")
