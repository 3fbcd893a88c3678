"""Converts the points of trajectory messages directly to arrays.

rclpy makes ten objects of each point: of 200,000 points in 10 s, with 500 MB. A message type with
point arrays leaves them out of that conversion; they are read from the structures of rosidl's C
interface, into which the middleware has unpacked the message.
"""

from __future__ import annotations

import ctypes
import importlib
from collections.abc import Sequence
from functools import cache, reduce
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.type_support import check_for_type_support
from rosidl_parser import definition

from slosh_base.types import Array

_BASIC = {
    "boolean": ctypes.c_bool, "octet": ctypes.c_uint8, "float": ctypes.c_float,
    "double": ctypes.c_double,
    **{f"{u}int{n}": getattr(ctypes, f"c_{u}int{n}") for u in ("", "u") for n in (8, 16, 32, 64)},
}  # fmt: skip
_Convert = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
_capsule = ctypes.pythonapi.PyCapsule_New
_capsule.restype, _capsule.argtypes = (
    ctypes.py_object,
    [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p],
)
_pointer = ctypes.pythonapi.PyCapsule_GetPointer
_pointer.restype, _pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]


class _Sequence(ctypes.Structure):
    """A sequence or a string in rosidl's C interface."""

    _fields_ = (("data", ctypes.c_void_p), ("size", ctypes.c_size_t), ("room", ctypes.c_size_t))


class PointArrays:
    """The points of a JointTrajectory or MultiDOFJointTrajectory as arrays.

    Args:
        points: where they lie.
        point_type: their message type.
        most: more points than that are not read, only counted.

    Attributes:
        t: (N,) times from the trajectory's start [s].
        sizes: by field, (N,) how many values or bodies each point has.
        values: by field, (N, W) of numbers the whole, of bodies the first one's; None where not
            all points have as many numbers, or not all have a body.
    """

    def __init__(self, points: _Sequence, point_type: Any, most: int) -> None:
        self._count = int(points.size)
        record = np.dtype(_structure(point_type))
        count = self._count if self._count <= most else 0
        raw = ctypes.string_at(points.data, count * record.itemsize) if count else b""
        rows = np.frombuffer(raw, record)
        since = rows["time_from_start"]
        self.t: Array = since["sec"] + 1e-9 * since["nanosec"]
        self.sizes: dict[str, NDArray[np.uint64]] = {}
        self.values: dict[str, Array | None] = {}
        names = point_type.get_fields_and_field_types()
        for name, slot in zip(names, point_type.SLOT_TYPES, strict=True):
            if isinstance(slot, definition.UnboundedSequence):
                self.sizes[name] = rows[name]["size"]
                self.values[name] = _first_values(rows[name], slot.value_type)

    def __len__(self) -> int:
        return self._count


def _first_values(sequences: NDArray[Any], kind: Any) -> Array | None:
    """Returns an array (N, W) with the numbers of each sequence, or None if sizes differ."""
    sizes = sequences["size"]
    if not len(sizes) or not sizes.all():
        return None
    basic = isinstance(kind, definition.BasicType)
    if basic and (sizes != sizes[0]).any():
        return None
    length = int(sizes[0]) * 8 if basic else ctypes.sizeof(_structure(_class_of(kind)))
    data = b"".join(map(ctypes.string_at, sequences["data"].tolist(), repeat(length)))
    return np.frombuffer(data, np.float64).reshape(len(sizes), -1)


def arrays_of(points: PointArrays | Sequence[Any], most: int) -> PointArrays:
    """Returns the points of a trajectory as PointArrays."""
    if isinstance(points, PointArrays):
        return points
    # A MultiDOF point, where there is one, tells the type; otherwise both are empty.
    module = importlib.import_module("trajectory_msgs.msg")
    joints = bool(points) and isinstance(points[0], module.JointTrajectoryPoint)
    kind = module.JointTrajectory if joints else module.MultiDOFJointTrajectory
    whole = kind(points=list(points))
    found: PointArrays = unpacked(serialize_message(whole), kind, most).points
    return found


def unpacked(data: bytes, message_type: Any, most: int) -> Any:
    """Deserialises a trajectory message with its points as PointArrays."""
    return deserialize_message(data, with_point_arrays(message_type, ((),), most))


def service_with_point_arrays(
    service_type: Any, paths: tuple[tuple[str, ...], ...], most: int
) -> Any:
    """Creates a service type whose requests contain trajectory points as PointArrays.

    Args:
        service_type: the service.
        paths: to the trajectories, as fields of the request.
        most: see `PointArrays`.
    """
    check_for_type_support(service_type)
    request = with_point_arrays(service_type.Request, paths, most)
    return _variant(service_type, Request=request)


def action_with_point_arrays(
    action_type: Any, paths: tuple[tuple[str, ...], ...], most: int
) -> Any:
    """Creates an action type whose goals contain trajectory points as PointArrays.

    Args:
        action_type: the action.
        paths: to the trajectories, as fields of the goal.
        most: see `PointArrays`.
    """
    check_for_type_support(action_type)
    paths = tuple(("goal", *path) for path in paths)
    send = service_with_point_arrays(action_type.Impl.SendGoalService, paths, most)
    return _variant(action_type, Impl=_variant(action_type.Impl, SendGoalService=send))


def _variant(given: Any, **changed: Any) -> Any:
    """Creates a subclass with changed class attributes."""
    return type(given)(given.__name__, (given,), changed)


@cache
def with_point_arrays(message_type: Any, paths: tuple[tuple[str, ...], ...], most: int) -> Any:
    """Creates a message type that rclpy fills with PointArrays for trajectory points.

    Args:
        message_type: the type.
        paths: to the trajectories, as fields of the message; (): the message itself.
        most: see `PointArrays`.
    """
    check_for_type_support(message_type)
    meta = type(message_type)
    original = _Convert(_pointer(meta._CONVERT_TO_PY, None))
    places = [_place_of(message_type, path) for path in paths]

    def convert(address: int) -> Any:
        left_out = []
        for offset, _ in places:
            points = _Sequence.from_address(address + offset)
            left_out.append((points, int(points.size)))
        try:
            read = [
                PointArrays(points, kind, most)
                for (points, _), (_, kind) in zip(left_out, places, strict=True)
            ]
            for points, _ in left_out:
                points.size = 0
            message = original(address)
        finally:
            # The middleware frees all of them.
            for points, size in left_out:
                points.size = size
        for path, arrays in zip(paths, read, strict=True):
            trajectory = message
            for name in path:
                trajectory = getattr(trajectory, name)
            # Past the setter, which asks for a list of messages.
            trajectory._points = arrays
        return message

    hook = _Convert(convert)
    address = ctypes.cast(hook, ctypes.c_void_p).value
    other = type(
        meta.__name__, (meta,), {"_CONVERT_TO_PY": _capsule(address, None, None), "hook": hook}
    )
    return other(message_type.__name__, (message_type,), {"__slots__": ()})


def _place_of(message_type: Any, path: tuple[str, ...]) -> tuple[int, Any]:
    """Returns offset [bytes] and type of a trajectory's points within a message."""
    offset = 0
    for name in (*path, "points"):
        offset += getattr(_structure(message_type), name).offset
        names = list(message_type.get_fields_and_field_types())
        slot = message_type.SLOT_TYPES[names.index(name)]
        message_type = _class_of(getattr(slot, "value_type", slot))
    return offset, message_type


def _class_of(kind: Any) -> Any:
    """Returns the message class for a rosidl type; `Plan_Goal` means `Plan.Goal`."""
    module = importlib.import_module(".".join(kind.namespaces))
    return reduce(getattr, kind.name.split("_"), module)


@cache
def _structure(message_type: Any) -> type[ctypes.Structure]:
    """Creates the ctypes structure of a message in rosidl's C interface."""
    names = message_type.get_fields_and_field_types()
    fields = [
        (name, _kind(slot)) for name, slot in zip(names, message_type.SLOT_TYPES, strict=True)
    ]
    return type(message_type.__name__, (ctypes.Structure,), {"_fields_": fields})


def _kind(slot: Any) -> Any:
    if isinstance(slot, definition.BasicType):
        return _BASIC[slot.typename]
    if isinstance(slot, definition.NamespacedType):
        return _structure(_class_of(slot))
    if isinstance(slot, definition.Array):
        return _kind(slot.value_type) * slot.size
    return _Sequence
