"""Loads a named motion or a motion table and samples it at the simulated cell's rate."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import scipy

from slosh_base.types import Array
from slosh_bringup.cell.motions import CellMotion, make_motion
from slosh_bringup.errors import SloshBringupError
from slosh_model.interpolation import columns_at
from slosh_motion.tables.columns import TableOptions, Tell, check_span, warn
from slosh_motion.tables.motion_table import MotionTable, read_motion_table

TABLE_ENDINGS = (".csv", ".csv.gz")
REPEATS = (1, 10_000)
"""How often a motion may be played in succession."""


def load_motion(name: str, rate: float = 1000.0, tell: Tell = warn) -> CellMotion:
    """Reads a motion table, or makes a named motion of the simulated cell.

    Args:
        name: one of `motions.MOTIONS`, or the path of a motion table.
        rate: samples per second.
        tell: is told what was assumed of a table.

    Raises:
        SloshBringupError: unknown name, wrong rate, or a table that is no motion.
        SloshBagError: a table that cannot be read.
    """
    if name.endswith(TABLE_ENDINGS):
        table = read_motion_table(Path(name), TableOptions(tell=tell))
        check_span(Path(name), table.t)
        return motion_from_table(Path(name).name, table, rate)
    return make_motion(name, rate)


def motion_from_table(name: str, table: MotionTable, rate: float) -> CellMotion:
    """Resamples a table's motion on a uniform time grid that starts at 0 s.

    Accelerations are interpolated linearly, attitudes along the shortest turn. The position is the
    acceleration's integral from rest; an angular velocity that is not given is the attitude's.

    Args:
        name: the motion's name.
        table: the table.
        rate: samples per second.

    Raises:
        SloshBringupError: shorter than two samples, a quaternion that is zero, or a rate that is
            not positive.
    """
    if not (math.isfinite(rate) and rate > 0.0):
        raise SloshBringupError(f"rate = {rate!r} Hz must be positive")
    if (table.t[-1] - table.t[0]) * rate < 1.0:
        raise SloshBringupError(f"{name}: lasts less than two samples at {rate:g} Hz")
    # A hair of tolerance: (0.3 - 0.1) * 10 must count as two whole steps.
    t = np.arange(math.floor((table.t[-1] - table.t[0]) * rate + 1e-6) + 1) / rate
    moments = np.minimum(table.t[0] + t, table.t[-1])
    acceleration = columns_at(moments, table.t, table.acceleration)
    velocity = scipy.integrate.cumulative_trapezoid(acceleration, t, axis=0, initial=0)
    position = scipy.integrate.cumulative_trapezoid(velocity, t, axis=0, initial=0)
    attitude = table.attitude
    turn = None if attitude is None else _attitude(name, table.t, attitude, moments)
    rate_of_turn = None if turn is None else _angular_velocity(turn, rate)
    if table.angular_velocity is not None:
        rate_of_turn = columns_at(moments, table.t, table.angular_velocity)
    quaternion = None if turn is None else turn.as_quat()
    return CellMotion(name, t, position, acceleration, quaternion, rate_of_turn)


def _attitude(
    name: str, t: Array, attitude: Array, moments: Array
) -> scipy.spatial.transform.Rotation:
    zero = np.flatnonzero(~np.any(attitude, axis=1))
    if len(zero):
        raise SloshBringupError(
            f"{name}: qx, qy, qz, qw: all zero at t = {t[zero[0]]:g} s, no rotation"
        )
    turns = scipy.spatial.transform.Rotation.from_quat(attitude)
    return scipy.spatial.transform.Slerp(t, turns)(moments)


def _angular_velocity(turn: scipy.spatial.transform.Rotation, rate: float) -> Array:
    """Computes the angular velocity [rad/s] in container axes from successive attitudes."""
    steps = (turn[:-1].inv() * turn[1:]).as_rotvec() * rate
    velocity: Array = np.vstack((steps, steps[-1:]))
    return velocity
