"""Tests files of other writers: several channels on a topic, attachments, metadata, numbers."""

import struct

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.rosbag_import import import_rosbag
from slosh_bag.reader import BagReader
from slosh_bag.recover import recover_bag

T0, STEP = 10**18, 10**8
CDR = bytes([0, 1, 0, 0])
OLD, NEW = b"float64 a\nfloat64 b\n", b"float64 b\nfloat64 a\n"
KIND = "demo_msgs/msg/H"
FOLDER = """rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  relative_file_paths: [two.mcap]
  compression_mode: ""
  topics_with_message_count:
  - {topic_metadata: {name: /h, type: demo_msgs/msg/H}, message_count: 10}
"""


def message(definition):
    """Returns a = 1, b = 2 in the order of the fields of a definition."""
    return CDR + struct.pack("<dd", *((1.0, 2.0) if definition == OLD else (2.0, 1.0)))


def write(path, *channels, count=5, start=0, chunk_size=1024, extra=lambda writer: None):
    """Writes channels, each a topic and a definition, with messages numbered from `start`."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_size)
        writer.start("ros2", "x")
        numbers = []
        for k, (topic, definition) in enumerate(channels):
            schema = writer.register_schema(KIND, "ros2msg", definition)
            numbers.append(writer.register_channel(topic, "cdr", schema, {"k": str(k)}))
        extra(writer)
        for row in range(count):
            for k, (number, (_, definition)) in enumerate(zip(numbers, channels, strict=True)):
                stamp = T0 + row * STEP + k
                writer.add_message(number, stamp, message(definition), stamp, start + row)
        writer.finish()
    return path


def values(bag):
    reader = BagReader(bag)
    found = {}
    for one in reader.messages():
        decoded = reader.decode(one)
        found.setdefault(one.topic, []).append((decoded.a, decoded.b))
    return found


@pytest.mark.parametrize("in_folder", [False, True])
@pytest.mark.parametrize("second", [OLD, NEW], ids=["alike", "unlike"])
def test_each_channel_of_a_topic_is_read_by_its_own_definition(tmp_path, second, in_folder):
    source = tmp_path / "source"
    source.mkdir()
    file = write(source / "two.mcap", ("/h", OLD), ("/h", second))
    if in_folder:
        (source / "metadata.yaml").write_text(FOLDER)
    found = import_rosbag(source if in_folder else file, tmp_path / "bag")
    assert (found.counts, found.lost) == ({"/h": 10}, ())
    assert any("converted to the definition" in note for note in found.notes) == (second != OLD)
    assert values(tmp_path / "bag") == {"/h": [(1.0, 2.0)] * 10}


def test_two_topics_with_two_definitions_of_a_type_give_their_own_values(tmp_path):
    file = write(tmp_path / "two.mcap", ("/old", OLD), ("/new", NEW))
    import_rosbag(file, tmp_path / "bag")
    assert values(tmp_path / "bag") == {"/old": [(1.0, 2.0)] * 5, "/new": [(1.0, 2.0)] * 5}


@pytest.mark.parametrize("cut", [False, True])
def test_two_definitions_in_a_bag_are_named_and_not_decoded(tmp_path, cut):
    """Also where the file has lost its summary, and the second one comes later."""
    file = tmp_path / "two.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=1)
        writer.start("ros2", "x")
        for k, definition in enumerate((OLD, NEW)):
            schema = writer.register_schema(KIND, "ros2msg", definition)
            number = writer.register_channel("/h", "cdr", schema, {"k": str(k)})
            writer.add_message(number, T0 + k, message(definition), T0 + k)
        writer.finish()
    if cut:
        file.write_bytes(file.read_bytes()[:-200])
    reader = BagReader(file)
    decoded = []
    with pytest.raises(SloshBagError, match=r"two definitions of demo_msgs/msg/H that differ"):
        decoded += [reader.decode(one) for one in reader.messages()]
    assert all((one.a, one.b) == (1.0, 2.0) for one in decoded)


@pytest.mark.parametrize("topics", [("/h", "/h"), ("/old", "/new")])
@pytest.mark.parametrize("damage", ["cut", "hole"])
def test_recovery_keeps_each_definition_so_that_an_import_can_follow(tmp_path, topics, damage):
    """What the import of a cut file and the reading of two definitions advise leads to the end."""
    one, other = topics
    file = write(tmp_path / "two.mcap", (one, OLD), (other, NEW), count=400)
    data = bytearray(file.read_bytes())
    if damage == "cut":
        del data[-len(data) // 3 :]
    else:
        data[len(data) // 3 : len(data) // 3 + 400] = bytes(400)
    file.write_bytes(data)
    with pytest.raises(SloshBagError, match="slosh recover"):
        import_rosbag(file, tmp_path / "refused")
    recovered = recover_bag(file, tmp_path / "bag")
    assert not any("definitions" in note for note in recovered.notes)
    assert 200 < sum(recovered.counts.values()) < 800
    found = import_rosbag(tmp_path / "bag", tmp_path / "imported")
    assert (found.counts, found.lost) == (recovered.counts, ())
    assert {one for rows in values(tmp_path / "imported").values() for one in rows} == {(1.0, 2.0)}
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream:
        channels = make_reader(stream).get_summary().channels.values()
    assert [channel.metadata["k"] for channel in channels] == ["0", "1"]


def attach(writer):
    for k in range(2):
        writer.add_attachment(T0, T0 + 1, f"calibration_{k}.yaml", "text/yaml", b"a: 1\n" * 300)
    writer.add_metadata("robot", {"serial": "42"})
    writer.add_metadata("rosbag2", {"serialized_metadata": "of the old bag"})


@pytest.mark.parametrize("share", [1.0, 0.7])
def test_recovery_keeps_attachments_metadata_and_numbers(tmp_path, share):
    file = write(tmp_path / "a.mcap", ("/h", OLD), count=200, start=7, extra=attach)
    file.write_bytes(file.read_bytes()[: round(file.stat().st_size * share)])
    found = recover_bag(file, tmp_path / "bag")
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        attached = [(one.name, one.media_type, one.create_time, one.log_time, one.data)
                    for one in reader.iter_attachments()]  # fmt: skip
        metadata = [(one.name, one.metadata) for one in reader.iter_metadata()]
        numbers = [one.sequence for _, _, one in reader.iter_messages()]
        statistics = reader.get_summary().statistics
    assert attached == [
        (f"calibration_{k}.yaml", "text/yaml", T0, T0 + 1, b"a: 1\n" * 300) for k in range(2)
    ]
    assert metadata == [("robot", {"serial": "42"})]
    assert (statistics.attachment_count, statistics.metadata_count) == (2, 1)
    assert numbers == list(range(7, 7 + found.counts["/h"]))
    assert list(BagReader(tmp_path / "bag").messages()) != []


def test_a_loss_shows_in_the_numbers_of_a_recovered_bag(tmp_path):
    file = write(tmp_path / "a.mcap", ("/h", OLD), count=400)
    data = bytearray(file.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 400] = bytes(400)
    file.write_bytes(data)
    recover_bag(file, tmp_path / "bag")
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as stream:
        found = [(one.sequence, one.log_time) for _, _, one in make_reader(stream).iter_messages()]
    assert 100 < len(found) < 400
    assert all(stamp == T0 + number * STEP for number, stamp in found)


def test_a_damaged_attachment_is_named_by_a_recovery(tmp_path):
    file = write(tmp_path / "a.mcap", ("/h", OLD), count=9, extra=attach)
    file.write_bytes(file.read_bytes().replace(b"a: 1\n" * 300, b"a: 2\n" * 300, 1))
    found = recover_bag(file, tmp_path / "bag")
    assert found.counts == {"/h": 9}
    (note,) = found.notes
    assert "left out" in note
    assert "a damaged attachment, 'calibration_0.yaml'" in note


def test_an_import_counts_attachments_and_metadata_that_it_leaves(tmp_path):
    file = write(tmp_path / "a.mcap", ("/h", OLD), extra=attach)
    found = import_rosbag(file, tmp_path / "bag")
    assert found.notes == (
        "2 attachments left out (calibration_0.yaml, calibration_1.yaml); `slosh recover` keeps "
        "all",
        "1 metadata record left out (robot); `slosh recover` keeps all",
    )
