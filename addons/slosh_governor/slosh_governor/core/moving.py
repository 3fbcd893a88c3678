"""Compiled motion of axes or joints: acceleration towards a command, and a candidate's effect.

See `governor.kernel`.
"""

from __future__ import annotations

import math

import numpy as np

from slosh_base.compiled.compilation import compiled
from slosh_governor.core.chain import felt_at
from slosh_governor.core.layout import (
    ACCELERATION,
    FASTEST,
    HARDEST,
    JERK,
    LOWER,
    PERIOD,
    PLACE,
    RATE,
    SHARPEST,
    UPPER,
    VELOCITY,
)

ROUNDING = 1e-9
PARTED = 0.8
"""Factor by which a command's change is reduced until the container keeps its limits,"""
PARTS_TRIED = 12
"""at most so often."""


@compiled
def _towards(left, jerk, limit, dt):  # type: ignore[no-untyped-def]
    """Returns the largest acceleration that the jerk limit can end at the target velocity."""
    return min(math.sqrt(jerk * dt * jerk * dt + 2.0 * jerk * left) - jerk * dt, limit)


@compiled
def wanted_by_axes(motion, command, settings, found):  # type: ignore[no-untyped-def]
    """Computes the next acceleration (x, y, z) towards a commanded velocity, within limits."""
    dt, jerk = settings[PERIOD], settings[JERK]
    size = 0.0
    for k in range(3):
        found[k] = command[k] - motion[VELOCITY, k] - 0.5 * dt * motion[RATE, k]
        size += found[k] * found[k]
    size = math.sqrt(size)
    most = _towards(size, jerk, settings[ACCELERATION], dt)
    change = 0.0
    for k in range(3):
        found[k] = (found[k] * most / size if size > 0.0 else 0.0) - motion[RATE, k]
        change += found[k] * found[k]
    change = math.sqrt(change)
    share = min(1.0, jerk * dt / change) if change > 0.0 else 0.0
    for k in range(3):
        found[k] = motion[RATE, k] + share * found[k]


@compiled
def _within(before, behind, interval, settings):  # type: ignore[no-untyped-def]
    """Whether acceleration and jerk between two samples of the origin keep their limits."""
    size = change = 0.0
    for k in range(3):
        size += behind[k] ** 2
        change += (behind[k] - before[k]) ** 2
    most = settings[JERK] * interval * (1.0 + ROUNDING)
    return size <= settings[ACCELERATION] ** 2 * (1.0 + ROUNDING) and change <= most * most


@compiled
def wanted_of_joints(motion, command, limits, settings, held, robot, found):  # type: ignore[no-untyped-def]
    """Computes the next joint accelerations towards commanded velocities, within all limits."""
    dt, count = settings[PERIOD], command.shape[0]
    for k in range(count):
        left = command[k] - motion[VELOCITY, k] - 0.5 * dt * motion[RATE, k]
        most = _towards(abs(left), limits[SHARPEST, k], limits[HARDEST, k], dt)
        change = math.copysign(most, left) - motion[RATE, k]
        step = limits[SHARPEST, k] * dt
        found[k] = motion[RATE, k] + min(max(change, -step), step)
    felt, moved, now = np.empty((robot[1].shape[0], 3)), np.empty(3), np.empty(3)
    felt_at(robot[0], robot[1], motion, felt, now)
    following = np.empty((3, count))
    for _ in range(PARTS_TRIED):
        for k in range(count):
            following[RATE, k] = found[k]
            following[VELOCITY, k] = motion[VELOCITY, k] + 0.5 * dt * (motion[RATE, k] + found[k])
            following[PLACE, k] = motion[PLACE, k] + dt * motion[VELOCITY, k]
        felt_at(robot[0], robot[1], following, felt, moved)
        if _within(now, moved, dt, settings):
            return
        for k in range(count):
            found[k] = held[k] + PARTED * (found[k] - held[k])


@compiled
def move(motion, following, interval):  # type: ignore[no-untyped-def]
    """Integrates the coordinates over an interval with linearly changing accelerations."""
    for k in range(following.shape[0]):
        a, b = motion[RATE, k], following[k]
        motion[PLACE, k] += interval * (motion[VELOCITY, k] + interval * (2.0 * a + b) / 6.0)
        motion[VELOCITY, k] += 0.5 * interval * (a + b)
        motion[RATE, k] = b


@compiled
def drive(motion, rows, end, intervals, robot, settings, must, driven):  # type: ignore[no-untyped-def]
    """Computes the acceleration at each container's points during a candidate motion.

    Args:
        motion: (3, D) the present one.
        rows: (R, D) accelerations of the coordinates.
        end: rows until it is at rest; behind it everything stays.
        intervals: [s].
        robot: joints and points; see `chain.felt_at`. Without joints rows are accelerations.
        settings: (SETTINGS,).
        must: whether it is looked at to its end although it exceeds a limit.
        driven: (P, R, 3) receives them.

    Returns:
        whether the origin keeps its limits of acceleration and jerk.
    """
    chained = robot[0].shape[0] > 0
    now, felt = motion.copy(), np.empty((robot[1].shape[0], 3))
    before, behind = np.empty(3), np.empty(3)
    kept = True
    for row in range(end + 1):
        if row > 0:
            move(now, rows[row], intervals[row - 1])
        before[:] = behind
        if chained:
            felt_at(robot[0], robot[1], now, felt, behind)
        else:
            for k in range(3):
                felt[0, k] = behind[k] = rows[row, k]
        for point in range(felt.shape[0]):
            for k in range(3):
                driven[point, row, k] = felt[point, k]
        if row > 0 and not _within(before, behind, intervals[row - 1], settings):
            kept = False
            if not must:
                return kept
    for point in range(felt.shape[0]):
        driven[point, end + 1 :] = driven[point, end]
    return kept


@compiled
def keeps_limits(motion, rows, end, intervals, limits):  # type: ignore[no-untyped-def]
    """Whether a candidate keeps the joints' position, velocity, acceleration and jerk limits."""
    for k in range(rows.shape[1]):
        place, velocity = motion[PLACE, k], motion[VELOCITY, k]
        for row in range(1, end + 1):
            h, a, b = intervals[row - 1], rows[row - 1, k], rows[row, k]
            place += h * (velocity + h * (2.0 * a + b) / 6.0)
            velocity += 0.5 * h * (a + b)
            kept = limits[LOWER, k] <= place <= limits[UPPER, k]
            kept = kept and abs(velocity) <= limits[FASTEST, k] * (1.0 + ROUNDING)
            kept = kept and abs(b) <= limits[HARDEST, k] * (1.0 + ROUNDING)
            if not (kept and abs(b - a) <= limits[SHARPEST, k] * h * (1.0 + ROUNDING)):
                return False
    return True
