"""Compiled checks of the joint limits of a robot that carries the container.

Commands are lowered to what the joints can do at this moment. A candidate is refused where a joint
exceeds a limit on its way to rest, or where the joints do not reach it: near singular positions
and beyond the robot's reach.
"""

from __future__ import annotations

from slosh_base.compiled.compilation import compiled, compiled_apart
from slosh_governor.core.inverse import carry, effort, scratch
from slosh_governor.core.layout import (
    EASED,
    FASTEST,
    HARDEST,
    HEAVIEST,
    LOWER,
    PERIOD,
    PLACE,
    RATE,
    REFUSED_JOINT,
    REFUSED_LIMIT,
    SHARPEST,
    UPPER,
    VELOCITY,
)
from slosh_governor.core.moving import PARTED, PARTS_TRIED, move
from slosh_governor.tuning import TUNING

BY_POSITION, BY_VELOCITY, BY_ACCELERATION, BY_JERK, BY_REACH = range(1, 6)
"""Limits by which a motion is refused."""
PULL = TUNING.pull
SLACK = TUNING.slack


@compiled
def _peak(value, slope, following, interval):  # type: ignore[no-untyped-def]
    """Returns a joint value's extreme within an interval; `value` if its slope keeps its sign."""
    if slope * following < 0.0:
        return value + 0.5 * interval * slope * slope / (slope - following)
    return value


@compiled_apart
def _exceeded(before, joints, k, interval, limits):  # type: ignore[no-untyped-def]
    """Returns the code of the limit that a joint exceeds in an interval; 0 for none."""
    x, v, a = before[PLACE, k], before[VELOCITY, k], before[RATE, k]
    place, velocity, rate = joints[PLACE, k], joints[VELOCITY, k], joints[RATE, k]
    extreme = _peak(x, v, velocity, interval)
    if not (limits[LOWER, k] <= min(place, extreme) and max(place, extreme) <= limits[UPPER, k]):
        return BY_POSITION
    fastest = max(abs(velocity), abs(_peak(v, a, rate, interval)))
    if not fastest <= limits[FASTEST, k]:
        return BY_VELOCITY
    if not abs(rate) <= limits[HARDEST, k]:
        return BY_ACCELERATION
    return 0 if abs(rate - a) <= limits[SHARPEST, k] * interval else BY_JERK


@compiled
def _busiest(joints, limits):  # type: ignore[no-untyped-def]
    """Returns the index of the joint whose speed is the largest fraction of its limit."""
    best, most = 0, -1.0
    for k in range(joints.shape[1]):
        part = abs(joints[VELOCITY, k]) / limits[FASTEST, k]
        if part > most:
            best, most = k, part
    return best


@compiled_apart
def _refusing(before, joints, interval, limits, reached):  # type: ignore[no-untyped-def]
    """Returns a joint that exceeds a limit in an interval, and the limit's code (0: none)."""
    if not reached:
        return _busiest(joints, limits), BY_REACH
    for k in range(joints.shape[1]):
        found = _exceeded(before, joints, k, interval, limits)
        if found > 0:
            return k, found
    return 0, 0


@compiled
def _tell(refused, joint, limit):  # type: ignore[no-untyped-def]
    """Stores the joint and limit that a motion violates, unless an earlier violation is stored."""
    if refused[REFUSED_LIMIT] == 0.0:
        refused[REFUSED_JOINT], refused[REFUSED_LIMIT] = joint, limit


@compiled_apart
def eased(motion, command, carrier):  # type: ignore[no-untyped-def]
    """Returns a commanded velocity, reduced to what the joints' position and speed limits allow.

    Args:
        motion: (3, 3) of the container's origin at this moment.
        command: (3,) [m/s].
        carrier: see `joints_keep`; a lowered command is told.
    """
    chain, limits, goal, present, refused = carrier
    found = command.copy()
    if chain.shape[0] == 0:
        return found
    size = present.shape[1]
    joints, now = present.copy(), motion.copy()
    now[VELOCITY, :3] = command
    carry(chain, goal, now, 0.0, joints, scratch(chain, size))
    share, joint, limit = 1.0, 0, 0
    for k in range(size):
        rate, place = joints[VELOCITY, k], joints[PLACE, k]
        most = (1.0 - SLACK) * limits[FASTEST, k]
        left = limits[UPPER, k] - place if rate > 0.0 else place - limits[LOWER, k]
        near = PULL * max(left, 0.0)
        if share * abs(rate) > min(most, near):
            share = min(most, near) / abs(rate)
            joint, limit = k, BY_POSITION if near < most else BY_VELOCITY
    if limit > 0:
        refused[EASED] = 1.0
        _tell(refused, joint, limit)
        for k in range(command.shape[0]):
            found[k] *= share
    return found


@compiled_apart
def part(motion, held, settings, carrier, wanted):  # type: ignore[no-untyped-def]
    """Changes the next acceleration towards that of the safe stop until all joints can follow.

    Args:
        motion: (3, 3) of the container's origin at this moment.
        held: (3,) its next acceleration in the held stop [m/s²].
        settings: (SETTINGS,).
        carrier: see `joints_keep`.
        wanted: (3,) the next acceleration; changed.
    """
    chain, limits, goal, present, _ = carrier
    if chain.shape[0] == 0:
        return
    interval, space = settings[PERIOD], scratch(chain, present.shape[1])
    for _ in range(PARTS_TRIED):
        now, joints = motion.copy(), present.copy()
        move(now, wanted, interval)
        reached = carry(chain, goal, now, interval, joints, space)
        if _refusing(present, joints, interval, limits, reached)[1] == 0:
            return
        for k in range(wanted.shape[0]):
            wanted[k] = held[k] + PARTED * (wanted[k] - held[k])


@compiled_apart
def joints_keep(motion, rows, end, intervals, carrier):  # type: ignore[no-untyped-def]
    """Returns whether the robot's joints keep their limits in a candidate motion.

    Args:
        motion: (3, 3) of the container's origin at this moment.
        rows: (R, 3) its accelerations.
        end: rows until it is at rest.
        intervals: from row to row [s].
        carrier: chain (J + 1, JOINT), without joints: nothing is checked; limits (5, D), goal
            (12,), present joints (3, D), and (REFUSED,), which receives the first joint that does
            not keep a limit, and which.
    """
    chain, limits, goal, present, refused = carrier
    if chain.shape[0] == 0:
        return True
    now, joints, before = motion.copy(), present.copy(), present.copy()
    space = scratch(chain, joints.shape[1])
    for row in range(1, min(end + 1, rows.shape[0])):
        interval = intervals[row - 1]
        move(now, rows[row], interval)
        before[:] = joints
        reached = carry(chain, goal, now, interval, joints, space)
        which, limit = _refusing(before, joints, interval, limits, reached)
        if limit > 0:
            _tell(refused, which, limit)
            return False
    # From near a singular position it could not go on.
    ended, heaviest = effort(chain, joints[PLACE], limits[FASTEST], space)
    if ended > refused[HEAVIEST]:
        _tell(refused, heaviest, BY_REACH)
        return False
    return True


@compiled
def carry_on(motion, interval, carrier):  # type: ignore[no-untyped-def]
    """Advances the joints by one step so that they follow the container's motion (3, 3)."""
    chain, _, goal, joints, _ = carrier
    if chain.shape[0] > 0:
        carry(chain, goal, motion, interval, joints, scratch(chain, joints.shape[1]))
