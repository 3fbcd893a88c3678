"""Path tables: waypoints as CSV, `t,x,y,z[,qx,qy,qz,qw]`."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slosh_files import new_text
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.checked import attitudes
from slosh_plan.planning.path import MOST_POINTS
from slosh_plan.planning.time_law import Motion

Array = NDArray[np.float64]

PLACES = ("t", "x", "y", "z")
ATTITUDE = ("qx", "qy", "qz", "qw")
ACCELERATION = ("ax", "ay", "az")
LONGEST_LINE = 10_000
"""Characters."""
TURNED = 1e-3
"""By which an attitude may differ from the first one [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Waypoints:
    """A path as it is given.

    Attributes:
        t: (N,) times, a proposal [s].
        position: (N, 3) of the container's origin in the world's axes [m].
        attitude: (4,) quaternion x, y, z, w, world ← container, kept all along; None: not given.
    """

    t: Array
    position: Array
    attitude: Array | None


def read_path_table(path: Path) -> Waypoints:
    """Reads a path table; columns of accelerations, as in a plan, are passed over.

    Raises:
        SloshPlanError: one line that names the file, the line and the column: no such columns, no
            number, times that do not increase, fewer than two rows or too many, an attitude that
            changes.
        OSError: the file cannot be read.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            lines = (_bounded(path, number, line) for number, line in enumerate(file, start=1))
            return _table(path, list(islice(csv.reader(lines), MOST_POINTS + 2)))
    except UnicodeDecodeError:
        raise SloshPlanError(f"{path}: is no text: a path is a CSV table") from None
    except csv.Error as error:
        raise SloshPlanError(f"{path}: is no CSV: {error}") from None


def write_plan_table(path: Path, motion: Motion, attitude: Array | None) -> None:
    """Writes a motion as t, x, y, z, the attitude where it is given or tilts, ax, ay, az.

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


def _bounded(path: Path, number: int, line: str) -> str:
    if len(line) > LONGEST_LINE:
        raise SloshPlanError(f"{path}: line {number}: is longer than {LONGEST_LINE} characters")
    return line


def _table(path: Path, rows: list[list[str]]) -> Waypoints:
    names = [name.strip() for name in rows[0]] if rows else []
    _check_names(path, names)
    if len(rows) - 1 > MOST_POINTS:
        raise SloshPlanError(f"{path}: holds more than {MOST_POINTS} rows; take fewer")
    if len(rows) < 3:
        raise SloshPlanError(f"{path}: holds {len(rows) - 1} rows: a path needs at least 2")
    data = np.array([_numbers(path, line, names, row) for line, row in enumerate(rows[1:], 2)])
    t = data[:, names.index("t")]
    late = np.flatnonzero(np.diff(t) <= 0.0)
    if len(late):
        row = int(late[0])
        how = "repeats" if t[row + 1] == t[row] else "comes before"
        raise SloshPlanError(
            f"{path}: line {row + 3}: t = {t[row + 1]:.9g} s {how} {t[row]:.9g} s; "
            "time must increase"
        )
    position = data[:, [names.index(name) for name in PLACES[1:]]]
    return Waypoints(t, position, _attitude(path, names, data))


def _check_names(path: Path, names: list[str]) -> None:
    for name in names:
        if name not in (*PLACES, *ATTITUDE, *ACCELERATION) or names.count(name) > 1:
            raise SloshPlanError(
                f"{path}: line 1: column {name!r:.40} is unknown or stands twice; "
                f"a path has {', '.join(PLACES)} and may have {', '.join(ATTITUDE)}"
            )
    wanted = ATTITUDE if any(name in names for name in ATTITUDE) else ()
    for name in (*PLACES, *wanted):
        if name not in names:
            raise SloshPlanError(
                f"{path}: line 1: column {name!r} is missing: a path has {', '.join(PLACES)} "
                f"and may have {', '.join(ATTITUDE)}"
            )


def _numbers(path: Path, line: int, names: list[str], row: list[str]) -> list[float]:
    if len(row) != len(names):
        raise SloshPlanError(f"{path}: line {line}: has {len(row)} of {len(names)} columns")
    values = []
    for name, cell in zip(names, row, strict=True):
        try:
            value = float(cell)
        except ValueError:
            raise SloshPlanError(
                f"{path}: line {line}: column {name!r}: {cell!r:.40} is no number"
            ) from None
        if not (math.isfinite(value) and abs(value) <= 1e9):
            raise SloshPlanError(
                f"{path}: line {line}: column {name!r}: {value:g} is no usable number"
            )
        values.append(value)
    return values


def _attitude(path: Path, names: list[str], data: Array) -> Array | None:
    if ATTITUDE[0] not in names:
        return None
    quaternions = data[:, [names.index(name) for name in ATTITUDE]]
    lengths = np.linalg.norm(quaternions, axis=1)
    bad = np.flatnonzero(np.abs(lengths - 1.0) > 0.01)
    if len(bad):
        raise SloshPlanError(
            f"{path}: line {bad[0] + 2}: the quaternion's length is {lengths[bad[0]]:.3g}, not 1"
        )
    quaternions = quaternions / lengths[:, None]
    cosines = np.clip(np.abs(quaternions @ quaternions[0]), 0.0, 1.0)
    changed = np.flatnonzero(2.0 * np.arccos(cosines) > TURNED)
    if len(changed):
        raise SloshPlanError(
            f"{path}: line {changed[0] + 2}: the attitude changes along the path: "
            "planned are paths of a container that keeps it"
        )
    first: Array = quaternions[0]
    return first
