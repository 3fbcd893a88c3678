"""Reads every input of a container's motion as one stream, checks it, and compares signals."""

from typing import TYPE_CHECKING

from slosh_base.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from slosh_motion.tables.motion_table import MotionTable, read_motion_table, write_motion_table

__all__ = ["MotionTable", "read_motion_table", "write_motion_table"]

__getattr__ = lazy_names(__name__, dict.fromkeys(__all__, "tables.motion_table"))
