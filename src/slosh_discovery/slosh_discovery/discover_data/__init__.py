"""Measured motions from files: what a discovery works on.

Motion tables, bags and folders of tables in; `MeasuredMotion` out. Pure: no ROS, no clock.
"""

from __future__ import annotations

from slosh_discovery.discover_data.reading import (
    ShiftMotion,
    motions_of_shift,
    read_motions,
    shift_motions,
)

__all__ = ["ShiftMotion", "motions_of_shift", "read_motions", "shift_motions"]
