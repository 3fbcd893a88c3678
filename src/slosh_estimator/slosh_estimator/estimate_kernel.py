"""Compiled code that processes one input sample: linear and nonlinear model, limits.

One sample of a running cell and a million of a recording go through the same compiled function, so
that a replay gives the bits that the live node gave.
"""

from __future__ import annotations

import math

import numpy as np
from numba.types import boolean, float64, int64, void
from numpy.typing import NDArray

from slosh_base.compiled.compilation import (
    CHANGED_1,
    CHANGED_2,
    GIVEN_1,
    GIVEN_2,
    compiled,
    entry_point,
)
from slosh_estimator.tuning import TUNING
from slosh_estimator.validity import EstimateFlag
from slosh_model import kernel
from slosh_model.chains import all_readings
from slosh_model.effects.registry import READING_MEMORY_COUNT
from slosh_model.indices import STATE_COUNT, VX, VY, X, Y
from slosh_model.layout import records

MAX_STEP = 0.002
JERK_FILTER = TUNING.jerk_filter
"""The jerk is that of the low-passed acceleration, (a - ā)/τ. White noise of 0.05 m/s² reads as
about 2.5 m/s³, against limits of 60 and more; a motion law's jerk comes 20 ms late."""
MSH, AZIMUTH, SH_X, SH_Y = range(4)
ANSWERS = 4
"""How a row of answers begins: these of L, then these of NL [m, rad]."""
JERK, FLAGS, READINGS, ROW = 8, 9, 10, 12
"""What follows in it: jerk [m/s³], flags, what a sensor reads of the MSH of L and of NL [m], and
the modal states."""
MODAL = STATE_COUNT
"""Numbers per mode: x, y, vx, vy; first all modes of L, then of NL."""
LEFT_RANGE = -1.0
"""In place of the flags: a model has left the physical range."""
# Compiled code takes plain numbers.
_PLANARITY_LOST = int(EstimateFlag.PLANARITY_LOST)
_ACCELERATION_LIMIT = int(EstimateFlag.ACCELERATION_LIMIT)
_JERK_LIMIT = int(EstimateFlag.JERK_LIMIT)
_LINEAR_ONLY = int(EstimateFlag.LINEAR_ONLY)
_BEYOND_LINEAR = int(EstimateFlag.BEYOND_LINEAR)
_ABOVE_RIM = int(EstimateFlag.ABOVE_RIM)

CHECKS = np.dtype(
    [
        # Beyond these the surface is no plane, and the models are not validated [m/s², m/s³].
        ("planar_acceleration", np.float64),
        ("planar_jerk", np.float64),
        ("acceleration", np.float64),
        ("jerk", np.float64),
        ("rim", np.float64),  # height at the wall at which the highest place is at the rim [m]
        # Where the linear model is the only one: height beyond which it fails [m]; else infinite.
        ("linear_height", np.float64),
        ("runaway", np.float64),  # a mass farther out is no liquid any more [m]
        ("reads", np.float64),  # not 0 where the models have effects on the measurement
        # From sample to sample: the low-passed acceleration [m/s²], and what the effects on the
        # measurement remember, of L and of NL.
        ("slow", np.float64, (3,)),
        ("reading_memory", np.float64, (2, max(READING_MEMORY_COUNT, 1))),
    ],
    align=True,
)
"""What an estimate is judged and read by; lies in a flat array of floats."""


MOVING_CHECKS = CHECKS.fields["slow"][1] // np.dtype(np.float64).itemsize  # type: ignore[index]
"""From this place of the flat array on it changes from sample to sample."""


def new_checks() -> NDArray[np.float64]:
    """Returns a zeroed array for a model's validity limits and last values, as in CHECKS."""
    return np.zeros(1, dtype=CHECKS).view(np.float64)


@compiled
def _heights(store, dt, acceleration, yaw, pose, checks, row, which):  # type: ignore[no-untyped-def]
    """Advances one model by an input and stores its heights; returns whether they are physical."""
    column = ANSWERS * which
    runs, modes = records(store)
    run = runs[0]
    ax, ay, az = acceleration
    hx, hy, turn = kernel.advance(run, modes, ax, ay, az, yaw, pose, dt)
    hx, hy = kernel.turned(hx, hy, turn)
    row[column + MSH], row[column + AZIMUTH] = kernel.highest_and_azimuth(run, modes[0], hx, hy)
    row[column + SH_X], row[column + SH_Y] = hx, hy
    row[READINGS + which] = row[column + MSH]
    if checks["reads"] != 0.0:
        first = modes[0]
        wall = (
            hx, hy, math.nan, first["radius"], run["elapsed"], first["fill_height"],
            first["radius_y"], run["cornered"],
        )  # fmt: skip
        memory = checks["reading_memory"][which]
        row[READINGS + which] = all_readings(
            dt, row[column + MSH], wall, memory, run["parameters"]
        )
    bound = checks["runaway"]
    inside = True
    for n in range(modes.shape[0]):
        mode, at = modes[n], ROW + MODAL * (which * modes.shape[0] + n)
        x, y = mode["x"], mode["y"]
        row[at + X], row[at + Y] = x, y
        row[at + VX], row[at + VY] = mode["vx"], mode["vy"]
        # Written so that NaN fails too.
        inside &= -bound < x < bound and -bound < y < bound
    return inside


@compiled
def _validity(checks, dt, acceleration, height, first):  # type: ignore[no-untyped-def]
    """Returns the motion's jerk [m/s³] and the model's validity flags for it (DL22, §4.2)."""
    ax, ay, az = acceleration
    slow = checks["slow"]
    if first:
        slow[0], slow[1], slow[2] = ax, ay, az
    dx, dy, dz = ax - slow[0], ay - slow[1], az - slow[2]
    inverse = 1.0 / (JERK_FILTER + dt)
    blend = dt * inverse
    slow[0] += blend * dx
    slow[1] += blend * dy
    slow[2] += blend * dz
    jerk = math.sqrt(dx * dx + dy * dy + dz * dz) * inverse
    size = math.sqrt(ax * ax + ay * ay + az * az)
    flags = 0
    if size > checks["planar_acceleration"] or jerk > checks["planar_jerk"]:
        flags |= _PLANARITY_LOST
    if size > checks["acceleration"]:
        flags |= _ACCELERATION_LIMIT
    if jerk > checks["jerk"]:
        flags |= _JERK_LIMIT
    if height > checks["rim"]:
        flags |= _ABOVE_RIM
    if checks["linear_height"] < math.inf:
        flags |= _LINEAR_ONLY
        if height > checks["linear_height"]:
            flags |= _BEYOND_LINEAR
    return jerk, flags


@compiled
def _take(linear, nonlinear, store, dt, acceleration, yaw, pose, first, row):  # type: ignore[no-untyped-def]
    checks = store.view(CHECKS)[0]
    if first:
        checks["reading_memory"][:] = 0.0
    inside = _heights(linear, dt, acceleration, yaw, pose, checks, row, 0)
    inside &= _heights(nonlinear, dt, acceleration, yaw, pose, checks, row, 1)
    if not inside:
        row[FLAGS] = LEFT_RANGE
        return
    height = max(row[MSH], row[ANSWERS + MSH])
    row[JERK], row[FLAGS] = _validity(checks, dt, acceleration, height, first)


@entry_point(
    void(
        CHANGED_1, CHANGED_1, CHANGED_1, CHANGED_1, GIVEN_2,
        float64, float64, float64, float64, float64, boolean,
    )
)  # fmt: skip
def step(  # type: ignore[no-untyped-def]
    linear, nonlinear, checks, row, poses, dt, ax, ay, az, yaw, first
):
    """Advances linear and nonlinear model by one input sample; stores heights and flags.

    Args:
        linear, nonlinear: each model's store, as `slosh_model.layout` has it; changed.
        checks: a flat array of CHECKS; changed.
        row: (ROW + 2 modes MODAL,) receives the answers; see ROW.
        poses: (1, POSE_COUNT), or (0, POSE_COUNT) for an upright container; see
            slosh_model.indices.
        dt: time since the sample before [s]; 0 for the first.
        ax, ay, az: acceleration [m/s²].
        yaw: [rad].
        first: whether nothing links the sample to those before.
    """
    pose = kernel.pose_at(poses, 0)
    _take(linear, nonlinear, checks, dt, (ax, ay, az), yaw, pose, first, row)


@entry_point(
    int64(
        CHANGED_1, CHANGED_1, CHANGED_1, CHANGED_2, GIVEN_2, GIVEN_1, GIVEN_2, GIVEN_1
    )
)  # fmt: skip
def steps(  # type: ignore[no-untyped-def]
    linear, nonlinear, checks, rows, poses, intervals, accelerations, yaws
):
    """Advances linear and nonlinear model by consecutive input samples without gaps.

    Args:
        linear, nonlinear, checks: as in `step`.
        rows: (N, ROW + 2 modes MODAL) receives the answers.
        poses: (N, POSE_COUNT), or (0, POSE_COUNT) for an upright container.
        intervals: (N,) time since the sample before each [s].
        accelerations: (N, 3) [m/s²].
        yaws: (N,) [rad].

    Returns:
        how many samples were taken: fewer than N where a model left the physical range with the
        next one, which then was taken too.
    """
    for i in range(intervals.shape[0]):
        acceleration = (accelerations[i, 0], accelerations[i, 1], accelerations[i, 2])
        pose = kernel.pose_at(poses, i)
        _take(linear, nonlinear, checks, intervals[i], acceleration, yaws[i], pose, False, rows[i])
        if rows[i, FLAGS] == LEFT_RANGE:
            return i
    return intervals.shape[0]
