"""Tests that a look-up reads only the chunks that contain the requested messages."""

import pytest
from mcap.writer import CompressionType, IndexType, Writer

from slosh_bag.mcap_files.mcap_index import read_index
from slosh_bag.reader import BagReader
from slosh_testing.bags import DEFINITIONS, HEADER, SECOND, STEP, header, header_bag

CHUNK, CHUNKS = 10, 6
RARE = (0, 37)
"""Numbers of the messages of /rare; all others are of /often."""


def serialised(number):
    return header(number, "x" * 50)


def log_time(number):
    return SECOND + number * STEP


def topic_of(number):
    return "/rare" if number in RARE else "/often"


@pytest.fixture
def bag(tmp_path):
    """A bag with one message every 10 ms, ten per chunk, two of them on /rare."""
    count = CHUNK * CHUNKS
    return header_bag(tmp_path / "bag", count, CHUNK, topic_of=topic_of, data=serialised)


def foreign(path, **options):
    """Writes the same messages with the mcap library's writer."""
    with path.open("wb") as stream:
        writer = Writer(stream, **{"chunk_size": 1 << 30, **options})
        writer.start("ros2")
        schema = writer.register_schema(HEADER, "ros2msg", DEFINITIONS.text(HEADER).encode())
        channels = {
            topic: writer.register_channel(topic, "cdr", schema) for topic in ("/often", "/rare")
        }
        writer.add_attachment(0, 0, "a", "text/plain", b"attached")
        writer.add_metadata("m", {"key": "value"})
        for number in range(CHUNK * CHUNKS):
            channel = channels[topic_of(number)]
            writer.add_message(channel, log_time(number), serialised(number), number, number)
            if number % CHUNK == CHUNK - 1:
                writer.flush()
        writer.finish()
    return path


def found(path, topics=("/rare",), windows=None):
    """Looks up messages, checks their content and returns their numbers."""
    reader = BagReader(path)
    numbers = []
    for block in reader.look_up(topics, windows):
        for row, log_ns in enumerate(block.log_ns.tolist()):
            numbers.append((log_ns - SECOND) // STEP)
            assert block.data(row) == serialised(numbers[-1])
    return numbers


def places(path):
    (file,) = [path] if path.is_file() else path.glob("*.mcap")
    return file, [chunk.chunk_start_offset for chunk in read_index(file).chunks]


def damage(path, chunk):
    """Changes a byte within a chunk's content."""
    file, starts = places(path)
    content = bytearray(file.read_bytes())
    content[starts[chunk] + 100] ^= 0xFF
    file.write_bytes(content)


def test_a_rare_topic_costs_its_chunks_alone(bag):
    assert found(bag) == list(RARE)
    for chunk in (1, 2, 4, 5):
        damage(bag, chunk)
    assert found(bag) == list(RARE)


def test_all_that_is_within_a_window_comes_and_little_else(bag):
    window = (log_time(22), log_time(33))
    numbers = found(bag, ["/often"], [window])
    assert numbers == [number for number in range(20, 40) if number not in RARE]
    assert found(bag, ["/rare"], [window]) == [37]
    assert found(bag, ["/often"], [(0, SECOND - 1)]) == []


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"compression": CompressionType.NONE},
        {"use_chunking": False},
        {"index_types": IndexType.NONE},
        {"index_types": IndexType.CHUNK},
        {"use_statistics": False},
        {"use_summary_offsets": False},
        {"repeat_channels": False},
        {"repeat_schemas": False},
    ],
    ids=str,
)
def test_files_of_other_writers(tmp_path, options):
    file = foreign(tmp_path / "a.mcap", **options)
    assert found(file) == list(RARE)


def test_an_index_of_another_writer_is_used(tmp_path):
    file = foreign(tmp_path / "a.mcap")
    damage(file, 1)
    assert found(file) == list(RARE)


def test_a_damaged_index_is_not_believed(bag):
    file, _ = places(bag)
    content = bytearray(file.read_bytes())
    content[-60] ^= 0xFF
    file.write_bytes(content)
    assert read_index(file) is None
    assert found(bag) == list(RARE)
