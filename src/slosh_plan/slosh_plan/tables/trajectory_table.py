"""Planned motions as CSV: motion tables and pose tables.

Columns: `t` [s] with `ax,ay,az` [m/s²] or `x,y,z` [m] of the container's origin in the world's
axes, or both, which must agree; optional `qx,qy,qz,qw` (attitude, world ← container) and, with
accelerations, `wx,wy,wz` (container's frame, rad/s). Accelerations are taken where there are any.
"""

from __future__ import annotations

from pathlib import Path

from slosh_base.files.errors import SloshFileError
from slosh_motion.tables.columns import FOUND_OUT, TableOptions
from slosh_motion.tables.motion_table import (
    ANGULAR_VELOCITY,
    ATTITUDE,
    CHOOSE,
    ETA,
    MOTION,
    MSH,
    PROFILE,
)
from slosh_motion.tables.reading import read_table
from slosh_plan import Trajectory
from slosh_plan.consistency import check_consistent

ACCELERATION = MOTION[1:]
POSITION = ("x", "y", "z")
_GROUPS = (ACCELERATION, POSITION, ATTITUDE, ANGULAR_VELOCITY)
READ = frozenset({"t"}.union(*_GROUPS))


def read_trajectory(path: Path, options: TableOptions = FOUND_OUT) -> Trajectory:
    """Reads a planned motion from a table; ignores measured columns.

    Args:
        path: a text file; one whose name ends in .gz is unpacked.
        options: what the user says of it.

    Raises:
        SloshFileError: no such table.
        SloshPlanError: no such motion, or positions and accelerations that contradict each
            other; one line with the file, the row and what is wrong.
    """
    table = read_table(
        path, _check_columns, options, may_be_blank=lambda name: name not in READ, relative=True
    )
    t, acceleration, position = table.column("t"), table.group(ACCELERATION), table.group(POSITION)
    attitude = table.group(ATTITUDE)
    if acceleration is not None:
        rate = table.group(ANGULAR_VELOCITY)
        found = Trajectory(t, acceleration, attitude, rate, position, str(path))
        check_consistent(str(path), found.t, found.position, accelerations=found.acceleration)
        return found
    assert position is not None
    return Trajectory.from_poses(t, position, attitude, str(path))


def _check_columns(path: Path, names: list[str]) -> None:
    known = {"t", MSH}.union(*_GROUPS)
    for name in names:
        if names.count(name) > 1:
            raise SloshFileError(f"{path}: line 1: column {name!r} appears twice")
        if name not in known and not name.startswith((ETA, PROFILE)):
            raise SloshFileError(
                f"{path}: line 1: column {name!r} is unknown; known are t, "
                f"{', '.join(','.join(group) for group in _GROUPS)}; {CHOOSE}"
            )
    if "t" not in names or not {"ax", "x"} & set(names):
        raise SloshFileError(
            f"{path}: line 1: a planned motion needs t, and ax,ay,az or x,y,z; {CHOOSE}"
        )
    for group in _GROUPS:
        missing = [name for name in group if name not in names]
        if missing and len(missing) < len(group):
            raise SloshFileError(
                f"{path}: line 1: column {missing[0]!r} is missing; "
                f"{', '.join(group)} belong together"
            )
