"""Converts message times to whole nanoseconds and back."""

from __future__ import annotations

from builtin_interfaces.msg import Duration, Time

from slosh_base.files.nanoseconds import SECOND
from slosh_msgs_py.errors import SloshMessageError

MAXIMUM = (2**31 - 1) * SECOND


def to_nanoseconds(stamp: Time | Duration) -> int:
    """Converts a Time or Duration message to whole nanoseconds."""
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def to_time(nanoseconds: int) -> Time:
    """Converts nanoseconds to a Time message.

    Raises:
        SloshMessageError: the value does not fit: negative, or after the year 2038.
    """
    if not 0 <= nanoseconds <= MAXIMUM:
        raise SloshMessageError(f"stamp = {nanoseconds} ns must lie in [0, {MAXIMUM}] ns")
    sec, nanosec = divmod(int(nanoseconds), SECOND)
    return Time(sec=sec, nanosec=nanosec)


def to_duration(nanoseconds: int) -> Duration:
    """Converts nanoseconds to a Duration message.

    Raises:
        SloshMessageError: the value does not fit.
    """
    if abs(nanoseconds) > MAXIMUM:
        raise SloshMessageError(f"duration = {nanoseconds} ns exceeds {MAXIMUM} ns")
    sec, nanosec = divmod(int(nanoseconds), SECOND)
    return Duration(sec=sec, nanosec=nanosec)
