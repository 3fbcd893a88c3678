"""Imports bags of other programs: ROS 1 bags, rosbag2's SQLite files and MCAP files.

Messages keep their time of recording; MCAP's second time, that of sending, does not come along.
What cannot be converted is left out and told.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.interfaces import Connection, ConnectionExtRosbag1, QosDurability, QosReliability

from slosh_bag.bag_writer import BagWriter, Qos
from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.foreign_readers import ROS1_SUFFIX, foreign_reader, not_read, told_by
from slosh_bag.interchange.rosbag_types import Convert, message_converter
from slosh_bag.interchange.topic_choice import find_topic
from slosh_base.files import check_outside, new_folder

SUFFIXES = (ROS1_SUFFIX, ".db3", ".mcap")
_TOPIC_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


class RosbagImport(NamedTuple):
    """Result of importing another program's bag.

    Attributes:
        bag: the new bag's folder.
        counts: messages by topic, under its new name.
        notes: what was left out or changed, one line each.
        lost: messages that the bag counts and that did not come, one line each.
    """

    bag: Path
    counts: dict[str, int]
    notes: tuple[str, ...]
    lost: tuple[str, ...] = ()


class _Route(NamedTuple):
    """Target topic, message type and conversion for the messages of one source connection."""

    topic: str
    message_type: str
    convert: Convert
    qos: Qos


def find_rosbags(path: Path) -> list[Path]:
    """Returns the bags at a path: the path itself, or the `.bag` files of a folder.

    Raises:
        SloshBagError: there is none.
    """
    if not path.exists():
        raise SloshBagError(f"{path}: no such file or folder")
    if path.is_dir():
        found = _bags_in(path)
        if not found:  # the folder of a download, or what `slosh import` made
            inner = sorted(entry for entry in path.iterdir() if entry.is_dir())
            found = [bag for entry in inner for bag in _bags_in(entry)]
        if not found:
            raise SloshBagError(f"{path}: holds no metadata.yaml, .bag, .db3 or .mcap")
        return found
    if path.suffix not in SUFFIXES:
        raise SloshBagError(f"{path}: is not one of {', '.join(SUFFIXES)}; unpack it first")
    return [path]


def _bags_in(folder: Path) -> list[Path]:
    if (folder / "metadata.yaml").exists():
        return [folder]
    return sorted(file for suffix in SUFFIXES for file in folder.glob(f"*{suffix}"))


def import_rosbag(
    source: Path,
    bag: Path,
    topics: Sequence[str] = (),
    rename: Mapping[str, str] | None = None,
    progress: Callable[[int, int], object] = lambda done, total: None,
) -> RosbagImport:
    """Converts another program's bag to a slosh bag.

    Args:
        source: a `.bag`, `.db3` or `.mcap` file, or a rosbag2 folder.
        bag: the new bag's folder; it must not hold a bag already.
        topics: only these; empty: all.
        rename: new names by old ones.
        progress: is told the number of messages so far and in all.

    Raises:
        SloshBagError: the source is damaged or no bag, a topic is not in it, nothing in it can be
            converted.
        SloshFileError: the bag's folder holds something, or lies in the source.
        OSError: the bag cannot be written.
    """
    check_outside(bag, [source])
    definitions = Definitions()
    with _opened(source) as reader:
        names = _new_names(source, reader.connections, topics, rename or {})
        routes, notes = _routes(reader.connections, names, definitions)
        if not routes:
            raise SloshBagError(
                "; ".join([f"{source}: holds no topic that can be converted", *notes])
            )
        facts = {**_facts(reader), "imported_from": source.name}
        with new_folder(bag) as room, BagWriter(room, definitions, facts) as writer:
            for route in routes.values():
                writer.add_topic(route.topic, route.message_type, route.qos)
            failures, lost = _copy(source, reader, routes, writer, progress)
            counts = dict(writer.counts)
            if not sum(counts.values()):
                raise SloshBagError(
                    "; ".join(
                        [f"{source}: holds no message that can be converted", *failures, *lost]
                    )
                )
            warnings = told_by(reader)
            beside = not_read(reader)
            if beside:
                lost.append(
                    f"not read, because metadata.yaml does not list them: {', '.join(beside)}; "
                    "import these files separately"
                )
    return RosbagImport(bag, counts, (*notes, *failures, *warnings), tuple(lost))


def _copy(
    source: Path,
    reader: Any,
    routes: dict[int, _Route],
    writer: BagWriter,
    progress: Callable[[int, int], object],
) -> tuple[list[str], list[str]]:
    """Copies all messages; returns notes about omitted topics and about missing messages."""
    wanted = [connection for connection in reader.connections if connection.id in routes]
    total = sum(connection.msgcount for connection in wanted)
    failed: Counter[str] = Counter()
    taken: Counter[int] = Counter()
    messages = _guarded(source, reader.messages(connections=wanted))
    for done, (connection, stamp_ns, data) in enumerate(messages, start=1):
        route = routes[connection.id]
        try:
            converted = route.convert(data)
        except Exception:  # whatever damaged bytes cause in the library
            failed[route.topic] += 1
        else:
            writer.write(route.topic, converted, stamp_ns)
            taken[connection.id] += 1
        progress(done, total)
    lost = [
        f"{each.topic}: {taken[each.id]} of {each.msgcount} messages imported"
        for each in wanted
        if taken[each.id] < each.msgcount
    ]
    return [f"{topic}: {count} damaged messages left out" for topic, count in failed.items()], lost


@contextmanager
def _opened(source: Path) -> Iterator[Any]:
    """Opens the reader of another program's bag in a `with` block.

    Raises:
        SloshBagError: it cannot be opened.
    """
    try:
        reader = foreign_reader(source)
        reader.open()
    except Exception as error:  # whatever broken bytes cause in the library
        raise _unreadable(source, error) from None
    try:
        yield reader
    finally:
        reader.close()


def _guarded(source: Path, messages: Iterator[Any]) -> Iterator[Any]:
    """Yields the messages; converts rosbags' exceptions for damaged data to SloshBagError."""
    while True:
        try:
            message = next(messages)
        except StopIteration:
            return
        except Exception as error:
            raise _unreadable(source, error) from None
        yield message


def _unreadable(source: Path, error: Exception) -> SloshBagError:
    reason = (str(error).splitlines() or [""])[0].rstrip(".") or type(error).__name__
    if isinstance(error, SloshBagError) and reason.startswith(str(source)):
        return error
    return SloshBagError(f"{source}: cannot be read: {reason}")


def _new_names(
    source: Path,
    connections: Sequence[Connection],
    topics: Sequence[str],
    rename: Mapping[str, str],
) -> dict[str, str]:
    """Returns the new topic names of the requested topics by their old names.

    Raises:
        SloshBagError: there is no such topic, a new name is not one, or two become one.
    """
    known = {connection.topic for connection in connections}
    wanted = {find_topic(source, known, name) for name in topics} or known
    # ROS 1 knows names without a slash; rosbag2 does not play them.
    names = {topic: topic if topic.startswith("/") else f"/{topic}" for topic in sorted(wanted)}
    for old, new in rename.items():
        if not _TOPIC_NAME.fullmatch(new):
            raise SloshBagError(f"{new!r} is not a topic name such as /slosh/imu")
        names[find_topic(source, wanted, old)] = new
    for new, count in Counter(names.values()).items():
        if count > 1:
            both = " and ".join(old for old, name in names.items() if name == new)
            raise SloshBagError(f"{source}: {both} would both become {new}")
    return names


def _routes(
    connections: Sequence[Connection], names: Mapping[str, str], definitions: Definitions
) -> tuple[dict[int, _Route], list[str]]:
    """Returns the routes by connection, and notes about omitted or changed topics."""
    routes: dict[int, _Route] = {}
    types: dict[str, str] = {}
    notes: dict[str, None] = {}
    for connection in connections:
        if connection.topic not in names:
            continue
        topic = names[connection.topic]
        ros1 = isinstance(connection.ext, ConnectionExtRosbag1)
        try:
            _check_encoding(connection)
            kind, convert, changes = message_converter(connection, definitions, ros1=ros1)
            if types.setdefault(topic, kind) != kind:
                raise SloshBagError(f"{kind}: the topic had the type {types[topic]} before")
        except SloshBagError as error:
            notes[f"{connection.topic}: left out: {error}"] = None
            continue
        if changes:
            notes[f"{connection.topic}: {changes}"] = None
        routes[connection.id] = _Route(topic, kind, convert, _qos(connection))
    return routes, list(notes)


def _check_encoding(connection: Connection) -> None:
    """Raises an error for messages in an encoding other than ROS 1 or CDR."""
    encoding = getattr(connection.ext, "serialization_format", "cdr")
    if encoding not in ("cdr", ""):
        raise SloshBagError(
            f"messages in {encoding!r}: only those of ROS 1 and ROS 2 (CDR) can be converted"
        )


def _qos(connection: Connection) -> Qos:
    """Returns the recorded publisher's QoS profile, with defaults for missing values."""
    if isinstance(connection.ext, ConnectionExtRosbag1):
        return Qos(durability="transient_local", depth=1) if connection.ext.latching else Qos()
    offered = connection.ext.offered_qos_profiles
    if not offered:
        return Qos()
    best_effort = offered[0].reliability == QosReliability.BEST_EFFORT
    latched = offered[0].durability == QosDurability.TRANSIENT_LOCAL
    return Qos(
        "best_effort" if best_effort else "reliable",
        "transient_local" if latched else "volatile",
        offered[0].depth or Qos().depth,
    )


def _facts(reader: Any) -> dict[str, str]:
    """Returns the metadata of the whole bag from its metadata.yaml."""
    storage = getattr(reader, "storage", None)
    custom = getattr(getattr(storage, "metadata", None), "custom", None)
    return {str(key): str(value) for key, value in (custom or {}).items()}
