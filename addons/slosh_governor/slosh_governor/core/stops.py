"""Compiled candidate motions: the stored safe stop, or a share of the command, then a stop.

The governor holds a *stop*: accelerations of the coordinates at the rows of a time grid, linear
between them, that bring the container to rest. A candidate makes one step, of which a share is the
command's, and stops after it: by a cubic velocity with two bumps, or by the held stop plus such a
law for the difference alone.
"""

from __future__ import annotations

import math

import numpy as np

from slosh_base.compiled.compilation import compiled
from slosh_governor.core.layout import (
    BUMP_EARLY,
    BUMP_LATE,
    CANDIDATES,
    DURATION,
    EARLY,
    KIND,
    LATE,
    LAW,
    LEAST,
    LONGEST,
    OTHERS,
    PART,
    PARTS,
    PERIOD,
    PLACE,
    RATE,
    RATIO,
    ROWS,
    SHORTEST,
    SPACING,
    SUBDIVISION,
    SUBSTEP,
    TURN,
    VELOCITY,
    WHOLE,
)

SHARES = (0.7, 0.4, 0.15, 0.0)
"""Of the command, tried in turn."""
SHORTER = (0.0, -2.0, -6.0)
"""Powers of RATIO by which a stop is shortened."""
STILL = 1e-6
"""Speed of a coordinate that rests [m/s or rad/s]: what rounding leaves."""


@compiled
def grid(state, settings, count, intervals, times):  # type: ignore[no-untyped-def]
    """Computes the sample times of candidate motions and their intervals [s].

    Returns the stop's row that is the candidate's row 2.
    """
    dt, per_row = settings[PERIOD], settings[SUBDIVISION]
    left = per_row - state[SUBSTEP] - 1.0  # steps from the next moment to the next row
    first = 1
    if left < 0.5:
        left, first = per_row, 2
    intervals[0], times[0], times[1] = dt, -dt, 0.0
    for row in range(2, count):
        intervals[row - 1] = left * dt if row == 2 else settings[SPACING]
        times[row] = times[row - 1] + intervals[row - 1]
    return first


@compiled
def _held(state, stop, row, k):  # type: ignore[no-untyped-def]
    """Returns the acceleration of coordinate k in the stored safe stop; 0 after the stop's end."""
    return stop[row, k] if row < state[ROWS] else 0.0


@compiled
def next_held(motion, state, stop, settings, found):  # type: ignore[no-untyped-def]
    """Computes the accelerations (D,) of the stored safe stop one step ahead."""
    left = settings[SUBDIVISION] - state[SUBSTEP]
    for k in range(found.shape[0]):
        later = _held(state, stop, 1, k)
        found[k] = motion[RATE, k] + (later - motion[RATE, k]) / left


@compiled
def _add_law(velocity, acceleration, law, times, rows):  # type: ignore[no-untyped-def]
    """Adds accelerations that end a given velocity and acceleration; returns the last row.

    The law is in the rows from 2 on, its first value in row 1; returns the rows up to its end. Its
    integral by the rows is exactly the velocity.
    """
    duration, early, late = law
    end = 2
    weight = 0.0
    count, size = rows.shape
    total = np.zeros(size)
    before = acceleration.copy()
    for row in range(2, count):
        u = times[row] / duration
        step = 0.5 * (times[row] - times[row - 1])
        if u >= 1.0:
            for k in range(size):
                total[k] += step * before[k]
            break
        rest, half, both = 1.0 - u, 1.0 - 2.0 * u, (u * (1.0 - u)) ** 2
        slope = 2.0 * u * rest * half * (early + late * half) - 2.0 * late * both
        for k in range(size):
            now = (slope - 6.0 * u * rest) / duration * velocity[k]
            now += rest * (1.0 - 3.0 * u) * acceleration[k]
            total[k] += step * (before[k] + now)
            before[k] = now
            rows[row, k] += now
        following = times[row + 1] if row + 1 < count else times[row]
        weight += 0.5 * u * rest * (following - times[row - 1])
        end = row + 1
    for row in range(2, end):
        u = times[row] / duration
        for k in range(size):
            rows[row, k] -= (velocity[k] + total[k]) * u * (1.0 - u) / weight
    return end


@compiled
def candidate(motion, state, stop, settings, plan, wanted, held, first, times, rows):  # type: ignore[no-untyped-def]
    """Computes a candidate motion's accelerations; returns the number of samples until rest."""
    dt, share = settings[PERIOD], plan[PART]
    law = (plan[LAW], plan[LAW + 1], plan[LAW + 2])
    size = rows.shape[1]
    velocity, acceleration = np.empty(size), np.empty(size)
    rows[:] = 0.0
    for k in range(size):
        now = motion[RATE, k]
        following = held[k] + share * (wanted[k] - held[k])
        rows[0, k], rows[1, k] = now, following
        velocity[k] = motion[VELOCITY, k] + 0.5 * dt * (now + following)
        acceleration[k] = following
    if plan[KIND] == 1.0:
        return _add_law(velocity, acceleration, law, times, rows)
    for k in range(size):
        acceleration[k] = rows[1, k] - held[k]
        velocity[k] = 0.5 * dt * acceleration[k]
        for row in range(2, rows.shape[0]):
            rows[row, k] = _held(state, stop, first + row - 2, k)
    end = 2
    if share > 0.0:
        end = _add_law(velocity, acceleration, law, times, rows)
    return max(end, min(int(state[ROWS]) - first + 2, rows.shape[0]))


@compiled
def _variant(state, settings, turn):  # type: ignore[no-untyped-def]
    """Returns duration [s] and two shape parameters of a stop that differs from the last stop.

    Not shorter than LEAST: a stop of few steps takes all of the jerk even at a low speed, and one
    that is a little longer takes it, too, with the acceleration of the next step.
    """
    duration, early, late = state[DURATION], state[BUMP_EARLY], state[BUMP_LATE]
    place, sign = turn % 5, 1.0 if (turn // 5) % 2 == 0 else -1.0
    if place < 2:
        duration *= settings[RATIO] ** (sign if place == 0 else 4.0 * sign)
    elif place == 2:
        early += sign * settings[EARLY]
    elif place == 3:
        late += sign * settings[LATE]
    else:
        early, late = 0.0, 0.0
    return min(max(duration, settings[LEAST]), settings[LONGEST]), early, late


@compiled
def make_plans(state, settings, block, follow, plans, best):  # type: ignore[no-untyped-def]
    """Chooses the candidates of one search round: shares of the command, shapes of the stop.

    All of the command with various stops; shares of it with the lowest of them, down to nothing;
    the held stop and others from now on, in a stop shorter ones.
    """
    turn = 2 * int(state[TURN])
    chosen = plans[best].copy()
    for one in range(CANDIDATES):
        plan = plans[one]
        plan[KIND], plan[PART] = min(one, 1), 1.0 if block == WHOLE else 0.0
        if block == PARTS:
            plan[:] = chosen
            plan[PART] = SHARES[one]
            plan[KIND] = chosen[KIND] if SHARES[one] > 0.0 else 0.0
        elif 0 < one < 3 and not follow:
            plan[LAW:] = state[DURATION : DURATION + 3]
            shorter = plan[LAW] * settings[RATIO] ** (SHORTER[one])
            plan[LAW] = max(shorter, settings[SHORTEST])
        elif one > 1 or block == OTHERS:
            plan[LAW], plan[LAW + 1], plan[LAW + 2] = _variant(state, settings, turn + one)
        else:
            plan[LAW:] = state[DURATION : DURATION + 3]


@compiled
def take(motion, state, stop, settings, rows, end):  # type: ignore[no-untyped-def]
    """Advances the motion one step along a candidate and stores its remainder as safe stop."""
    dt, per_row = settings[PERIOD], settings[SUBDIVISION]
    for k in range(rows.shape[1]):
        now, following = motion[RATE, k], rows[1, k]
        motion[PLACE, k] += dt * (motion[VELOCITY, k] + dt * (2.0 * now + following) / 6.0)
        motion[VELOCITY, k] += 0.5 * dt * (now + following)
        motion[RATE, k] = following
    substep = state[SUBSTEP] + 1.0
    # Row 0 of the stop lies behind, or is the present moment.
    stop[0] = rows[1]
    state[SUBSTEP] = substep if substep < per_row - 0.5 else 0.0
    count = min(end - 1, stop.shape[0])
    for row in range(1, count):
        stop[row] = rows[row + 1]
    stop[count:] = 0.0
    state[ROWS] = count


@compiled
def trimmed(motion, state, stop, settings):  # type: ignore[no-untyped-def]
    """Removes samples at rest from the end of the stored stop; returns its duration [s]."""
    count = int(state[ROWS])
    while count > 1 and not (stop[count - 1] != 0.0).any():
        count -= 1
    state[ROWS] = count
    if count > 1:
        return count * settings[SPACING] - state[SUBSTEP] * settings[PERIOD]
    if (motion[RATE] != 0.0).any():
        return settings[SPACING] - state[SUBSTEP] * settings[PERIOD]
    square = 0.0
    for k in range(motion.shape[1]):
        square += motion[VELOCITY, k] ** 2
    if math.sqrt(square) < STILL:
        motion[VELOCITY] = 0.0
    return 0.0
