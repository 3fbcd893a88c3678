"""Tests reading: order, splits, blocks, bags of other programs and damaged bags."""

import struct
import tracemalloc

import numpy as np
import pytest
from mcap.writer import Writer

from slosh_bag.bag_writer import BagWriter, Split
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_folder import bag_files
from slosh_bag.mcap_files.chunks import chunk_header, read_chunk
from slosh_bag.reader import BagReader
from slosh_testing.bags import (
    HEADER,
    SECOND,
    chunk_places,
    foreign_file,
    header,
    header_bag,
)


def file_of(folder):
    (file,) = folder.glob("*.mcap")
    return file


def numbers(reader, topics=None):
    return [reader.decode(message).stamp.sec for message in reader.messages(topics)]


# Blocks


def test_blocks_are_the_messages_topic_by_topic_within_each_chunk(tmp_path):
    reader = BagReader(header_bag(tmp_path / "bag"))
    blocks = list(reader.blocks())
    assert [(block.topic, len(block)) for block in blocks] == [("/even", 5), ("/odd", 5)] * 5
    found = {
        int(log): (block.topic, block.message_type, int(publish), block.data(row))
        for block in blocks
        for row, (log, publish) in enumerate(zip(block.log_ns, block.publish_ns, strict=True))
    }
    assert found == {
        message.log_ns: (message.topic, message.message_type, message.publish_ns, message.data)
        for message in reader.messages()
    }
    assert found[SECOND] == ("/even", HEADER, 0, header(0))


def test_columns_of_a_block(tmp_path):
    reader = BagReader(header_bag(tmp_path / "bag"))
    columns = [reader.columns(block, ["stamp.sec", "frame_id"]) for block in reader.blocks()]
    seconds = np.concatenate([found["stamp.sec"] for found in columns])
    assert sorted(seconds.tolist()) == list(range(50))
    with pytest.raises(SloshBagError, match=r"bag: std_msgs/msg/Header has no field 'x'"):
        reader.columns(next(reader.blocks()), ["x"])


@pytest.mark.parametrize("cut", [0, 30])
def test_a_file_without_checksums_says_so(tmp_path, cut):
    path = foreign_file(tmp_path / "a.mcap", [1, 2, None, 3], enable_crcs=False)
    path.write_bytes(path.read_bytes()[: path.stat().st_size - cut])
    reader = BagReader(path)
    assert numbers(reader) == [0, 1, 3]
    assert any("damage would not be noticed" in text for text in reader.warnings)


def test_memory_does_not_grow_with_the_bag(tmp_path):
    peaks = []
    for count in (2_000, 40_000):
        folder = header_bag(tmp_path / f"bag_{count}", count, flush=200)
        reader = BagReader(folder)
        next(reader.messages())
        tracemalloc.start()
        assert sum(1 for _ in reader.messages()) == count
        assert sum(len(block) for block in reader.blocks()) == count
        assert reader.topics()["/odd"].count == count // 2
        reader.metadata()
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.3 * peaks[0]  # its messages are a little longer


# Splits


def test_splits_are_read_in_the_order_of_their_numbers(tmp_path):
    folder = header_bag(tmp_path / "bag", 120, 10, split=Split(duration=100_000_000))
    names = [file.name for file in bag_files(folder)]
    assert names == [f"bag_{number}.mcap" for number in range(12)]
    (folder / "metadata.yaml").unlink()
    assert [file.name for file in bag_files(folder)] == names
    reader = BagReader(folder)
    assert numbers(reader) == list(range(120))
    assert reader.topics()["/odd"].count == 60
    assert reader.warnings == []


def test_a_split_that_is_gone_is_told(tmp_path):
    folder = header_bag(tmp_path / "bag", 30, 10, split=Split(duration=100_000_000))
    (folder / "bag_1.mcap").unlink()
    reader = BagReader(folder)
    assert numbers(reader) == [*range(10), *range(20, 30)]
    assert reader.warnings == [f"{folder}/metadata.yaml: lists 'bag_1.mcap', which does not exist"]


@pytest.mark.parametrize(
    "text", ["{", "[]", "rosbag2_bagfile_information: 3", "\x00", "a: &a [*a]"]
)
def test_an_unreadable_metadata_file_is_told_and_not_needed(tmp_path, text):
    folder = header_bag(tmp_path / "bag", 30, 10, split=Split(duration=100_000_000))
    (folder / "metadata.yaml").write_text(text)
    reader = BagReader(folder)
    assert numbers(reader) == list(range(30))
    assert "cannot be read" in reader.warnings[0]


def test_files_that_do_not_follow_each_other_are_told(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    foreign_file(folder / "a.mcap", [100, 200])
    foreign_file(folder / "b.mcap", [50, 60])
    reader = BagReader(folder)
    assert len(numbers(reader)) == 4
    assert reader.warnings == [f"{folder}/b.mcap: begins before the end of the file before it"]


# Definitions


def test_a_bag_is_decoded_by_its_own_definitions(tmp_path):
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema(HEADER, "ros2msg", b"uint8 old\n")
        channel = writer.register_channel("/t", "cdr", schema)
        writer.add_message(channel, 1, b"\x00\x01\x00\x00\x2a", 1)
        writer.finish()
    reader = BagReader(path)
    (message,) = reader.messages()
    assert reader.decode(message).old == 42
    (block,) = reader.blocks()
    assert reader.columns(block)["old"].tolist() == [42]


def test_two_definitions_of_a_type_are_refused_when_it_is_decoded(tmp_path):
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        for text in (b"uint8 old\n", b"uint8 new\n"):
            schema = writer.register_schema(HEADER, "ros2msg", text)
            channel = writer.register_channel(f"/{text[6:9].decode()}", "cdr", schema)
            writer.add_message(channel, 1, b"\x00\x01\x00\x00\x2a", 1)
        writer.finish()
    reader = BagReader(path)
    messages = list(reader.messages())
    with pytest.raises(SloshBagError, match="two definitions of std_msgs/msg/Header that differ"):
        reader.decode(messages[0])


@pytest.mark.parametrize(
    ("encoding", "text", "match"),
    [
        ("ros2msg", b"uint8", "the definition of std_msgs/msg/Header"),
        ("ros2msg", b"\xff", "the definition of std_msgs/msg/Header"),
        ("protobuf", b"", "defined in 'protobuf'; only ros2msg and ros2idl"),
    ],
)
def test_a_definition_that_cannot_be_read_is_told_when_it_is_needed(
    tmp_path, encoding, text, match
):
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema(HEADER, encoding, text)
        channel = writer.register_channel("/t", "cdr", schema)
        writer.add_message(channel, 1, b"\x00\x01\x00\x00\x2a", 1)
        writer.finish()
    reader = BagReader(path)
    (message,) = reader.messages()
    with pytest.raises(SloshBagError, match=match):
        reader.decode(message)


# Unfinished and damaged files


def test_a_cut_chunk_is_told_with_its_time_and_its_bytes(tmp_path):
    file = file_of(header_bag(tmp_path / "bag"))
    content = file.read_bytes()
    (_, _), (_, _), (start, end), *_ = chunk_places(content)
    file.write_bytes(content[: end - 5])
    reader = BagReader(file)
    assert numbers(reader) == list(range(20))
    assert reader.warnings == [
        f"{file}: unfinished (cut off); read up to 1.190 s, 0.190 s of data; the last "
        f"{end - 5 - start} bytes could not be used: messages from 1.200 s to 1.290 s"
    ]
    assert reader.topics()["/odd"].count == 10
    assert len(reader.warnings) == 1


def test_a_cut_at_any_byte_gives_what_is_before_it(tmp_path):
    file = file_of(header_bag(tmp_path / "bag", 30))
    content = file.read_bytes()
    ends = [end for _, end in chunk_places(content)]
    for size in range(8, len(content), 13):
        file.write_bytes(content[:size])
        reader = BagReader(file)
        whole = sum(end <= size for end in ends)
        assert numbers(reader) == list(range(10 * whole)), size
        assert len(reader.warnings) == 1, size


@pytest.mark.parametrize("finished", [True, False], ids=["finished", "unfinished"])
def test_damage_in_the_middle_is_an_error_that_says_where(tmp_path, finished):
    file = file_of(header_bag(tmp_path / "bag"))
    content = bytearray(file.read_bytes())
    start, end = chunk_places(content)[1]
    content[end - 3] ^= 1
    file.write_bytes(content if finished else content[:-300])
    reader = BagReader(file)
    with pytest.raises(SloshBagError) as caught:
        list(reader.messages())
    assert str(caught.value).startswith(f"{file}: damaged at byte {start}: a chunk ")
    assert str(caught.value).endswith(
        "; `slosh recover` writes a new bag with all intact messages"
    )


def test_zeros_at_the_end_after_a_power_cut_are_a_lost_end(tmp_path):
    file = file_of(header_bag(tmp_path / "bag"))
    content = file.read_bytes()
    start, _ = chunk_places(content)[3]
    file.write_bytes(content[:start] + bytes(5000))
    reader = BagReader(file)
    assert numbers(reader) == list(range(30))
    assert "the last 5000 bytes could not be used" in reader.warnings[0]


def change_chunk(file, index, field, value):
    """Overwrites 8 bytes of a chunk's header."""
    content = bytearray(file.read_bytes())
    start, _ = chunk_places(content)[index]
    struct.pack_into("<Q", content, start + field, value)
    file.write_bytes(content)


@pytest.mark.parametrize(
    ("field", "value", "match"),
    [
        (9, 0, "other times than its messages"),
        (17, 2**62, "other times than its messages"),
        (25, 7, "damaged size"),
        (25, 2**40, "damaged header"),
        (1, 2**60, "damaged"),
        (1, 60, "damaged"),
    ],
)
def test_chunk_headers_have_no_checksum_and_are_held_against_the_rest(
    tmp_path, field, value, match
):
    # Without a checksum of all data, as most writers leave it.
    path = foreign_file(tmp_path / "a.mcap", [1, 2, None, 3, 4, None, 5])
    change_chunk(path, 1, field, value)
    with pytest.raises(SloshBagError, match=match):
        list(BagReader(path).messages())


@pytest.mark.parametrize("opcode", [op for op in range(256) if op != 6])
def test_a_chunk_that_has_become_another_record_is_not_passed_over(tmp_path, opcode):
    path = foreign_file(tmp_path / "a.mcap", [1, 2, None, 3, 4, None, 5])
    content = bytearray(path.read_bytes())
    content[chunk_places(content)[1][0]] = opcode
    path.write_bytes(content)
    reader = BagReader(path)
    with pytest.raises(SloshBagError, match="damaged at byte"):
        list(reader.messages())


def test_damage_between_the_chunks_is_told_and_costs_nothing(tmp_path):
    file = file_of(header_bag(tmp_path / "bag"))
    content = bytearray(file.read_bytes())
    _, end = chunk_places(content)[2]
    content[end + 20] ^= 0xFF  # a time in a message index
    file.write_bytes(content)
    reader = BagReader(file)
    assert numbers(reader) == list(range(50))
    assert reader.warnings == [
        f"{file}: bytes between its chunks are damaged; the chunks are whole"
    ]


def test_facts_are_checked(tmp_path):
    file = file_of(header_bag(tmp_path / "bag", custom={"clocks": "unrelated", "radius": "0.05"}))
    content = file.read_bytes()
    assert BagReader(file).metadata() == {"clocks": "unrelated", "radius": "0.05"}
    for text in (b"0.05", b"radius", b"slosh", b"crc32"):
        at = content.rindex(b"\x0c", 0, content.index(b"radius"))
        at = content.index(text, at)
        changed = bytearray(content)
        changed[at] ^= 1
        file.write_bytes(changed)
        with pytest.raises(SloshBagError, match="damaged"):
            BagReader(file).metadata()


def test_facts_of_an_unfinished_bag_come_from_its_metadata_file(tmp_path):
    folder = tmp_path / "bag"
    writer = BagWriter(folder, custom={"clocks": "unrelated"})
    writer.add_topic("/t", HEADER)
    writer.write("/t", header(1), 1)
    writer.flush()
    reader = BagReader(folder)
    assert reader.metadata() == {"clocks": "unrelated"}
    assert "taken from metadata.yaml" in reader.warnings[-1]
    writer.close()


def test_a_size_that_was_damaged_is_not_allocated(tmp_path):
    path = foreign_file(tmp_path / "a.mcap", [1, 2, None, 3])
    content = path.read_bytes()
    start, end = chunk_places(content)[0]
    body = bytearray(content[start + 9 : end])
    struct.pack_into("<Q", body, 16, 2**27)
    header = chunk_header(bytes(body[:56]), len(body))
    tracemalloc.start()
    with pytest.raises(SloshBagError):
        read_chunk(0, header, bytes(body))
    assert tracemalloc.get_traced_memory()[1] < 10_000_000
    tracemalloc.stop()
