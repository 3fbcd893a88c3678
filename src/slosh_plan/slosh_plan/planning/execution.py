"""Converts a planned motion for a controller, with the times at its waypoints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_plan.planning.time_law import PlannedMotion
from slosh_plan.tuning import TUNING

Rows = NDArray[np.int64]

_AHEAD = 1024


@dataclass(frozen=True, slots=True, eq=False)
class Execution:
    """A planned motion for a controller, with the sample index at which it passes each waypoint.

    Attributes:
        t: (N,) time from 0, strictly increasing [s].
        position, velocity, acceleration: (N, 3) of the container's origin, world's axes
            [m, m/s, m/s²].
        waypoints: (M,) the row in which each waypoint is passed, rising.
    """

    t: Array
    position: Array
    velocity: Array
    acceleration: Array
    waypoints: Rows


def execution_of(motion: PlannedMotion, waypoints: Array) -> Execution:
    """Adds samples to a motion at the times at which it passes the waypoints.

    Args:
        motion: along a path through the waypoints.
        waypoints: (M, 3) in their order [m].
    """
    velocity = np.gradient(motion.position, motion.t, axis=0, edge_order=2)
    velocity[[0, -1]] = 0.0
    # Whole microseconds: two waypoints of nearly one place are one row, or clearly two.
    passed = np.round(passing_times(motion, waypoints), 6)
    rows = np.rint(passed / (motion.t[1] - motion.t[0])).astype(np.int64)
    near = np.abs(passed - motion.t[rows]) <= TUNING.same_time
    passed = np.where(near, motion.t[rows], passed)
    more = np.setdiff1d(passed, motion.t)
    t = np.sort(np.concatenate((motion.t, more)))
    inside = [_between(motion, velocity, moment) for moment in more]
    columns = []
    for place, own in enumerate((motion.position, velocity, motion.acceleration)):
        added = np.array([one[place] for one in inside]).reshape(-1, 3)
        columns.append(np.insert(own, np.searchsorted(motion.t, more), added, axis=0))
    return Execution(t, columns[0], columns[1], columns[2], np.searchsorted(t, passed))


def passing_times(motion: PlannedMotion, waypoints: Array) -> Array:
    """Returns the times [s] at which a motion passes each waypoint (M, 3), in order."""
    starts, steps = motion.position[:-1], np.diff(motion.position, axis=0)
    squares = np.maximum((steps**2).sum(axis=1), 1e-30)
    times, row, share = np.empty(len(waypoints)), 0, 0.0
    for number, point in enumerate(waypoints):
        ahead = slice(row, row + _AHEAD)
        while True:
            along = ((point - starts[ahead]) * steps[ahead]).sum(axis=1) / squares[ahead]
            along = np.clip(along, 0.0, 1.0)
            along[0] = max(along[0], share if ahead.start == row else 0.0)
            reached = starts[ahead] + along[:, None] * steps[ahead]
            away = np.linalg.norm(reached - point, axis=1)
            if (away <= TUNING.near).any() or ahead.stop >= len(starts):
                break
            ahead = slice(ahead.start, ahead.stop + _AHEAD)
        best = _first_nearest(away)
        row, share = ahead.start + best, float(along[best])
        times[number] = motion.t[row] + share * (motion.t[row + 1] - motion.t[row])
    return times


def _first_nearest(away: Array) -> int:
    """Returns the sample index of the first close approach to a waypoint, else of the nearest."""
    near = away <= TUNING.near
    if not near.any():
        return int(np.argmin(away))
    first = int(np.argmax(near))
    rest = near[first:]
    last = len(away) if rest.all() else first + int(np.argmin(rest))
    return first + int(np.argmin(away[first:last]))


def _between(motion: PlannedMotion, velocity: Array, moment: float) -> tuple[Array, Array, Array]:
    """Interpolates position, velocity and acceleration at a time, for a constant jerk."""
    row = int(np.searchsorted(motion.t, moment)) - 1
    since, step = moment - motion.t[row], motion.t[row + 1] - motion.t[row]
    jerk = (motion.acceleration[row + 1] - motion.acceleration[row]) / step
    acceleration = motion.acceleration[row] + since * jerk
    speed = velocity[row] + since * (motion.acceleration[row] + since * jerk / 2.0)
    place = motion.position[row] + since * (
        velocity[row] + since * (motion.acceleration[row] / 2.0 + since * jerk / 6.0)
    )
    return place, speed, acceleration
