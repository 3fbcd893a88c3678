"""Lists a bag's topics and message counts, if possible without reading all messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Schema

from slosh_bag.bag_writer import Qos
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.mcap_summary import read_summary
from slosh_bag.mcap_files.mcap_walk import McapWalk
from slosh_bag.reader import bag_files
from slosh_base.files.errors import YamlError
from slosh_base.files.yaml_document import parse_yaml

# Numbers that rosbag2 wrote before it wrote words.
_RELIABILITY = {1: "reliable", 2: "best_effort"}
_DURABILITY = {1: "transient_local", 2: "volatile"}


@dataclass(frozen=True, slots=True)
class BagTopic:
    """A topic of a bag, with its type and message count.

    Attributes:
        message_type: e.g. 'slosh_msgs/msg/FreeSurface'.
        definition: the type's full definition as the bag has it.
        encoding: of its messages, 'cdr' in bags of ROS 2.
        offered: what its publishers offered; empty: not noted.
    """

    message_type: str
    definition: str
    encoding: str
    offered: tuple[Qos, ...] = ()

    @property
    def latched(self) -> bool:
        """Whether late subscribers receive messages published earlier (transient local)."""
        return any(qos.durability == "transient_local" for qos in self.offered)


@dataclass(slots=True)
class BagContents:
    """The topics of a bag, with their types and message counts.

    Attributes:
        topics: by name.
        first_ns, last_ns: least and greatest log time [ns]; None: there is no message.
        warnings: what is missing of files without an end, one line each.
    """

    topics: dict[str, BagTopic] = field(default_factory=dict)
    first_ns: int | None = None
    last_ns: int | None = None
    warnings: list[str] = field(default_factory=list)


def bag_contents(path: Path) -> BagContents:
    """Returns a bag's contents; of an unfinished or truncated file, only of its readable part.

    Args:
        path: a folder with MCAP files, or one MCAP file.

    Raises:
        SloshBagError: there is no readable bag.
    """
    contents = BagContents()
    for file in bag_files(path):
        if not _add_summary(contents, file):
            _add_whole(contents, file)
    return contents


def _add_summary(contents: BagContents, file: Path) -> bool:
    """Adds topics and counts of a file's summary to a list; False if the summary is unreliable."""
    with file.open("rb") as stream:
        found = read_summary(stream, file.stat().st_size)
        if found is None or not found.trusted:
            return False
        stream.seek(0)
        try:
            statistics = make_reader(stream).get_summary().statistics
        except (McapError, AttributeError):
            return False
    if statistics is None:
        return False
    if statistics.message_count:
        _widen(contents, statistics.message_start_time)
        _widen(contents, statistics.message_end_time)
    for channel in found.channels.values():
        _add_channel(contents, channel, found.schemas)
    return True


def _add_whole(contents: BagContents, file: Path) -> None:
    """Adds a file's topics and counts to a list by reading the file to its end or first damage."""
    walk = McapWalk(file)
    for _ in walk.chunks():
        pass
    found = walk.found
    if found.first_ns is not None and found.last_ns is not None:
        _widen(contents, found.first_ns)
        _widen(contents, found.last_ns)
    for channel in found.channels.values():
        _add_channel(contents, channel, found.schemas)
    contents.warnings += walk.warnings


def _widen(contents: BagContents, time_ns: int) -> None:
    first, last = contents.first_ns, contents.last_ns
    contents.first_ns = time_ns if first is None else min(first, time_ns)
    contents.last_ns = time_ns if last is None else max(last, time_ns)


def _add_channel(contents: BagContents, channel: Channel, schemas: Mapping[int, Schema]) -> None:
    schema = schemas.get(channel.schema_id)
    if schema is None:
        return  # a message without a type says nothing to anyone
    before = contents.topics.get(channel.topic)
    if before is not None and before.message_type != schema.name:
        raise SloshBagError(
            f"{channel.topic}: is {before.message_type} and {schema.name} in the same bag"
        )
    offered = parse_offered(channel.metadata.get("offered_qos_profiles", ""))
    contents.topics[channel.topic] = BagTopic(
        schema.name,
        schema.data.decode(errors="replace"),
        channel.message_encoding,
        (*(before.offered if before else ()), *offered),
    )


def parse_offered(text: str) -> list[Qos]:
    """Parses the QoS profiles of a topic's publishers in the form that rosbag2 stores."""
    try:
        document = parse_yaml(text, "QoS profiles").value
    except YamlError:
        return []
    entries = document if isinstance(document, list) else []
    return [_parse_profile(entry) for entry in entries if isinstance(entry, dict)]


def _parse_profile(entry: Mapping[str, Any]) -> Qos:
    reliability, durability = entry.get("reliability"), entry.get("durability")
    depth = entry.get("depth")
    return Qos(
        "best_effort" if _word(reliability, _RELIABILITY) == "best_effort" else "reliable",
        "transient_local" if _word(durability, _DURABILITY) == "transient_local" else "volatile",
        depth if isinstance(depth, int) and depth > 0 else Qos().depth,
    )


def _word(value: Any, words: Mapping[int, str]) -> str:
    return words.get(value, "") if isinstance(value, int) else str(value)
