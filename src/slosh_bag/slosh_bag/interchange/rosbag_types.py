"""Converts message types of bags of other programs.

A type that is known here (ROS 2 Jazzy's, and those of the installed packages) arrives as it is
defined here: readers take a known type's definition for granted. Any other keeps the definition
that its bag holds, in ROS 2's form.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rosbags.convert.converter import STATIC_MSGTYPE_RENAMES, is_same_wireformat, migrate_bytes
from rosbags.interfaces import Connection, MessageDefinitionFormat, Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from slosh_bag.definitions import Definitions, read_types
from slosh_bag.errors import SloshBagError

Convert = Callable[[bytes], bytes]
HEADER = "std_msgs/msg/Header"


def message_converter(
    connection: Connection, definitions: Definitions, *, ros1: bool
) -> tuple[str, Convert, str]:
    """Returns the function that converts a connection's messages.

    Args:
        connection: of the foreign bag.
        definitions: those here; gets the type where it is not known.
        ros1: whether the messages are ROS 1's.

    Returns:
        the type, the conversion of a message's bytes, and what the conversion changes; empty:
        nothing but ROS 1's form.

    Raises:
        SloshBagError: the type cannot be converted; one line without the topic.
    """
    kind: str = STATIC_MSGTYPE_RENAMES.get(connection.msgtype, connection.msgtype)
    if connection.msgdef.format == MessageDefinitionFormat.NONE:
        return kind, _as_it_is(connection, definitions), ""
    try:
        source = _source_types(connection)
        _make_known(kind, connection.msgtype, source, definitions)
        return _conversion(kind, connection.msgtype, source, definitions.typestore, ros1=ros1)
    except Exception as error:  # whatever a broken definition causes in the library
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise SloshBagError(f"the definition of {kind} cannot be used: {reason}") from None


def _as_it_is(connection: Connection, definitions: Definitions) -> Convert:
    """Checks that a type recorded without its definition matches the installed definition."""
    known = definitions.hash(connection.msgtype)  # raises where there is none
    if connection.digest and connection.digest != known:
        raise SloshBagError(
            f"{connection.msgtype} was recorded with another definition, which the bag does not "
            "hold"
        )
    return bytes


def _source_types(connection: Connection) -> Typestore:
    """Returns the message definitions that the connection contains.

    Each connection has a store of its own: what is wrong with one does not touch the others.
    """
    plain = connection.msgdef.format == MessageDefinitionFormat.MSG
    encoding = "ros2msg" if plain else "ros2idl"
    store = get_typestore(Stores.EMPTY)
    store.register(read_types(encoding, connection.msgdef.data, connection.msgtype))
    return store


def _make_known(kind: str, source_kind: str, source: Typestore, here: Definitions) -> None:
    """Registers the bag's definition of a message type if none is installed."""
    try:
        here.hash(kind)
    except SloshBagError:
        text = source.generate_msgdef(source_kind, ros_version=2)[0]
        types = read_types("ros2msg", text, kind)
        for name in types:
            if name != kind:
                _load(name, here)
        known = here.typestore.fielddefs
        here.typestore.register({name: spec for name, spec in types.items() if name not in known})


def _load(name: str, here: Definitions) -> None:
    try:
        here.hash(name)
    except SloshBagError:
        return  # not known here: the bag's definition is taken


def _conversion(
    kind: str, source_kind: str, source: Typestore, here: Typestore, *, ros1: bool
) -> tuple[str, Convert, str]:
    # The same bytes under other names would be another message.
    named_alike = list(_fields(source, source_kind)) == list(_fields(here, kind))
    if named_alike and is_same_wireformat(source, here, source_kind, kind):
        if not ros1:
            return kind, bytes, ""
        return kind, lambda data: bytes(here.ros1_to_cdr(data, kind)), ""
    cache: dict[str, object] = {}

    def migrate(data: bytes) -> bytes:
        return bytes(
            migrate_bytes(
                source, here, source_kind, kind, cache, data, src_is2=not ros1, dst_is2=True
            )
        )

    return kind, migrate, _changes(kind, source_kind, source, here)


def _changes(kind: str, source_kind: str, source: Typestore, here: Typestore) -> str:
    """Describes in one line which fields differ between two definitions of a message type."""
    before, after = _fields(source, source_kind), _fields(here, kind)
    gone = sorted(before.keys() - after.keys())
    new = sorted(after.keys() - before.keys())
    changed = sorted(name for name in before.keys() & after.keys() if before[name] != after[name])
    told = [
        f"{what} {', '.join(names)}"
        for what, names in (
            ("without", gone),
            ("with new", new),
            ("with another type of", changed),
        )
        if names
    ]
    return f"converted to the definition of {kind} here" + (f", {'; '.join(told)}" if told else "")


def _fields(store: Typestore, kind: str, prefix: str = "") -> dict[str, Any]:
    """Returns the types of all fields by dotted lower-case name, without ROS 1's Header.seq."""
    found: dict[str, Any] = {}
    for name, description in store.fielddefs[kind][1]:
        several = description[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE)
        inner = description[1][0] if several else description
        path = f"{prefix}{name.lower()}"
        if kind == HEADER and name == "seq":
            continue
        if inner[0] == Nodetype.NAME:
            found |= _fields(store, inner[1], f"{path}.")
        else:
            found[path] = description
    return found
