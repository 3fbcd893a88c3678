"""Generated bags of a fleet, and tasks on them that worker processes import.

A bag has the messages of a shipped recording, several times, with their stamps moved in time.
"""

from __future__ import annotations

import struct
import time
from pathlib import Path
from typing import Final

import psutil

from slosh_bag.bag_writer import BagWriter
from slosh_bag.reader import BagReader
from slosh_bag.recover import NotedDefinitions
from slosh_base.files import new_folder
from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.discovery_task import discovery_task
from slosh_bringup.replay.task import Task, replay_task
from slosh_discovery.discovering import DiscoveryRequest
from slosh_fleet.ingest_command import ingest_task

ROOT: Final = Path(__file__).resolve().parents[2]
SOURCES: Final = tuple(ROOT / "bags" / name for name in ("l", "l3", "c", "c3", "e", "e3"))
TOPICS: Final = frozenset(
    f"/slosh/{name}"
    for name in ("accel", "estimate", "comparison", "free_surface", "limit_event", "settings")
)
MOTIONS: Final = 3
"""Motions in a generated bag."""
APART: Final = 60 * SECOND
"""From one motion to the next [ns]."""
_STAMP: Final = struct.Struct("<iI")
_CDR_HEAD: Final = 4


def make_bag(number: int, folder: Path) -> Path:
    """Writes the bag with a given number unless it exists; returns its folder."""
    place = folder / f"{number:05d}"
    if place.is_dir():
        return place
    reader = BagReader(SOURCES[number % len(SOURCES)])
    messages = sorted(reader.messages(TOPICS), key=lambda message: message.log_ns)
    types, definitions = reader.topics(), NotedDefinitions(reader.types)
    with new_folder(place) as part, BagWriter(part, definitions) as writer:
        for topic in sorted(TOPICS & types.keys()):
            writer.add_topic(topic, types[topic].message_type)
        for motion in range(MOTIONS):
            offset = (number * MOTIONS + motion) * APART
            for topic, _, log_ns, publish_ns, data in messages:
                if motion and topic == "/slosh/settings":
                    continue
                writer.write(topic, moved(data, offset), log_ns + offset, publish_ns + offset)
    return place


def moved(data: bytes, offset: int) -> bytes:
    """Returns a serialised message whose header stamp is increased by an offset [ns]."""
    seconds, nanoseconds = _STAMP.unpack_from(data, _CDR_HEAD)
    stamp = _STAMP.pack(*divmod(seconds * SECOND + nanoseconds + offset, SECOND))
    return data[:_CDR_HEAD] + stamp + data[_CDR_HEAD + _STAMP.size :]


def ingest_one(store: str, bag: Path) -> float:
    """Adds a bag's motions to the store; returns the duration [s]."""
    begin = time.perf_counter()
    ingest_task(store, bag)
    return time.perf_counter() - begin


def replay_one(bag: Path) -> float:
    """Replays a bag; returns the duration [s]."""
    begin = time.perf_counter()
    replay_task(Task(bag, bag.name))
    return time.perf_counter() - begin


def discover_one(output: str, bag: Path) -> float:
    """Runs a discovery from the motions of a bag; returns the time taken [s]."""
    begin = time.perf_counter()
    discovery_task(DiscoveryRequest((bag,), Path(output, bag.name), from_bag=True))
    return time.perf_counter() - begin


def nothing(number: int) -> float:
    """Does nothing, to measure the overhead of a task."""
    return float(number)


def processor_time() -> float:
    """Returns the processor time of this process [s]."""
    return time.process_time()


def resident() -> float:
    """Returns the resident memory of this process [MiB]."""
    return float(psutil.Process().memory_info().rss) / 2**20
