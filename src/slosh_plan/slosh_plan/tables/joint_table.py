"""Joint motions as CSV: `t` [s], and one column for each joint [rad or m].

Columns `JOINT.velocity` and `JOINT.acceleration` hold the derivatives by time.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from slosh_base.files import new_text
from slosh_base.files.errors import SloshFileError
from slosh_motion.tables.columns import FOUND_OUT, TableOptions
from slosh_motion.tables.reading import TextTable, read_table
from slosh_plan.joints import Arm
from slosh_plan.planning.time_law import PlannedMotion
from slosh_plan.planning.waypoints import JointWaypoints
from slosh_plan.trajectory import Trajectory
from slosh_plan.tuning import TUNING

DERIVATIVES = (".velocity", ".acceleration")
"""Endings of the columns that hold a joint's derivatives."""
FASTEST = 30.0
"""A joint of no known limit is not faster [rad/s or m/s]."""


def read_joint_table(path: Path, arm: Arm, options: TableOptions = FOUND_OUT) -> JointWaypoints:
    """Reads a motion of a robot's joints from a CSV table.

    Args:
        path: a text file; one whose name ends in .gz is unpacked.
        arm: the robot.
        options: what the user says of it; is told of joints whose angle wraps at ±π.

    Raises:
        SloshFileError: no such table.
    """

    def used(table: TextTable) -> float:
        places = np.column_stack([table.column(name) for name in _joints(table)])
        if np.linalg.norm(np.ptp(places, axis=0)) <= TUNING.same:
            return np.inf  # what stands still says nothing about the unit
        steps = np.abs(np.diff(places, axis=0))
        times = np.diff(table.column("t"))[:, None]
        most = arm.limits(_joints(table))["velocity"]
        most = np.where(np.isfinite(most), most, FASTEST)
        return float((steps / most / np.where(times > 0.0, times, np.inf)).max(initial=0.0))

    table = read_table(path, _check_names, options, free=True, sampled=used, relative=True)
    joints = _joints(table)
    position = table.group(joints)
    assert position is not None  # the names were checked
    wrapped = arm.wrapping(joints, position)
    if wrapped:
        options.tell(
            f"{path}: {', '.join(wrapped)} jumps by about 2π between two rows: treated as a "
            "wrapped angle and unwrapped"
        )
    joined = arm.joined(joints, position)
    more = [table.group([joint + ending for joint in joints]) for ending in DERIVATIVES]
    return JointWaypoints(tuple(joints), table.column("t"), joined, *more)


def _joints(table: TextTable) -> list[str]:
    """Returns the names of a table's joints."""
    return [name for name in table.names if name != "t" and not name.endswith(DERIVATIVES)]


def read_joint_trajectory(path: Path, arm: Arm, options: TableOptions = FOUND_OUT) -> Trajectory:
    """Reads a joint motion from a table and returns the motion of the container.

    Raises:
        SloshFileError: no such table.
        SloshPlanError: no such motion.
    """
    given = read_joint_table(path, arm, options)
    known = np.array(arm.known(given.names))
    if known.any() and not known.all():
        others = ", ".join(np.array(given.names)[~known].tolist())
        options.tell(f"{path}: {others}: not in the robot's description, passed over")
    else:
        known[:] = True
    velocity, acceleration = (
        None if one is None else one[:, known] for one in (given.velocity, given.acceleration)
    )
    names = [name for name, has in zip(given.names, known, strict=True) if has]
    position = given.position[:, known]
    return arm.motion(given.t, names, position, velocity, acceleration, str(path))


def write_joint_table(path: Path, motion: PlannedMotion) -> None:
    """Writes a joint motion: t, positions, velocities and accelerations.

    Raises:
        OSError: the file cannot be written.
    """
    joints = motion.joints
    assert joints is not None
    names = joints.limits.names
    heading = ["t", *names, *(name + ending for ending in DERIVATIVES for name in names)]
    # 1 kHz: the time as it is meant, without the rounding of a sum.
    t = np.round(motion.t, 6)[:, None]
    rows = np.hstack([t, joints.position, joints.velocity, joints.acceleration])
    with new_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heading)
        writer.writerows(rows.tolist())


def _check_names(path: Path, names: list[str]) -> None:
    where = f"{path}: line 1"
    joints = [name for name in names if name != "t" and not name.endswith(DERIVATIVES)]
    if names.count("t") != 1 or not joints:
        raise SloshFileError(f"{where}: a motion of joints needs t and the joints' names")
    given = {ending: [name for name in names if name.endswith(ending)] for ending in DERIVATIVES}
    for ending, own in given.items():
        wanted = [joint + ending for joint in joints]
        for name in (*own, *(wanted if own else ())):
            if name not in own:
                raise SloshFileError(f"{where}: column {name!r} is missing")
            if name not in wanted:
                raise SloshFileError(f"{where}: column {name!r} belongs to no joint of the table")
    velocities, accelerations = given.values()
    if accelerations and not velocities:
        raise SloshFileError(f"{where}: accelerations of joints need their velocities, too")
