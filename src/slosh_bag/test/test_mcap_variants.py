"""Tests that all optional features of MCAP files give the same messages and topics."""

import struct
from itertools import product

import pytest
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.records import Attachment
from mcap.writer import CompressionType, IndexType, Writer

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.mcap_summary import read_summary
from slosh_bag.mcap_files.mcap_walk import McapWalk
from slosh_bag.reader import BagReader

KINDS = ("ATTACHMENT", "CHUNK", "MESSAGE", "METADATA")
INDEXES = [
    [name for name, wanted in zip(KINDS, choice, strict=True) if wanted]
    for choice in product((False, True), repeat=len(KINDS))
]
CONTENTS = {
    "nothing": 0,
    "one message": 1,
    "ten messages": 10,
    "a message without a schema": 1,
    "an attachment": 0,
    "metadata": 0,
    "everything": 10,
}
# What a later version of the format may append to a record; messages and the footer never grow.
APPENDED = b"\x01\xff\xff"
GROWING = [kind for kind in Opcode if kind not in (Opcode.MESSAGE, Opcode.FOOTER)]
# Behind one of these in a chunk, mcap's Python library (1.6) loses its place.
LOST_BY_LIBRARY = {Opcode.SCHEMA, Opcode.CHANNEL}


def write(path, content, **options):
    with path.open("wb") as stream:
        writer = Writer(stream, **{"compression": CompressionType.NONE, **options})
        writer.start("", "")
        if CONTENTS[content]:
            schema = 0
            if "without" not in content:
                schema = writer.register_schema("Example", "c", bytes([4, 5, 6]))
            channel = writer.register_channel("example", "a", schema, {"foo": "bar"})
            for number in range(CONTENTS[content]):
                writer.add_message(channel, 2 + number, bytes([1, 2, 3]), 1 + number, 10 + number)
        if content in ("an attachment", "everything"):
            writer.add_attachment(2, 1, "myFile", "application/octet-stream", bytes([1, 2, 3]))
        if content in ("metadata", "everything"):
            writer.add_metadata("myMetadata", {"foo": "bar"})
        writer.finish()


def index_types(names):
    chosen = IndexType.NONE
    for name in names:
        chosen |= IndexType[name]
    return chosen


@pytest.mark.first(6)
@pytest.mark.parametrize("chunked", [True, False], ids=["chunks", "no chunks"])
@pytest.mark.parametrize("content", CONTENTS)
def test_every_variant_gives_the_same(tmp_path, content, chunked):
    count = CONTENTS[content]
    expected = [("example", 2 + k, 1 + k, bytes([1, 2, 3])) for k in range(count)]
    path = tmp_path / "a.mcap"
    for names, options in product(INDEXES, product((True, False), repeat=3)):
        statistics, channels, schemas = options
        write(
            path, content, use_chunking=chunked, index_types=index_types(names),
            use_statistics=statistics, repeat_channels=channels, repeat_schemas=schemas,
        )  # fmt: skip
        variant = f"indexes {names}, statistics, channels, schemas {options}"
        reader = BagReader(path)
        found = [(m.topic, m.log_ns, m.publish_ns, bytes(m.data)) for m in reader.messages()]
        assert found == expected, variant
        assert sum(len(block) for block in reader.blocks()) == count, variant
        assert sum(len(block) for block in reader.look_up(["example"])) == count, variant
        counts = {topic: info.count for topic, info in BagReader(path).topics().items()}
        assert counts == ({"example": count} if count else {}), variant


def extend(monkeypatch, *, padded=(), private=()):
    """Makes the mcap library append bytes to records, or private records after them."""
    finish, write_attachment = RecordBuilder.finish_record, Attachment.write

    def extended(builder):
        kind = builder._buffer.getbuffer()[builder._record_start_offset]
        # An attachment's checksum is its last field, and is put in afterwards.
        if kind in padded and kind != Opcode.ATTACHMENT:
            builder.write(APPENDED)
        finish(builder)
        if kind in private:
            builder.write(struct.pack("<BQ", 0x80 + kind, len(APPENDED)) + APPENDED)

    def extended_attachment(attachment, builder):
        start = builder.count
        write_attachment(attachment, builder)
        if Opcode.ATTACHMENT in padded:
            length = builder.count - start - 9 + len(APPENDED)
            builder.write(APPENDED)
            builder._buffer.seek(start + 1)
            builder.write8(length)
            builder._buffer.seek(0, 2)

    monkeypatch.setattr(RecordBuilder, "finish_record", extended)
    monkeypatch.setattr(Attachment, "write", extended_attachment)


def library_messages(path, reader):
    with path.open("rb") as stream:
        return [
            (channel.topic, message.log_time, message.publish_time, message.data)
            for _, channel, message in reader(stream, validate_crcs=True).iter_messages()
        ]


def messages_of(reader):
    return [(m.topic, m.log_ns, m.publish_ns, bytes(m.data)) for m in reader.messages()]


def check_extended(path, *, second=True):
    """Checks that slosh and the mcap library read the same messages, in two ways."""
    expected = [("example", 2 + k, 1 + k, bytes([1, 2, 3])) for k in range(10)]
    for library in (SeekingReader, NonSeekingReader) if second else ():
        assert library_messages(path, library) == expected
    reader = BagReader(path)
    assert messages_of(reader) == expected
    assert sum(len(block) for block in reader.look_up(["example"])) == 10
    assert {topic: info.count for topic, info in reader.topics().items()} == {"example": 10}
    assert BagReader(path).metadata() == {}
    assert reader.warnings == []
    for lenient in (False, True):
        walk = McapWalk(path, lenient=lenient)
        assert sum(len(chunk) for chunk in walk.chunks()) == 10
        assert (walk.found.gaps, walk.warnings) == ([], [])
        assert [record.metadata for record in walk.found.metadata] == [{"foo": "bar"}]
    with path.open("rb") as stream:
        summary = read_summary(stream, path.stat().st_size)
    assert summary.tells_topics
    assert [index.name for index in summary.metadata] == ["myMetadata"]
    return reader


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("chunked", [True, False], ids=["chunks", "no chunks"])
@pytest.mark.parametrize("padded", [[kind] for kind in GROWING] + [GROWING], ids=str)
def test_bytes_appended_to_a_record_are_passed_over(
    tmp_path, monkeypatch, padded, chunked, compression
):
    path = tmp_path / "a.mcap"
    extend(monkeypatch, padded=padded)
    write(
        path, "everything", use_chunking=chunked, compression=compression, chunk_size=200,
        enable_data_crcs=True,
    )  # fmt: skip
    extended = path.read_bytes()
    monkeypatch.undo()
    write(
        path, "everything", use_chunking=chunked, compression=compression, chunk_size=200,
        enable_data_crcs=True,
    )  # fmt: skip
    chunks = not chunked and padded[0] in (Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX)
    assert (len(extended) == path.stat().st_size) == (chunks and len(padded) == 1)
    path.write_bytes(extended)
    check_extended(path, second=not (chunked and LOST_BY_LIBRARY & set(padded)))


def places(content):
    """Returns type, start and end of each record outside chunks."""
    found, at = [], 8
    while at < len(content) - 8:
        kind, length = struct.unpack_from("<BQ", content, at)
        found.append((kind, at, at + 9 + length))
        at = found[-1][2]
    return found


def test_only_the_chunks_with_the_topic_are_read_of_a_padded_file(tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    extend(monkeypatch, padded=GROWING)
    write(path, "everything", chunk_size=100)
    content = bytearray(path.read_bytes())
    content[next(start for kind, start, _ in places(content) if kind == Opcode.CHUNK) + 60] ^= 1
    path.write_bytes(content)
    # The index says that no chunk has the topic: so the damage is not met.
    assert list(BagReader(path).look_up(["another"])) == []
    with pytest.raises(SloshBagError, match="damaged at byte"):
        list(BagReader(path).look_up(["example"]))


@pytest.mark.parametrize("cut", [0, 60], ids=["finished", "unfinished"])
@pytest.mark.parametrize("opcode", [op for op in range(256) if op != Opcode.CHUNK])
@pytest.mark.first(40)
def test_a_padded_chunk_that_has_become_another_record_is_told(tmp_path, monkeypatch, opcode, cut):
    """The damage must be noticed even without message counts or a data checksum."""
    path = tmp_path / "a.mcap"
    extend(monkeypatch, padded=GROWING)
    write(path, "ten messages", chunk_size=100, use_statistics=False)
    content = bytearray(path.read_bytes())
    chunks = [start for kind, start, _ in places(content) if kind == Opcode.CHUNK]
    content[chunks[1]] = opcode
    path.write_bytes(content[: len(content) - cut])
    reader = BagReader(path)
    try:
        messages_of(reader)
    except SloshBagError as error:
        assert "damaged at byte" in str(error)
    else:
        assert any("unknown kind" in text for text in reader.warnings)


@pytest.mark.parametrize("kind", [Opcode.CHUNK, Opcode.MESSAGE_INDEX])
def test_a_length_that_takes_in_the_next_chunk_is_damage_and_no_appended_field(tmp_path, kind):
    path = tmp_path / "a.mcap"
    write(path, "ten messages", chunk_size=100, use_statistics=False)
    content = bytearray(path.read_bytes())
    records = places(content)
    index = next(k for k, record in enumerate(records) if record[0] == kind)
    after = next(k for k in range(index + 1, len(records)) if records[k][0] == Opcode.CHUNK)
    struct.pack_into(
        "<Q", content, records[index][1] + 1, records[after][2] - records[index][1] - 9
    )
    path.write_bytes(content)
    with pytest.raises(SloshBagError, match="takes in a chunk"):
        messages_of(BagReader(path))
