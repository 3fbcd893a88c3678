"""Tests valid MCAP files whose messages are not in the order of their log times."""

from itertools import chain
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from slosh_bag.reader import BagReader, messages_of
from slosh_replay.replay import replay_bag

BAG = Path(__file__).resolve().parents[3] / "bags" / "c"
PARTS = 8


def parts_of(messages, order):
    """Returns the messages in parts, in the order in which they are written."""
    messages = list(messages)
    if order == "interleaved":
        return [messages[k::PARTS] for k in range(PARTS)]
    size = -(-len(messages) // PARTS)
    parts = [messages[k : k + size] for k in range(0, len(messages), size)]
    return [part[::-1] for part in parts[::-1]] if order == "backwards" else parts[::-1]


def rewrite(target, order, *, chunked):
    """Copies the shipped bag to one file in another message order, using the mcap library."""
    (source,) = BAG.glob("*.mcap")
    with source.open("rb") as stream, target.open("wb") as copy:
        reader = make_reader(stream)
        writer = Writer(copy, compression=CompressionType.ZSTD, use_chunking=chunked)
        writer.start("ros2")
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        schemas, channels = {}, {}
        for part in parts_of(reader.iter_messages(), order):
            for schema, channel, message in part:
                if schema.name not in schemas:
                    schemas[schema.name] = writer.register_schema(
                        schema.name, schema.encoding, schema.data
                    )
                if channel.topic not in channels:
                    channels[channel.topic] = writer.register_channel(
                        channel.topic, channel.message_encoding, schemas[schema.name],
                        channel.metadata,
                    )  # fmt: skip
                writer.add_message(
                    channels[channel.topic], message.log_time, message.data,
                    message.publish_time, message.sequence,
                )  # fmt: skip
        writer.finish()
    return target


def by_topic(messages):
    found = {}
    for message in messages:
        found.setdefault(message.topic, []).append((message.log_ns, bytes(message.data)))
    return found


@pytest.mark.first(3)
@pytest.mark.parametrize("chunked", [True, False], ids=["chunks", "no chunks"])
@pytest.mark.parametrize("order", ["last part first", "backwards", "interleaved"])
def test_the_messages_come_by_their_log_times(tmp_path, order, chunked):
    path = rewrite(tmp_path / "a.mcap", order, chunked=chunked)
    expected = by_topic(BagReader(BAG).messages())
    reader = BagReader(path)
    assert by_topic(reader.messages()) == expected
    assert by_topic(chain.from_iterable(map(messages_of, reader.blocks()))) == expected
    some = ["/slosh/settings", "/slosh/comparison"]
    found = by_topic(chain.from_iterable(map(messages_of, reader.look_up(some))))
    assert found == {topic: expected[topic] for topic in some}


def test_such_a_bag_replays_bit_for_bit(tmp_path):
    path = rewrite(tmp_path / "a.mcap", "last part first", chunked=True)
    found, expected = replay_bag(path), replay_bag(BAG)
    assert found.verification.exact
    assert found.verification.identical == expected.verification.identical > 1000
