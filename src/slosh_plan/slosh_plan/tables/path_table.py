"""Path tables as CSV (`t,x,y,z[,qx,qy,qz,qw]`), and tables of planned motions."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from slosh_base.files import new_text
from slosh_base.files.errors import SloshFileError
from slosh_base.types import Array
from slosh_motion.tables.columns import FOUND_OUT, TableOptions
from slosh_motion.tables.motion_table import ATTITUDE, CHOOSE, MOTION, POSITION
from slosh_motion.tables.reading import TextTable, read_table
from slosh_plan.planning.checked import attitudes
from slosh_plan.planning.path import MOST_POINTS
from slosh_plan.planning.time_law import PlannedMotion
from slosh_plan.planning.waypoints import TURNED, Waypoints

PLACES = ("t", *POSITION)
ACCELERATION = MOTION[1:]


def read_path_table(path: Path, options: TableOptions = FOUND_OUT) -> Waypoints:
    """Reads waypoints from a path table; ignores columns of accelerations.

    Args:
        path: a text file; one whose name ends in .gz is unpacked.
        options: what the user says of it.

    Raises:
        SloshFileError: one line that names the file, the line and the column: no such columns, no
            number, times that do not increase, fewer than two rows or too many, an
            attitude that changes.
    """
    table = read_table(path, _check_names, options, sampled=False, relative=True)
    if len(table.data) < 2:
        raise SloshFileError(f"{path}: holds {len(table.data)} rows: a path needs at least 2")
    if len(table.data) > MOST_POINTS:
        raise SloshFileError(f"{path}: holds more than {MOST_POINTS} rows; take fewer")
    table.check_finite()
    table.check_time()
    position = table.group(POSITION)
    assert position is not None  # the names were checked
    return Waypoints(table.column("t"), position, _attitude(table))


def write_plan_table(path: Path, motion: PlannedMotion, attitude: Array | None) -> None:
    """Writes a motion to a table: t, position, attitude if any, and acceleration.

    Raises:
        OSError: the file cannot be written.
    """
    columns = [motion.t[:, None], motion.position]
    names = [*PLACES]
    turned = attitudes(motion, attitude, len(motion.t))
    if turned is not None:
        names += ATTITUDE
        columns.append(turned)
    data = np.column_stack([*columns, motion.acceleration])
    # 1 kHz: the time as it is meant, without the rounding of a sum.
    data[:, 0] = np.round(data[:, 0], 6)
    with new_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*names, *ACCELERATION])
        writer.writerows(data.tolist())


def _check_names(path: Path, names: list[str]) -> None:
    may_have = f"a path has {', '.join(PLACES)} and may have {', '.join(ATTITUDE)}; {CHOOSE}"
    for name in names:
        if name not in (*PLACES, *ATTITUDE, *ACCELERATION) or names.count(name) > 1:
            raise SloshFileError(
                f"{path}: line 1: column {name!r:.40} is unknown or appears twice; {may_have}"
            )
    wanted = ATTITUDE if any(name in names for name in ATTITUDE) else ()
    for name in (*PLACES, *wanted):
        if name not in names:
            raise SloshFileError(f"{path}: line 1: column {name!r} is missing: {may_have}")


def _attitude(table: TextTable) -> Array | None:
    quaternions = table.group(ATTITUDE)
    if quaternions is None:
        return None
    lengths = np.linalg.norm(quaternions, axis=1)
    bad = np.flatnonzero(np.abs(lengths - 1.0) > 0.01)
    if len(bad):
        raise SloshFileError(
            f"{table.path}: line {table.lines[bad[0]]}: the quaternion's length is "
            f"{lengths[bad[0]]:.3g}, not 1"
        )
    quaternions = quaternions / lengths[:, None]
    cosines = np.clip(np.abs(quaternions @ quaternions[0]), 0.0, 1.0)
    changed = np.flatnonzero(2.0 * np.arccos(cosines) > TURNED)
    if len(changed):
        raise SloshFileError(
            f"{table.path}: line {table.lines[changed[0]]}: the attitude changes along the "
            "path: only paths with a constant attitude can be planned"
        )
    first: Array = quaternions[0]
    return first
