"""Tests that damaged bags give correct messages, a warning or one clear error."""

import random
import shutil
import struct
from collections import Counter

import pytest
from mcap.writer import CompressionType, Writer

from slosh_bag.bag_writer import BagWriter, Split
from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_metadata import Qos
from slosh_bag.reader import BagReader
from slosh_bag.recover import recover_bag

HEADER = "std_msgs/msg/Header"
POINT = "geometry_msgs/msg/Point"
DEFINITIONS = Definitions()
STORE = DEFINITIONS.typestore
START = 1_763_720_000_000_000_000
COUNT = 120
FACTS = {"clocks": "unrelated", "source": "a test, of damage"}


def written(count, rng):
    """Returns topic, type, times and bytes of random messages in the order of log times."""
    time, header, point = (
        STORE.types[name] for name in ("builtin_interfaces/msg/Time", HEADER, POINT)
    )
    for number in range(count):
        stamp = START + number * 1_000_000 + rng.randrange(1000)
        if number % 3:
            message = header(stamp=time(sec=number, nanosec=7), frame_id="f" * (number % 2))
            yield "/a/header", HEADER, stamp, stamp - 5, serialised(message, HEADER)
        else:
            message = point(x=rng.random(), y=rng.random(), z=float(number))
            yield "/point", POINT, stamp, stamp, serialised(message, POINT)


def serialised(message, kind):
    return bytes(STORE.serialize_cdr(message, kind))


NO_SPLIT = Split()


def ours(folder, rng, split=NO_SPLIT):
    messages = list(written(COUNT, rng))
    with BagWriter(folder, custom=FACTS, split=split) as bag:
        bag.add_topic("/a/header", HEADER, Qos("best_effort", "volatile", 3))
        bag.add_topic("/point", POINT)
        for number, (topic, _, log, publish, data) in enumerate(messages):
            bag.write(topic, data, log, publish)
            if number % 20 == 19:
                bag.flush()
    return messages


def split_in_two(folder, rng):
    return ours(folder, rng, Split(duration=65_000_000))


def unfinished(folder, rng):
    messages = ours(folder, rng)
    file = folder / f"{folder.name}_0.mcap"
    content = file.read_bytes()
    (folder / "metadata.yaml").unlink()
    # Without the data's end and all behind it, as a killed recorder leaves it.
    (start,) = struct.unpack_from("<Q", content, len(content) - 8 - 20)
    file.write_bytes(content[: start - 13])
    return messages


def foreign(compression, **options):
    def write(folder, rng):
        messages = list(written(COUNT, rng))
        folder.mkdir()
        with (folder / "foreign.mcap").open("wb") as stream:
            writer = Writer(stream, chunk_size=1500, compression=compression, **options)
            writer.start("ros2")
            channels = {}
            for kind in (HEADER, POINT):
                schema = writer.register_schema(kind, "ros2msg", DEFINITIONS.text(kind).encode())
                topic = "/a/header" if kind == HEADER else "/point"
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            for number, (topic, _, log, publish, data) in enumerate(messages):
                writer.add_message(channels[topic], log, data, publish, number)
                if number == 50:
                    writer.add_attachment(1, 1, "note", "text/plain", b"hello" * 40)
                    writer.add_metadata("other", {"key": "value"})
            writer.finish()
        return messages

    return write


KINDS = {
    "ours": ours,
    "split": split_in_two,
    "unfinished": unfinished,
    "lz4": foreign(CompressionType.LZ4),
    "plain": foreign(CompressionType.NONE),
    "zstd with data crc": foreign(CompressionType.ZSTD, enable_data_crcs=True),
    "no chunks": foreign(CompressionType.NONE, enable_data_crcs=True, use_chunking=False),
}


def facts_of(name):
    return FACTS if name in ("ours", "split", "unfinished") else {}


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    made = {}
    for name, write in KINDS.items():
        folder = tmp_path_factory.mktemp("whole") / "bag"
        made[name] = folder, write(folder, random.Random(name))
    return made


def structure(content):
    """Returns the positions of bytes that no chunk checksum protects."""
    places, at = list(range(8)), 8
    while at + 9 <= len(content):
        (length,) = struct.unpack_from("<Q", content, at + 1)
        places += range(at, min(at + 9 + min(length, 52), len(content)))
        at += 9 + length
    return places


def damage(folder, rng):
    """Truncates a file of the bag or changes some bytes; describes the change."""
    files = sorted(folder.glob("*.mcap"))
    noted = folder / "metadata.yaml"
    if noted.exists() and rng.random() < 0.08:
        files = [noted]
    file = rng.choice(files)
    content = bytearray(file.read_bytes())
    if rng.random() < 0.35:
        place = rng.choice([rng.randrange(len(content)), *rng.choices(structure(content), k=1)])
        file.write_bytes(content[:place])
        return f"{file.name} cut at {place}"
    flips = []
    for _ in range(rng.choice([1, 1, 1, 2, 5])):
        around = rng.random() < 0.6 and file.suffix == ".mcap"
        place = rng.choice(structure(content)) if around else rng.randrange(len(content))
        flip = rng.choice([1 << rng.randrange(8), rng.randrange(1, 256)])
        content[place] ^= flip
        flips.append(f"{place}^{flip}")
    file.write_bytes(content)
    return f"{file.name} {' '.join(flips)}"


def attempt(folder, read):
    """Returns the result and warnings of reading a bag, or None for one clear error."""
    try:
        reader = BagReader(folder)
        found = read(reader)
    except SloshBagError as error:
        assert str(error)
        assert "\n" not in str(error)
        assert str(folder) in str(error)
        return None, None
    assert all("\n" not in text for text in reader.warnings)
    return found, reader.warnings


def is_subsequence(part, whole):
    rest = iter(whole)
    return all(any(item == other for other in rest) for item in part)


def from_blocks(reader):
    found = []
    for block in reader.blocks():
        reader.columns(block)
        for row in range(len(block)):
            entry = block.topic, block.message_type, int(block.log_ns[row])
            found.append((*entry, int(block.publish_ns[row]), block.data(row)))
    return sorted(found, key=lambda message: message[2])


def check(folder, name, original):
    """Reads a damaged bag in every way; returns how many ways gave messages.

    Without a warning it has to give the original messages and facts.
    """
    given, noted = 0, facts_of(name)
    for read in (lambda reader: [tuple(message) for message in reader.messages()], from_blocks):
        found, warnings = attempt(folder, read)
        if found is None:
            continue
        given += 1
        # Where all checksums of a file without chunks are gone, it says that it has none.
        unchecked = name == "no chunks" and any("without checksums" in text for text in warnings)
        assert unchecked or is_subsequence(found, original), "other messages"
        assert warnings or found == original, f"{len(original) - len(found)} silently missing"
    topics, warnings = attempt(folder, BagReader.topics)
    if topics is not None:
        counts = Counter(message[0] for message in original)
        said = {topic: info.count for topic, info in topics.items()}
        assert warnings or said == counts
        assert all(count <= counts[topic] for topic, count in said.items())
        kinds = {message[0]: message[1] for message in original}
        assert all(info.message_type == kinds[topic] for topic, info in topics.items())
    facts, warnings = attempt(folder, BagReader.metadata)
    if facts is not None:
        assert warnings or facts == noted
        if not any("metadata.yaml" in text for text in warnings):
            assert facts.items() <= noted.items()
    return given


def check_recovery(folder, original, target):
    try:
        recovery = recover_bag(folder, target)
    except SloshBagError as error:
        assert "\n" not in str(error)
        assert not target.exists()
        return
    reader = BagReader(target)
    found = sorted((tuple(message) for message in reader.messages()), key=lambda m: m[2])
    unchecked = any("without checksums" in note for note in recovery.notes)
    assert unchecked or is_subsequence(found, original)
    assert reader.warnings == []
    assert recovery.notes or found == original


def fuzz(bags, tmp_path, cases):
    failures, given = [], 0
    for case in cases:
        rng = random.Random(case)
        name = rng.choice(list(KINDS))
        whole, original = bags[name]
        folder = tmp_path / "bag"
        shutil.copytree(whole, folder)
        done = damage(folder, rng)
        try:
            given += check(folder, name, original)
            if case % 5 == 0:
                check_recovery(folder, original, tmp_path / "new")
        except Exception as error:  # every kind is a failure here
            failures.append(f"{case}, {name}, {done}: {type(error).__name__} {error}")
        shutil.rmtree(folder)
        shutil.rmtree(tmp_path / "new", ignore_errors=True)
    assert not failures, f"{len(failures)} failures\n" + "\n".join(failures[:20])
    assert given > len(cases) / 4  # the bags are not all refused


def test_random_damage(bags, tmp_path):
    fuzz(bags, tmp_path, range(100))


@pytest.mark.long
@pytest.mark.timeout(600)
def test_much_random_damage(bags, tmp_path):
    fuzz(bags, tmp_path, range(1000, 2000))


def test_the_whole_bags_are_read_without_a_warning(bags, tmp_path):
    for name, (folder, original) in bags.items():
        assert check(folder, name, original) == 2
        reader = BagReader(folder)
        assert [tuple(message) for message in reader.messages()] == original
        assert bool(reader.warnings) == (name == "unfinished"), name
