"""Tests of raw messages that are read as a header and numbers."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from geometry_msgs.msg import AccelStamped, PoseStamped, TwistStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu

from slosh_base.files.nanoseconds import SECOND
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.stamped_numbers import StampedReader

PARTS = {
    AccelStamped: ("accel.linear", "accel.angular"),
    TwistStamped: ("twist.linear", "twist.angular"),
    PoseStamped: ("pose.position", "pose.orientation"),
    Imu: (
        "orientation", "orientation_covariance", "angular_velocity",
        "angular_velocity_covariance", "linear_acceleration", "linear_acceleration_covariance",
    ),
}  # fmt: skip


def numbers_of(message: Any) -> list[float]:
    """Returns the numbers behind a message's header, field by field."""
    found: list[float] = []
    for path in PARTS[type(message)]:
        part = message
        for name in path.split("."):
            part = getattr(part, name)
        axes = [axis for axis in "xyzw" if hasattr(part, axis)]
        found += [getattr(part, axis) for axis in axes] if axes else list(part)
    return found


def filled(kind: type, frame: str, sec: int, nanosec: int) -> Any:
    """Returns a message of a type whose numbers all differ."""
    message = kind()
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    at = 1.0
    for path in PARTS[kind]:
        part = message
        for name in path.split("."):
            part = getattr(part, name)
        for axis in [axis for axis in "xyzw" if hasattr(part, axis)] or range(9):
            if isinstance(axis, str):
                setattr(part, axis, at)
            else:
                part[axis] = at
            at += 1.0
    return message


@given(
    st.sampled_from(sorted(PARTS, key=str)), st.text(max_size=20).filter(lambda t: "\0" not in t),
    st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_messages_are_read_as_the_middleware_wrote_them(
    kind: type, frame: str, sec: int, nanosec: int
) -> None:
    message = filled(kind, frame, sec, nanosec)
    numbers = numbers_of(message)
    reader = StampedReader(len(numbers))
    for _ in range(2):
        found = reader.read(serialize_message(message))
        assert found == (sec * SECOND + nanosec, frame, tuple(numbers))


def test_frames_of_other_lengths_are_told_apart() -> None:
    reader = StampedReader(6)
    for frame in ("world", "", "container_of_the_arm", "world"):
        message = filled(AccelStamped, frame, 1, 2)
        found = reader.read(serialize_message(message))
        assert (found.frame, found.values[0]) == (frame, 1.0)


def test_big_endian_messages_are_read_too() -> None:
    # The numbers begin at a multiple of 8 behind the four bytes of the encoding.
    data = struct.pack(">HHiII12s6d", 0, 0, 3, 4, 5, b"cup1", *range(6))
    found = StampedReader(6).read(data)
    assert found == (3 * SECOND + 4, "cup1", (0.0, 1.0, 2.0, 3.0, 4.0, 5.0))


@pytest.mark.parametrize("size", [0, 2, 10, 30, 75])
def test_a_short_message_is_refused_in_one_line(size: int) -> None:
    data = serialize_message(filled(AccelStamped, "world", 1, 2))[:size]
    with pytest.raises(SloshMessageError, match=r"damaged|encoding"):
        StampedReader(6).read(data)


def test_an_unknown_encoding_is_named() -> None:
    data = b"\x00\x07" + serialize_message(filled(AccelStamped, "world", 1, 2))[2:]
    with pytest.raises(SloshMessageError, match="encoding 0007"):
        StampedReader(6).read(data)
