"""Measures how fast bags are read, compared with `mcap`, rosbags and bare decompression.

    tools/run python benchmarks/bench_bag_reading.py [--seconds 30] [--rounds 5]

AccelStamped and SloshEstimate at 1 kHz, FreeSurface and SloshComparison at 62.5 Hz, in chunks of
half a second as the recorder writes them. All in one run, each the best of several rounds:

- `limit`: zstd and CRC alone, over the same chunks;
- `blocks`, `columns`: as a replay reads; `columns` gives every value of every message;
- `messages`, `decoded`: message by message, in the order of their log times;
- `mcap`, `mcap checked`: mcap's reader, without and with checksums;
- `mcap decoded`: the same with mcap_ros2, without checksums;
- `rosbags`, `rosbags decoded`.

The goals: blocks below 1.5 µs, and with all columns below 5 µs, per ms of the recording; every
message decoded at half the speed of `mcap decoded` or more.
"""

from __future__ import annotations

import argparse
import resource
import struct
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from measuring import header_of, message_of, parsed
from rosbags.highlevel import AnyReader

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.reader import BagReader

RATE, EVERY, CHUNK = 1000, 16, 500
PROFILE = 40
TOPICS = {
    "/slosh/accel": "geometry_msgs/msg/AccelStamped",
    "/slosh/estimate": "slosh_msgs/msg/SloshEstimate",
    "/slosh/free_surface": "slosh_msgs/msg/FreeSurface",
    "/slosh/comparison": "slosh_msgs/msg/SloshComparison",
}


def main() -> None:
    """Measures and prints reading times per message, rates and ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parsed(parser, seconds=0.5, rounds=1)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        count = write_bag(bag, int(arguments.seconds * RATE))
        ways = {
            "limit": limit(bag / "bag_0.mcap"),
            "blocks": lambda: sum(len(block) for block in BagReader(bag).blocks()),
            "columns": lambda: read_columns(bag),
            "messages": lambda: sum(1 for _ in BagReader(bag).messages()),
            "decoded": lambda: read_decoded(bag),
            "mcap": lambda: read_mcap(bag, validate_crcs=False),
            "mcap checked": lambda: read_mcap(bag, validate_crcs=True),
            "mcap decoded": lambda: decode_mcap(bag),
            "rosbags": lambda: read_rosbags(bag),
            "rosbags decoded": lambda: decode_rosbags(bag),
        }
        times = {name: best(way, arguments.rounds, count) for name, way in ways.items()}
    for name, spent in times.items():
        per_ms = 1e3 * spent / arguments.seconds
        print(f"{name:<16} {per_ms:8.2f} µs per ms   {count / spent / 1e3:8.0f} k messages/s")
    for one, other in (
        ("blocks", "limit"),
        ("columns", "limit"),
        ("mcap", "blocks"),
        ("mcap checked", "messages"),
        ("mcap decoded", "columns"),
        ("mcap decoded", "decoded"),
    ):
        print(f"{one} / {other:<14} {times[one] / times[other]:8.2f}")
    print(f"real time / columns  {arguments.seconds / times['columns']:8.0f}")
    print(f"peak memory          {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10:8} MiB")


def best(way: Callable[[], int], rounds: int, count: int) -> float:
    """Returns the shortest processor time of several runs [s], after one uncounted run."""
    assert way() == count
    times = []
    for _ in range(rounds):
        started = time.process_time()
        way()
        times.append(time.process_time() - started)
    return min(times)


def write_bag(folder: Path, samples: int) -> int:
    """Writes a bag of random numbers, which compress badly; returns its message count."""
    definitions, rng = Definitions(), np.random.default_rng(0)
    with BagWriter(folder, definitions) as writer:
        for topic, kind in TOPICS.items():
            writer.add_topic(topic, kind)
        for sample in range(samples):
            stamp = 1_763_720_000_000_000_000 + sample * 10**9 // RATE
            for number, (topic, kind) in enumerate(TOPICS.items()):
                if number < 2 or not sample % EVERY:
                    message = filled(definitions.typestore, kind, stamp, rng)
                    data = bytes(definitions.typestore.serialize_cdr(message, kind))
                    writer.write(topic, data, stamp + 100_000 * number)
            if sample % CHUNK == CHUNK - 1:
                writer.flush()
        return sum(writer.counts.values())


def filled(store: Any, kind: str, stamp: int, rng: np.random.Generator) -> Any:
    """Returns a message with random numbers in all floating-point fields."""
    profile: dict[str, Any] = {
        name: rng.normal(size=PROFILE).astype(np.float32)
        for name, _ in store.fielddefs[kind][1]
        if "profile" in name
    }
    header = header_of(store, stamp, "container")
    return message_of(store, kind, rng.normal, header=header, **profile)


def limit(path: Path) -> Callable[[], int]:
    """Returns a function that only decompresses and checks the bag's chunks, as a lower bound."""
    content, chunks, at, total = path.read_bytes(), [], 8, 0
    while at + 9 <= len(content):
        (length,) = struct.unpack_from("<Q", content, at + 1)
        if content[at] == 6:
            (crc, name) = struct.unpack_from("<II", content, at + 33)
            chunks.append((memoryview(content)[at + 49 + name : at + 9 + length], crc))
        at += 9 + length
    total = sum(info.count or 0 for info in BagReader(path).topics().values())

    def run() -> int:
        unpacker = zstandard.ZstdDecompressor()
        for packed, crc in chunks:
            assert zlib.crc32(unpacker.decompress(packed)) == crc
        return total

    return run


def read_columns(bag: Path) -> int:
    """Reads every value of every message as columns; returns the message count."""
    reader = BagReader(bag)
    return sum(len(next(iter(reader.columns(block).values()))) for block in reader.blocks())


def read_decoded(bag: Path) -> int:
    """Reads and decodes every message to an object with BagReader; returns the count."""
    reader = BagReader(bag)
    return sum(reader.decode(message) is not None for message in reader.messages())


def read_mcap(bag: Path, *, validate_crcs: bool) -> int:
    """Reads every message's bytes with the library mcap; returns the message count."""
    with (bag / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=validate_crcs)
        return sum(1 for _ in reader.iter_messages())


def decode_mcap(bag: Path) -> int:
    """Reads and decodes every message with mcap_ros2; returns the message count."""
    with (bag / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return sum(1 for _ in reader.iter_decoded_messages())


def read_rosbags(bag: Path) -> int:
    """Reads every message's bytes with the library rosbags; returns the message count."""
    with AnyReader([bag]) as reader:
        return sum(1 for _ in reader.messages())


def decode_rosbags(bag: Path) -> int:
    """Reads and decodes every message with rosbags; returns the message count."""
    with AnyReader([bag]) as reader:
        return sum(
            reader.deserialize(data, connection.msgtype) is not None
            for connection, _, data in reader.messages()
        )


if __name__ == "__main__":
    main()
