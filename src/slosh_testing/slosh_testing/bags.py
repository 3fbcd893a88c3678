"""Writes small bags of Header messages with slosh_bag or with the library mcap."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.mcap_files.bag_metadata import Qos
from slosh_bag.reader import BagMessage, BagReader
from slosh_bag.recover import NotedDefinitions

HEADER = "std_msgs/msg/Header"
DEFINITIONS = Definitions()
DEFINITIONS.hash(HEADER)  # makes the type known
STORE = DEFINITIONS.typestore
SECOND, STEP = 1_000_000_000, 10_000_000


def header(number: int, frame: str | None = None) -> bytes:
    """Returns a serialised Header message whose stamp is a given number of seconds."""
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=number, nanosec=7)
    frame = f"frame {number}" if frame is None else frame
    return bytes(STORE.serialize_cdr(STORE.types[HEADER](stamp=stamp, frame_id=frame), HEADER))


def even_or_odd(number: int) -> str:
    """Returns the topic for a message number: '/even' or '/odd'."""
    return "/odd" if number % 2 else "/even"


def header_bag(
    folder: Path,
    count: int = 50,
    flush: int = 10,
    *,
    topic_of: Callable[[int], str] = even_or_odd,
    offered: Qos | None = None,
    data: Callable[[int], bytes] = header,
    **options: Any,
) -> Path:
    """Writes a bag of Header messages, one every 10 ms.

    Args:
        folder: of the bag.
        count: of messages.
        flush: messages in a chunk.
        topic_of: the topic of each message.
        offered: by the publishers; None: the default.
        data: of each message.
        options: of the writer.
    """
    with BagWriter(folder, **options) as writer:
        for topic in sorted({topic_of(number) for number in range(count)}):
            writer.add_topic(topic, HEADER, *([offered] if offered else []))
        for number in range(count):
            writer.write(topic_of(number), data(number), SECOND + number * STEP, number)
            if number % flush == flush - 1:
                writer.flush()
    return folder


def foreign_file(path: Path, times: Iterable[int | None], **options: Any) -> Path:
    """Writes an MCAP file with the library mcap, with given log times [ns]."""
    with path.open("wb") as stream:
        writer = Writer(stream, **{"chunk_size": 1 << 30, **options})
        writer.start("ros2")
        schema = writer.register_schema(HEADER, "ros2msg", DEFINITIONS.text(HEADER).encode())
        channel = writer.register_channel("/t", "cdr", schema)
        for number, log_ns in enumerate(times):
            if log_ns is None:
                writer.flush()
            else:
                writer.add_message(channel, log_ns, header(number), log_ns, number)
        writer.finish()
    return path


def chunk_places(content: bytes | bytearray) -> list[tuple[int, int]]:
    """Returns the start and end position of each chunk in an MCAP file."""
    places, at = [], 8
    while at + 9 <= len(content):
        (length,) = struct.unpack_from("<Q", content, at + 1)
        if content[at] == 6:
            places.append((at, at + 9 + length))
        at += 9 + length
    return places


def copied(
    bag: Path, folder: Path, kept: Callable[[BagMessage], bool] = lambda message: True
) -> Path:
    """Writes a copy of a bag that keeps only selected messages."""
    reader = BagReader(bag)
    topics = reader.topics()
    with BagWriter(folder, NotedDefinitions(reader.types)) as writer:
        for name, info in topics.items():
            writer.add_topic(name, info.message_type)
        for message in reader.messages():
            if kept(message):
                writer.write(message.topic, message.data, message.log_ns, message.publish_ns)
    return folder
