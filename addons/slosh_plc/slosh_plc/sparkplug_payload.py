"""Encodes payloads of Sparkplug B, the MQTT protocol of SCADA programs (protobuf).

The messages are described by their public field numbers (Eclipse Sparkplug 3.0, chapter 6); the
library protobuf packs them. Only what a cell needs is described: what else a payload holds is
skipped by readers.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, Final, NamedTuple

from slosh_plc.cell_state import Kind, Quality, Signal
from slosh_plc.server import missing

PACKAGE: Final = "slosh.sparkplug"
MESSAGES: Final[Mapping[str, Sequence[tuple[int, str, str]]]] = {
    "PropertyValue": (
        (1, "type", "uint32"), (2, "is_null", "bool"), (3, "int_value", "uint32"),
        (8, "string_value", "string"),
    ),
    "PropertySet": ((1, "keys", "string*"), (2, "values", "PropertyValue*")),
    "Metric": (
        (1, "name", "string"), (2, "alias", "uint64"), (3, "timestamp", "uint64"),
        (4, "datatype", "uint32"), (7, "is_null", "bool"), (9, "properties", "PropertySet"),
        (10, "int_value", "uint32"), (11, "long_value", "uint64"), (13, "double_value", "double"),
        (14, "boolean_value", "bool"), (15, "string_value", "string"),
    ),
    "Payload": ((1, "timestamp", "uint64"), (2, "metrics", "Metric*"), (3, "seq", "uint64")),
}  # fmt: skip
"""Fields of each message: number, name and type; a star: any number of them."""


class DataType(IntEnum):
    """Data types of metrics and properties, by their numbers in Sparkplug B."""

    INT32 = 3
    UINT32 = 7
    UINT64 = 8
    DOUBLE = 10
    BOOLEAN = 11
    STRING = 12


TYPES: Final = {
    Kind.FLAG: (DataType.BOOLEAN, "boolean_value", bool),
    Kind.COUNT: (DataType.UINT32, "int_value", int),
    Kind.CHOICE: (DataType.UINT32, "int_value", int),
    Kind.NUMBER: (DataType.DOUBLE, "double_value", float),
}
"""Data type, field and conversion of a value, by its kind."""
STALE: Final = 500
"""Quality of a value that nobody refreshes: the cell is lost."""
QUALITIES: Final = {Quality.GOOD: 192, Quality.UNCERTAIN: 0, Quality.BAD: 0}
"""Quality of a value in Sparkplug, which has none for an uncertain one."""


class Value(NamedTuple):
    """Value and quality of a Sparkplug metric; NaN means unknown."""

    value: float
    quality: int


def message(name: str) -> Any:
    """Returns the protobuf class of a Sparkplug message by its name in MESSAGES.

    Raises:
        SloshPlcError: protobuf is not installed.
    """
    return _classes()[name]


@functools.cache
def _classes() -> Mapping[str, Any]:
    try:
        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    except ModuleNotFoundError:
        raise missing("protobuf") from None
    described = descriptor_pb2.FileDescriptorProto(
        name="slosh_sparkplug.proto", package=PACKAGE, syntax="proto2"
    )
    field_type = descriptor_pb2.FieldDescriptorProto
    for own, fields in MESSAGES.items():
        made = described.message_type.add(name=own)
        for number, field, kind in fields:
            plain = kind.rstrip("*")
            label = field_type.LABEL_REPEATED if kind != plain else field_type.LABEL_OPTIONAL
            if plain in MESSAGES:
                made.field.add(
                    name=field, number=number, label=label, type=field_type.TYPE_MESSAGE,
                    type_name=f".{PACKAGE}.{plain}",
                )  # fmt: skip
            else:
                own_type = getattr(field_type, f"TYPE_{plain.upper()}")
                made.field.add(name=field, number=number, label=label, type=own_type)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(described)
    found = {name: pool.FindMessageTypeByName(f"{PACKAGE}.{name}") for name in MESSAGES}
    return {name: message_factory.GetMessageClass(one) for name, one in found.items()}


def payload(milliseconds: int, metrics: Sequence[Any], seq: int | None = None) -> bytes:
    """Returns the encoded Sparkplug payload of some metrics.

    Args:
        milliseconds: its time, since 1970.
        metrics: in it.
        seq: number of the message in its session, from 0 to 255; None: it has none.
    """
    made = message("Payload")(timestamp=milliseconds, metrics=metrics)
    if seq is not None:
        made.seq = seq
    return bytes(made.SerializeToString())


def number_metric(name: str, value: int) -> Any:
    """Returns a Sparkplug metric with an unsigned 64-bit integer."""
    return message("Metric")(name=name, datatype=DataType.UINT64, long_value=value)


def flag_metric(name: str, value: bool) -> Any:
    """Returns a Sparkplug metric with a boolean."""
    return message("Metric")(name=name, datatype=DataType.BOOLEAN, boolean_value=value)


def signal_metric(
    signal: Signal, alias: int, value: Value, milliseconds: int, *, is_birth: bool
) -> Any:
    """Returns the Sparkplug metric of one value of the cell state.

    Args:
        signal: what it is.
        alias: number by which later messages call it.
        value: with its quality.
        milliseconds: its time, since 1970.
        is_birth: whether it tells the name and the unit as well; later only the alias.
    """
    datatype, field, convert = TYPES[signal.kind]
    made = message("Metric")(alias=alias, timestamp=milliseconds, datatype=datatype)
    if is_birth:
        made.name = signal.name
    if value.value != value.value:
        made.is_null = True
    else:
        setattr(made, field, convert(value.value))
    _add_property(made, "Quality", DataType.INT32, int_value=value.quality)
    if is_birth and signal.unit != "1":
        _add_property(made, "engUnit", DataType.STRING, string_value=signal.unit)
    if is_birth:
        _add_property(made, "Documentation", DataType.STRING, string_value=signal.meaning)
    return made


def asks_for_birth(data: bytes, name: str) -> bool:
    """Returns whether a command sets the metric `name` to true; False if it cannot be decoded."""
    try:
        found = message("Payload").FromString(data)
    except Exception:  # of protobuf, which has had several names for it
        return False
    return any(metric.name == name and metric.boolean_value for metric in found.metrics)


def _add_property(metric: Any, key: str, datatype: DataType, **value: Any) -> None:
    metric.properties.keys.append(key)
    metric.properties.values.add(type=datatype, **value)
