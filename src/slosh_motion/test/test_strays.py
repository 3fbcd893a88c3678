"""Tests that messages with wrong stamps are excluded and change nothing else."""

import itertools
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slosh_bag.bag_writer import BagWriter
from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.bag_contents import bag_contents
from slosh_bag.reader import BagReader
from slosh_bag.recover import NotedDefinitions
from slosh_motion.recorded.motion import StrayFilter
from slosh_replay.replay import replay_bag
from slosh_replay.split import split_bag
from slosh_replay.tables.bag_table import TableSettings, read_bag_table

BAG = Path(__file__).resolve().parents[3] / "bags" / "c3"
SECOND = 10**9
ACCEL, SURFACE, SETTINGS = "/slosh/accel", "/slosh/free_surface", "/slosh/settings"
LIVE = ("/slosh/estimate", "/slosh/comparison")
Change = Callable[[str, int, int], int]


def changed(folder: Path, change: Change, without: tuple[str, ...] = ()) -> Path:
    """Writes a copy of a shipped bag with changed stamps.

    Args:
        folder: of the new bag.
        change: from topic, number of the message on it and stamp [ns] to the stamp that it gets.
        without: topics that are left out.
    """
    reader, counts = BagReader(BAG), dict.fromkeys((ACCEL, SURFACE), 0)
    topics = bag_contents(BAG).topics
    assert reader.topics().keys() == topics.keys()  # by now it knows their definitions
    with BagWriter(folder, NotedDefinitions(reader.types), reader.metadata()) as writer:
        for name, topic in topics.items():
            if name not in without:
                writer.add_topic(name, topic.message_type, *topic.offered[:1])
        for message in reader.messages():
            data = bytearray(message.data)
            if message.topic in counts:
                counts[message.topic] += 1
                seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
                stamp = seconds * SECOND + nanoseconds
                stamp = change(message.topic, counts[message.topic], stamp)
                struct.pack_into("<iI", data, 4, *divmod(stamp, SECOND))
            if message.topic not in without:
                writer.write(message.topic, bytes(data), message.log_ns)
    return folder


def stray(topic: str, new: Callable[[int], int]) -> Change:
    """Returns a function that changes the stamp of a topic's 300th message."""
    return lambda name, number, stamp: new(stamp) if (name, number) == (topic, 300) else stamp


@pytest.mark.first(1)
@pytest.mark.parametrize("ahead", [150_000_000, 5 * SECOND, 200_000_000 * SECOND])
def test_a_sample_ahead_is_set_aside_and_told(ahead: int, tmp_path: Path) -> None:
    bag = changed(tmp_path / "bag", stray(ACCEL, lambda stamp: stamp + ahead), without=LIVE)
    result = replay_bag(bag)
    assert any("set aside 1 inputs" in line for line in result.warnings)
    assert result.counters["samples_used"] == 4608
    assert result.accuracy[3].sigma < 0.0002
    table = read_bag_table(bag, TableSettings())
    assert any(
        "1 samples of accel with out-of-sequence stamps left out" in note for note in table.notes
    )


@pytest.mark.first(2)
@pytest.mark.parametrize(
    "new",
    [
        lambda stamp: 0,
        lambda stamp: -(2**31) * SECOND,
        lambda stamp: (2**31 - 1) * SECOND,
        lambda stamp: stamp - 5 * SECOND,
        lambda stamp: stamp + 60 * SECOND,
    ],
)
def test_an_image_with_a_strange_stamp_is_set_aside_and_told(
    new: Callable[[int], int], tmp_path: Path
) -> None:
    result = replay_bag(changed(tmp_path / "bag", stray(SURFACE, new)))
    assert any("set aside 1 images" in line for line in result.warnings)
    assert (np.diff(result.stamps) > 0).all()
    assert result.verification is not None
    assert result.verification.exact


def test_a_bag_is_cut_where_time_was_set_back(tmp_path: Path) -> None:
    bag = changed(
        tmp_path / "bag",
        lambda name, number, stamp: stamp - 3600 * SECOND * (number > 2000 and name == ACCEL),
        without=LIVE,
    )
    with pytest.raises(SloshBagError, match=r"slosh recover --split .*bag -o NEW"):
        replay_bag(bag)
    parts = split_bag(bag, tmp_path / "parts", lambda count: None)
    assert [part.name for part in parts] == ["part_1", "part_2"]
    counts = [{n: t.count for n, t in BagReader(part).topics().items()} for part in parts]
    assert [count[ACCEL] for count in counts] == [2000, 2609]
    surfaces = BagReader(BAG).topics()[SURFACE].count
    assert sum(count.get(SURFACE) or 0 for count in counts) == surfaces
    assert counts[0][SETTINGS] == counts[1][SETTINGS] == BagReader(BAG).topics()[SETTINGS].count
    assert [replay_bag(part).counters["samples_used"] for part in parts] == [2000, 2609]


def test_messages_that_were_recorded_late_are_told_and_each_part_replays(tmp_path: Path) -> None:
    """Tests that messages recorded late are reported and that each part is replayed."""
    bag, reader = tmp_path / "bag", BagReader(BAG)
    messages = [message for message in reader.messages() if message.topic != "/slosh/comparison"]
    first = next(message.log_ns for message in messages if message.topic == ACCEL)
    ends = [first + 2 * SECOND, first + 3 * SECOND, first + 33 * SECOND // 10]
    logs = [message.log_ns for message in messages]
    b, c, d = np.searchsorted(logs, ends).tolist()
    numbers, log_ns = itertools.count(1), 0
    with BagWriter(bag, NotedDefinitions(reader.types), reader.metadata()) as writer:
        for name, topic in bag_contents(BAG).topics.items():
            if name != "/slosh/comparison":
                writer.add_topic(name, topic.message_type, *topic.offered[:1])
        for message in messages[:b] + messages[c:d] + messages[b:c] + messages[d:]:
            log_ns = max(log_ns, message.log_ns)
            writer.write(message.topic, message.data, log_ns)
            if message.topic == ACCEL and next(numbers) == 300:
                data = bytearray(message.data)
                struct.pack_into("<i", data, 4, struct.unpack_from("<i", data, 4)[0] + 5)
                writer.write(ACCEL, bytes(data), log_ns)
    with pytest.raises(SloshBagError, match="recorded later than ones sent after them: split"):
        replay_bag(bag)
    parts = split_bag(bag, tmp_path / "parts", lambda count: None)
    results = [replay_bag(part) for part in parts]
    taken = [
        result.counters["samples_used"] + result.counters["samples_dropped"] for result in results
    ]
    inputs = [message.topic == ACCEL for message in messages]
    assert taken == [sum(inputs[:b] + inputs[c:d]), sum(inputs[b:c] + inputs[d:])]
    assert results[0].counters["not_used_live"] >= 1  # the input that nobody took


def test_a_bag_whose_time_goes_on_is_not_cut(tmp_path: Path) -> None:
    with pytest.raises(SloshBagError, match="never go back: nothing to split"):
        split_bag(BAG, tmp_path / "parts", lambda count: None)
    assert not (tmp_path / "parts").exists()


@pytest.mark.parametrize("size", [1, 2, 3, 100])
def test_what_is_astray_does_not_depend_on_the_parts_in_which_it_comes(size: int) -> None:
    stamps = np.array([1, 2, 90, 3, 4, 70, 60, 5, 6, 99])
    sorting, kept = StrayFilter(50), []
    for start in range(0, len(stamps), size):
        part = stamps[start : start + size]
        kept += sorting.add(part, {"stamp": part})[1]["stamp"].tolist()
    kept += sorting.rest()[0].tolist()
    assert kept == [1, 2, 3, 4, 70, 60, 5, 6, 99]
    assert sorting.count == 1
