"""Reads and writes a bag's metadata.yaml, version 9, compatible with rosbag2 of Jazzy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slosh_base.files import write_text
from slosh_base.files.yaml_document import format_yaml

NAME = "metadata.yaml"
VERSION = 9
SERIALIZATION = "cdr"
_INFINITE = {"sec": 9223372036, "nsec": 854775807}


@dataclass(frozen=True, slots=True)
class Qos:
    """A publisher's QoS profile, as rosbag2 stores it.

    Attributes:
        reliability: 'reliable' or 'best_effort'.
        durability: 'volatile' or 'transient_local'.
        depth: history depth.
    """

    reliability: str = "reliable"
    durability: str = "volatile"
    depth: int = 10

    def document(self) -> dict[str, Any]:
        """Returns the profile as a mapping for rosbag2's offered_qos_profiles."""
        return {
            "history": "keep_last",
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": _INFINITE,
            "lifespan": _INFINITE,
            "liveliness": "automatic",
            "liveliness_lease_duration": _INFINITE,
            "avoid_ros_namespace_conventions": False,
        }

    def documents(self) -> list[dict[str, Any]]:
        """Returns the profile as a list with one mapping."""
        return [self.document()]

    def text(self) -> str:
        """Returns the profile as YAML text for an MCAP channel."""
        return _text(self.documents())


@dataclass(frozen=True, slots=True)
class TopicFacts:
    """A topic as listed in metadata.yaml, with its type and message count.

    Attributes:
        name: its name.
        message_type: e.g. 'slosh_msgs/msg/FreeSurface'.
        type_hash: RIHS01 hash of the type.
        qos: what its publishers offered.
        count: its messages.
        encoding: of its messages.
    """

    name: str
    message_type: str
    type_hash: str
    qos: Qos
    count: int
    encoding: str = SERIALIZATION


@dataclass(frozen=True, slots=True)
class FileFacts:
    """A file as listed in metadata.yaml, with its times and message count.

    Attributes:
        name: its name in the bag's folder.
        start_ns, end_ns: log times of its first and last message [ns].
        count: its messages.
        size: its length [bytes].
    """

    name: str
    start_ns: int
    end_ns: int
    count: int
    size: int


def save(
    folder: Path,
    topics: Iterable[TopicFacts],
    files: Iterable[FileFacts],
    custom: Mapping[str, str],
) -> None:
    """Writes a bag's metadata.yaml atomically.

    Messages wait meanwhile: it does not wait for the disk, nor do the files that it describes.

    Raises:
        OSError: it cannot be written.
    """
    information = _information(list(topics), list(files), custom)
    write_text(folder / NAME, _text({"rosbag2_bagfile_information": information}), sync=False)


def _information(
    topics: list[TopicFacts], files: list[FileFacts], custom: Mapping[str, str]
) -> dict[str, Any]:
    # A file without a message has no times.
    filled = [file for file in files if file.count]
    start = min((file.start_ns for file in filled), default=0)
    end = max((file.end_ns for file in filled), default=0)
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **_span(start, end),
        "message_count": sum(file.count for file in files),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.message_type,
                    "serialization_format": topic.encoding,
                    "offered_qos_profiles": topic.qos.documents(),
                    "type_description_hash": topic.type_hash,
                },
                "message_count": topic.count,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [
            {
                "path": file.name,
                **_span(file.start_ns, file.end_ns),
                "message_count": file.count,
            }
            for file in files
        ],
        "custom_data": dict(custom) or None,
        "ros_distro": "jazzy",
    }


def _span(start_ns: int, end_ns: int) -> dict[str, Any]:
    return {
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "duration": {"nanoseconds": end_ns - start_ns},
    }


def _text(document: Any) -> str:
    return format_yaml(document, sort_keys=False)
