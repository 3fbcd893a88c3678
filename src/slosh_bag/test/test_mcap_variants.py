"""All that the MCAP format leaves to a writer: each variant gives the same messages and topics."""

from itertools import product

import pytest
from mcap.writer import CompressionType, IndexType, Writer

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
}


def write(path, content, **options):
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE, **options)
        writer.start("", "")
        if CONTENTS[content]:
            schema = 0
            if "without" not in content:
                schema = writer.register_schema("Example", "c", bytes([4, 5, 6]))
            channel = writer.register_channel("example", "a", schema, {"foo": "bar"})
            for number in range(CONTENTS[content]):
                writer.add_message(channel, 2 + number, bytes([1, 2, 3]), 1 + number, 10 + number)
        if content == "an attachment":
            writer.add_attachment(2, 1, "myFile", "application/octet-stream", bytes([1, 2, 3]))
        if content == "metadata":
            writer.add_metadata("myMetadata", {"foo": "bar"})
        writer.finish()


def index_types(names):
    chosen = IndexType.NONE
    for name in names:
        chosen |= IndexType[name]
    return chosen


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
