"""Writes a bag: one MCAP file, with the metadata.yaml that rosbag2 wants beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml
from mcap.writer import CompressionType, Writer

from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError

PROFILE = "ros2"
METADATA_VERSION = 9
SERIALIZATION = "cdr"
_INFINITE = {"sec": 9223372036, "nsec": 854775807}


@dataclass(frozen=True, slots=True)
class Qos:
    """What a publisher offers, as rosbag2 notes it.

    Attributes:
        reliability: 'reliable' or 'best_effort'.
        durability: 'volatile' or 'transient_local'.
        depth: history depth.
    """

    reliability: str = "reliable"
    durability: str = "volatile"
    depth: int = 10

    def document(self) -> dict[str, Any]:
        """The keys and values of rosbag2's offered_qos_profiles."""
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


@dataclass(slots=True)
class _Topic:
    message_type: str
    channel: int
    qos: Qos
    count: int = 0


class BagWriter:
    """A bag that is being written; a context manager.

    The folder DIR gets DIR/<name of DIR>_0.mcap and, at the end, DIR/metadata.yaml.

    Args:
        folder: the bag's folder; it must not hold a bag already.
        definitions: where message definitions come from.
        custom: facts about the whole bag, kept in metadata.yaml and in the MCAP file.

    Raises:
        SloshBagError: the folder holds files, or cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        definitions: Definitions | None = None,
        custom: Mapping[str, str] | None = None,
    ) -> None:
        self.folder = folder
        self._definitions = definitions or Definitions()
        self._custom = dict(custom or {})
        self._topics: dict[str, _Topic] = {}
        self._schemas: dict[str, int] = {}
        self._first_ns: int | None = None
        self._last_ns = 0
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise SloshBagError(f"{folder}: exists already; choose another folder or remove it")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.path = folder / f"{folder.resolve().name}_0.mcap"
            self._file = self.path.open("wb")
        except OSError as error:
            raise SloshBagError(f"{folder}: {error.strerror}") from None
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE, library="slosh_bag")

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def counts(self) -> dict[str, int]:
        """Messages by topic."""
        return {name: topic.count for name, topic in self._topics.items()}

    def add_topic(self, name: str, message_type: str, qos: Qos | None = None) -> None:
        """Announces a topic before its first message.

        Raises:
            SloshBagError: the type has no definition here, or the topic another type.
        """
        known = self._topics.get(name)
        if known is not None:
            if known.message_type != message_type:
                raise SloshBagError(f"{name}: is {known.message_type}, not {message_type}")
            return
        if message_type not in self._schemas:
            text = self._definitions.text(message_type)
            self._schemas[message_type] = self._writer.register_schema(
                message_type, "ros2msg", text.encode()
            )
        qos = qos or Qos()
        channel = self._writer.register_channel(
            name,
            SERIALIZATION,
            self._schemas[message_type],
            {
                "offered_qos_profiles": yaml.safe_dump([qos.document()], sort_keys=False),
                "topic_type_hash": self._definitions.hash(message_type),
            },
        )
        self._topics[name] = _Topic(message_type, channel, qos)

    def write(self, topic: str, data: bytes, log_ns: int, publish_ns: int | None = None) -> None:
        """Appends a serialised message.

        Args:
            topic: a topic that was added.
            data: CDR bytes, written as they are.
            log_ns: when it was received [ns].
            publish_ns: when it was sent [ns]; None: as log_ns.
        """
        entry = self._topics[topic]
        self._writer.add_message(
            entry.channel,
            log_ns,
            data,
            log_ns if publish_ns is None else publish_ns,
            entry.count,
        )
        entry.count += 1
        self._first_ns = log_ns if self._first_ns is None else min(self._first_ns, log_ns)
        self._last_ns = max(self._last_ns, log_ns)

    def flush(self) -> None:
        """Ends the current chunk and hands all bytes to the operating system.

        A process that is killed afterwards loses nothing of them.
        """
        self._writer.flush()
        self._file.flush()

    def close(self) -> None:
        """Finishes the file and writes metadata.yaml."""
        if self._file.closed:
            return
        for key, value in self._custom.items():
            self._writer.add_metadata("slosh", {key: value})
        self._writer.finish()
        self._file.close()
        document = {"rosbag2_bagfile_information": self._information()}
        (self.folder / "metadata.yaml").write_text(yaml.safe_dump(document, sort_keys=False))

    def _information(self) -> dict[str, Any]:
        start = {"nanoseconds_since_epoch": self._first_ns or 0}
        duration = {"nanoseconds": self._last_ns - (self._first_ns or 0)}
        total = sum(self.counts.values())
        file = {
            "path": self.path.name,
            "starting_time": start,
            "duration": duration,
            "message_count": total,
        }
        return {
            "version": METADATA_VERSION,
            "storage_identifier": "mcap",
            "duration": duration,
            "starting_time": start,
            "message_count": total,
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": name,
                        "type": topic.message_type,
                        "serialization_format": SERIALIZATION,
                        "offered_qos_profiles": [topic.qos.document()],
                        "type_description_hash": self._definitions.hash(topic.message_type),
                    },
                    "message_count": topic.count,
                }
                for name, topic in self._topics.items()
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self.path.name],
            "files": [file],
            "custom_data": self._custom or None,
            "ros_distro": "jazzy",
        }
