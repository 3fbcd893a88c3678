"""Reads measured motions for a discovery from files.

Motion tables, bags and folders of tables in; `MeasuredMotion` out. Pure: no ROS, no clock.
"""

from __future__ import annotations

from slosh_discovery.discover_data.reading import (
    DayMotion,
    day_motions,
    motions_of_day,
    read_motions,
)

__all__ = ["DayMotion", "day_motions", "motions_of_day", "read_motions"]
