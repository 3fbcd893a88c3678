"""The compiled work on one input sample: both models, their heights, the validity of the motion.

One sample of a running cell and a million of a recording go through the same compiled function, so
that a replay gives the bits that the live node gave.
"""

from __future__ import annotations

import math

from numba import njit

from slosh_model import kernel
from slosh_model.chains import all_readings
from slosh_model.compile_cache import use_compile_cache
from slosh_model.effects.registry import READING_MEMORY_COUNT

use_compile_cache()

MAX_STEP = 0.002
JERK_FILTER = 0.02
"""Time constant of the low-pass behind the jerk [s].

The jerk is that of the low-passed acceleration, (a - ā)/τ. White noise of 0.05 m/s² then reads as
about 2.5 m/s³, against limits of 60 and more; a motion law's jerk comes 20 ms late.
"""
ROW = 12
"""Length of a row of answers: MSH, azimuth, SH at +x, at +y of L, the same of NL, jerk, flags,
what a sensor reads of the MSH of L and of NL."""
JERK, FLAGS, READINGS = 8, 9, 10
SLOW = 3
"""Of the memory from sample to sample: the low-passed acceleration comes first, then what the
effects on the measurement remember, of L and of NL."""
MEMORY = SLOW + 2 * READING_MEMORY_COUNT
LEFT_RANGE = -1.0
"""In place of the flags: a model has left the physical range."""


@njit(cache=True, error_model="numpy", inline="always")
def _heights(model, dt, acceleration, yaw, pose, limits, memory, row, which):  # type: ignore[no-untyped-def]
    """Advances one model and writes its heights; False where it has left the physical range."""
    column = 4 * which
    modal, modes, parameters, held = model
    ax, ay, az = acceleration
    hx, hy, turn = kernel.advance(
        modal, modes, parameters, held, ax, ay, az, yaw, pose, dt, MAX_STEP
    )
    hx, hy = kernel.turned(hx, hy, turn)
    row[column] = math.sqrt(hx * hx + hy * hy)
    row[column + 1] = math.atan2(hy, hx)
    row[column + 2], row[column + 3] = hx, hy
    row[READINGS + which] = row[column]
    if limits[6] != 0.0:
        first = SLOW + which * READING_MEMORY_COUNT
        wall = (hx, hy, math.nan, modes[0, 3], held[kernel.ELAPSED])
        row[READINGS + which] = all_readings(
            dt, row[column], wall, memory[first : first + READING_MEMORY_COUNT], parameters
        )
    bound = limits[5]
    for n in range(modal.shape[0]):
        # Written so that NaN fails too.
        if not (-bound < modal[n, 0] < bound and -bound < modal[n, 1] < bound):
            return False
    return True


@njit(cache=True, error_model="numpy", inline="always")
def _validity(slow, limits, dt, acceleration, height, first):  # type: ignore[no-untyped-def]
    """Jerk [m/s³] and flags of the motion (DL22, §4.2)."""
    ax, ay, az = acceleration
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
    if size > limits[0] or jerk > limits[1]:
        flags |= 1
    if size > limits[2]:
        flags |= 2
    if jerk > limits[3]:
        flags |= 4
    if height > limits[4]:
        flags |= 8
    return jerk, flags


@njit(cache=True, error_model="numpy")
def step(  # type: ignore[no-untyped-def]
    linear, nonlinear, memory, limits, dt, ax, ay, az, yaw, poses, index, first, row
):
    """Takes one sample.

    Args:
        linear, nonlinear: each model's modal state, modes, parameters and held input, as
            `slosh_model.kernel.advance` has them; the states are changed.
        memory: (MEMORY,) see there; changed.
        limits: (7,) planar acceleration and jerk, acceleration and jerk [m/s², m/s³], freeboard,
            bound of the modal coordinates [m], 0 where the models have no effect on the readings.
        dt: time since the sample before [s]; 0 for the first.
        ax, ay, az: acceleration [m/s²].
        yaw: [rad].
        poses: (N, POSE_COUNT), of which the one at `index` is taken, or (0, POSE_COUNT) for an
            upright container; see slosh_model.effects.base.
        first: whether nothing links the sample to those before.
        row: (ROW,) receives the answers; see ROW.
    """
    acceleration, pose = (ax, ay, az), kernel.pose_at(poses, index)
    if first:
        memory[SLOW:] = 0.0
    inside = _heights(linear, dt, acceleration, yaw, pose, limits, memory, row, 0)
    inside &= _heights(nonlinear, dt, acceleration, yaw, pose, limits, memory, row, 1)
    if not inside:
        row[FLAGS] = LEFT_RANGE
        return
    height = max(row[0], row[4])
    row[JERK], row[FLAGS] = _validity(memory, limits, dt, acceleration, height, first)


@njit(cache=True, error_model="numpy")
def steps(  # type: ignore[no-untyped-def]
    linear, nonlinear, memory, limits, intervals, accelerations, yaws, poses, rows, modal
):
    """`step` over samples that follow each other without a break.

    Args:
        intervals: (N,) time since the sample before each [s].
        accelerations: (N, 3) [m/s²].
        yaws: (N,) [rad].
        poses: (N, POSE_COUNT), or (0, POSE_COUNT) for an upright container.
        rows: (N, ROW) receives the answers.
        modal: (N, 2, modes, 4) receives both models' modal states.

    Returns:
        how many samples were taken: fewer than N where a model left the physical range with the
        next one, which then was taken too.
    """
    for i in range(intervals.shape[0]):
        ax, ay, az = accelerations[i, 0], accelerations[i, 1], accelerations[i, 2]
        step(
            linear, nonlinear, memory, limits, intervals[i], ax, ay, az, yaws[i], poses, i, False,
            rows[i],
        )  # fmt: skip
        if rows[i, FLAGS] == LEFT_RANGE:
            return i
        for n in range(modal.shape[2]):
            for k in range(4):
                modal[i, 0, n, k] = linear[0][n, k]
                modal[i, 1, n, k] = nonlinear[0][n, k]
    return intervals.shape[0]
