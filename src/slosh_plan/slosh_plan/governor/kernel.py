"""Compiled step of the governor: finds the largest part of a command with a safe stop after it.

The governor holds a *stop*: accelerations at the rows of a time grid, linear between them, that
bring the container to rest and the liquid's height below the limit in every one of its models.
The next acceleration is a mixture of the stop's and of the command's; both keep the limits of
acceleration and jerk, hence so does every mixture. It is taken if a stop from there is found. With
the share 0 the stop that is held goes on: there is always an answer.

New stops are the laws of `slosh_plan.stopping` from the new velocity and acceleration, or the held
stop plus such a law for the differences alone. All candidates and models go through
`slosh_model.batch_kernel` together, a lane for each.
"""

from __future__ import annotations

import math

import numpy as np
from numba.types import Array, boolean, int64

from slosh_base.compiled.compilation import (
    CHANGED_1,
    CHANGED_2,
    GIVEN_1,
    compiled,
    entry_point,
)
from slosh_model.batch_kernel import advance_lanes
from slosh_model.indices import POSE_COUNT
from slosh_model.kernel import UPRIGHT, advance, corner_height, turned
from slosh_model.layout import records
from slosh_model.outline_wall import highest_at_corners

MODELS, CANDIDATES = 8, 4
"""Models that all keep the limit, the nominal one first; stops that are tried together."""
LIGHT = 6
"""So many that follow the first have the least damping."""
WHOLE, PARTS, OTHERS = range(3)
"""What is tried in turn; see `_plan`."""
KIND, PART, LAW = range(3)
"""A candidate: 0: the held stop and a law for the difference, 1: a law of its own; share of the
command; then duration [s] and bumps of the law."""
SHARES = (0.7, 0.4, 0.15, 0.0)
SHORTER = (0.0, -2.0, -6.0)
"""Powers of RATIO by which a stop is shortened."""
STILL = 1e-6
"""Speed of a container that rests [m/s]: what rounding leaves."""

(
    PERIOD, SPACING, SUBDIVISION, HEIGHT, RESERVE, ACCELERATION, JERK, TAIL, SHORTEST, LONGEST,
    RATIO, EARLY, LATE, ENOUGH, HASTE, SPREAD,
) = range(16)  # fmt: skip
"""Settings: time of a step, of a row [s], steps of a row; limit [m], part by which heights are
raised, limits [m/s², m/s³]; time that is looked at after a stop, shortest and longest stop [s];
ratio of two durations, steps of the two bumps [1]; part of the limit below which a stop is as good
as any; what a second of its duration costs, in parts of the limit; part of the difference of the
lightly damped models' heights that is added for those between them."""
SETTINGS = 16

(
    VX, VY, VZ, AX, AY, AZ, PX, PY, PZ, SUBSTEP, ROWS, DURATION, BUMP_EARLY, BUMP_LATE, TURN,
    EXTRA, BOUND,
) = range(17)  # fmt: skip
"""State: velocity [m/s], acceleration [m/s²], position [m], step since the stop's row 0, rows of
the stop; duration [s] and bumps of the last good law, number of the step, and what heights are
raised by, for an uncertain state [m]; height up to which the held stop was found safe [m]."""
STATE = 17

SHARE, PEAK, NOMINAL, REST, TRIED = range(5)
"""An answer: share of the command; the highest height of any model, in the stop and after it, and
that of the nominal model [m]; time until it rests [s]; blocks of stops that were tried."""
ANSWER = 5

_COUNTS = Array(int64, 1, "C")


@compiled
def _wanted(state, command, settings, found):  # type: ignore[no-untyped-def]
    """Writes the acceleration that reaches the commanded velocity as fast as the limits allow."""
    dt, jerk = settings[PERIOD], settings[JERK]
    size = 0.0
    for k in range(3):
        found[k] = command[k] - state[VX + k] - 0.5 * dt * state[AX + k]
        size += found[k] * found[k]
    size = math.sqrt(size)
    # The acceleration that can still be taken back until the velocity is reached.
    most = math.sqrt(jerk * dt * jerk * dt + 2.0 * jerk * size) - jerk * dt
    most = min(most, settings[ACCELERATION])
    change = 0.0
    for k in range(3):
        found[k] = (found[k] * most / size if size > 0.0 else 0.0) - state[AX + k]
        change += found[k] * found[k]
    change = math.sqrt(change)
    share = min(1.0, jerk * dt / change) if change > 0.0 else 0.0
    for k in range(3):
        found[k] = state[AX + k] + share * found[k]


@compiled
def _grid(state, settings, count, intervals, times):  # type: ignore[no-untyped-def]
    """Writes the times of a candidate motion's samples after the next step, and their intervals.

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
def _held(state, stop, settings, row, k):  # type: ignore[no-untyped-def]
    """Returns the acceleration of the stored safe stop at a sample; 0 after its end."""
    return stop[row, k] if row < state[ROWS] else 0.0


@compiled
def _next_held(state, stop, settings, found):  # type: ignore[no-untyped-def]
    """Writes the acceleration of the stored safe stop at the next step."""
    left = settings[SUBDIVISION] - state[SUBSTEP]
    for k in range(3):
        later = _held(state, stop, settings, 1, k)
        found[k] = state[AX + k] + (later - state[AX + k]) / left


@compiled
def _add_law(velocity, acceleration, law, times, rows):  # type: ignore[no-untyped-def]
    """Adds a law that reduces velocity and acceleration to 0; see `stopping`, `_Moving.law`.

    The law is in the rows from 2 on, its first value in row 1; returns the rows up to its end. Its
    integral by the rows is exactly the velocity.
    """
    duration, early, late = law
    end = 2
    weight = 0.0
    total = np.zeros(3)
    before = acceleration.copy()
    count = rows.shape[0]
    for row in range(2, count):
        u = times[row] / duration
        step = 0.5 * (times[row] - times[row - 1])
        if u >= 1.0:
            for k in range(3):
                total[k] += step * before[k]
            break
        rest, half, both = 1.0 - u, 1.0 - 2.0 * u, (u * (1.0 - u)) ** 2
        slope = 2.0 * u * rest * half * (early + late * half) - 2.0 * late * both
        for k in range(3):
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
        for k in range(3):
            rows[row, k] -= (velocity[k] + total[k]) * u * (1.0 - u) / weight
    return end


@compiled
def _allowed(rows, intervals, end, settings):  # type: ignore[no-untyped-def]
    """Whether a candidate motion keeps the limits of acceleration and jerk."""
    for row in range(1, end + 1):
        size = change = 0.0
        for k in range(3):
            size += rows[row, k] ** 2
            change += (rows[row, k] - rows[row - 1, k]) ** 2
        most = settings[JERK] * intervals[row - 1] * (1.0 + 1e-9)
        if size > settings[ACCELERATION] ** 2 * (1.0 + 1e-9) or change > most * most:
            return False
    return True


@compiled
def _candidate(state, stop, settings, plan, wanted, held, first, times, rows):  # type: ignore[no-untyped-def]
    """Writes the samples of a candidate motion; returns their number until it is at rest."""
    dt, share = settings[PERIOD], plan[PART]
    law = (plan[LAW], plan[LAW + 1], plan[LAW + 2])
    velocity, acceleration = np.empty(3), np.empty(3)
    rows[:] = 0.0
    for k in range(3):
        now = state[AX + k]
        following = held[k] + share * (wanted[k] - held[k])
        rows[0, k], rows[1, k] = now, following
        velocity[k] = state[VX + k] + 0.5 * dt * (now + following)
        acceleration[k] = following
    if plan[KIND] == 1.0:
        return _add_law(velocity, acceleration, law, times, rows)
    for k in range(3):
        acceleration[k] = rows[1, k] - held[k]
        velocity[k] = 0.5 * dt * acceleration[k]
        for row in range(2, rows.shape[0]):
            rows[row, k] = _held(state, stop, settings, first + row - 2, k)
    end = 2
    if share > 0.0:
        end = _add_law(velocity, acceleration, law, times, rows)
    return max(end, min(int(state[ROWS]) - first + 2, rows.shape[0]))


@compiled
def _highest(corners, count, x, y, axes, both_ways):  # type: ignore[no-untyped-def]
    """Returns the greatest height on a wall with corners.

    both_ways: x and y are amplitudes in axes that far from the container's, of either sign.
    """
    if not both_ways:
        return highest_at_corners(corners, count, x, y)
    best = 0.0
    for sign in (-1.0, 1.0):
        for other in (-1.0, 1.0):
            along, across = turned(sign * x, other * y, -axes)
            best = max(best, highest_at_corners(corners, count, along, across))
    return best


@compiled
def _peaks(stores, rows, ends, intervals, count, how, settings, peaks):  # type: ignore[no-untyped-def]
    """Writes each candidate's greatest height over all models, and that of the nominal model.

    After a stop the two axes of a wall with corners have waves of different frequencies, whose
    crests may meet at any time: the highest of both add.

    how: whether the models have effects on the input, on the constants with time, sub-steps.
    """
    lanes = CANDIDATES * MODELS
    copies = np.empty((lanes, stores.shape[1]))
    which = np.empty(lanes, dtype=np.int64)
    for lane in range(lanes):
        copies[lane] = stores[lane % MODELS]
        which[lane] = lane // MODELS
    heights = np.empty((lanes, count, 2))
    counts = np.full(count - 1, how[2])
    advance_lanes(
        copies, counts, np.zeros(lanes, dtype=np.int64), which,
        intervals[: count - 1].copy().reshape(1, count - 1), rows[:, :count].copy(),
        np.empty((0, count)), np.empty((0, count, POSE_COUNT)), how[0] != 0, how[1] != 0, heights,
    )  # fmt: skip
    runs, modes = records(stores[0])
    cornered, corners = runs[0]["cornered"] != 0.0, int(runs[0]["corner_count"])
    axes = runs[0]["axes"]
    beating = cornered or modes[0]["frequency_ratio"] != 1.0 or modes[0]["along_x"] != 0.0
    for one in range(CANDIDATES):
        highest, nominal, least = 0.0, 0.0, math.inf
        for model in range(MODELS):
            lane, top = one * MODELS + model, 0.0
            last_x = last_y = 0.0
            for row in range(1, count):
                x, y = heights[lane, row, 0], heights[lane, row, 1]
                after = beating and row >= ends[one] - 1
                if after:
                    x, y = turned(x, y, axes)
                    x = last_x = max(last_x, abs(x))
                    y = last_y = max(last_y, abs(y))
                if corners > 0:
                    eta = _highest(runs[0]["corners"], corners, x, y, axes, after)
                else:
                    eta = corner_height(x, y) if cornered else math.sqrt(x * x + y * y)
                top = max(top, eta) if eta == eta else math.inf
            highest = max(highest, top)
            if model == 0:
                nominal = top
            elif model <= LIGHT:
                least = min(least, top)
        between = settings[SPREAD] * (highest - least)
        peaks[one, 0], peaks[one, 1] = (highest + between) * (1.0 + settings[RESERVE]), nominal


@compiled
def _variant(state, settings, turn):  # type: ignore[no-untyped-def]
    """Returns a variation of the last good time law; each step tries other variations."""
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
    return min(max(duration, settings[SHORTEST]), settings[LONGEST]), early, late


@compiled
def _take(state, stop, settings, rows, end):  # type: ignore[no-untyped-def]
    """Makes a step along a candidate motion, which becomes the stored safe stop."""
    dt, per_row = settings[PERIOD], settings[SUBDIVISION]
    for k in range(3):
        now, following = state[AX + k], rows[1, k]
        state[PX + k] += dt * (state[VX + k] + dt * (2.0 * now + following) / 6.0)
        state[VX + k] += 0.5 * dt * (now + following)
        state[AX + k] = following
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
def _best(peaks, kept, rests, settings, limit, in_order, follow):  # type: ignore[no-untyped-def]
    """Returns the best candidate: a safe one, or else the one with the lowest height.

    Of safe ones the first where they are in order; the quickest in a stop; else height and
    duration count, so that the next steps have a choice.
    """
    best, best_score, best_safe = -1, math.inf, False
    for one in range(peaks.shape[0]):
        if not kept[one]:
            continue
        safe = peaks[one, 0] <= limit
        score = peaks[one, 0]
        if safe and in_order:
            score = float(one)
        elif safe:
            enough = settings[ENOUGH] if follow else 1.0
            score = max(score / settings[HEIGHT], enough) + settings[HASTE] * rests[one]
        if best < 0 or (safe and not best_safe) or (safe == best_safe and score < best_score):
            best, best_score, best_safe = one, score, safe
    return max(best, 0)


@compiled
def _trimmed(state, stop, settings):  # type: ignore[no-untyped-def]
    """Removes samples at rest from the end of the stop; returns the time until rest [s]."""
    count = int(state[ROWS])
    while count > 1 and not (stop[count - 1] != 0.0).any():
        count -= 1
    state[ROWS] = count
    if count > 1:
        return count * settings[SPACING] - state[SUBSTEP] * settings[PERIOD]
    still = state[AX] == 0.0 and state[AY] == 0.0 and state[AZ] == 0.0
    if not still:
        return settings[SPACING] - state[SUBSTEP] * settings[PERIOD]
    if math.sqrt(state[VX] ** 2 + state[VY] ** 2 + state[VZ] ** 2) < STILL:
        state[VX] = state[VY] = state[VZ] = 0.0
    return 0.0


@compiled
def _plan(state, settings, block, follow, plans, best):  # type: ignore[no-untyped-def]
    """Writes the parameters of the candidate motions that are simulated together.

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


@entry_point(
    int64(
        CHANGED_2, CHANGED_2, CHANGED_1, GIVEN_1, boolean, GIVEN_1, _COUNTS, CHANGED_1, CHANGED_1,
    )
)  # fmt: skip
def govern(stores, stop, state, command, follow, settings, how, chosen, answer):  # type: ignore[no-untyped-def]
    """Computes one step of the governor, of duration PERIOD.

    Args:
        stores: (MODELS, …) the models at this moment; advanced to the next.
        stop: (R, 3) the held stop's rows; changed.
        state: (STATE,); changed.
        command: (3,) velocity [m/s].
        follow: whether the command counts; else the stop goes on.
        settings: (SETTINGS,).
        how: (3,) see `_peaks`.
        chosen: (3,) receives the acceleration of the next moment [m/s²].
        answer: (ANSWER,).

    Returns:
        0: the answer keeps the limit; 1: no stop that was found does.
    """
    size = stop.shape[0] + 2
    intervals, times = np.zeros(size), np.zeros(size)
    first = _grid(state, settings, size, intervals, times)
    wanted, held = np.empty(3), np.empty(3)
    _next_held(state, stop, settings, held)
    _wanted(state, command, settings, wanted)
    rows, peaks = np.zeros((CANDIDATES, size, 3)), np.zeros((CANDIDATES, 2))
    plans = np.zeros((CANDIDATES, 5))
    ends, kept = np.zeros(CANDIDATES, dtype=np.int64), np.zeros(CANDIDATES, dtype=np.int64)
    tail = math.ceil(settings[TAIL] / settings[SPACING])
    limit = settings[HEIGHT] - state[EXTRA]
    state[TURN] += 1.0
    best, safe, answer[TRIED] = 0, False, 0.0
    block = WHOLE if follow else OTHERS
    while block <= OTHERS and not safe:
        _plan(state, settings, block, follow, plans, best)
        for one in range(CANDIDATES):
            plan = plans[one]
            ends[one] = _candidate(
                state, stop, settings, plan, wanted, held, first, times, rows[one]
            )
            kept[one] = (plan[KIND] == 0.0 and plan[PART] == 0.0) or (
                ends[one] + tail < size and _allowed(rows[one], intervals, ends[one], settings)
            )
        count = min(int(ends.max()) + tail, size)
        _peaks(stores, rows, ends, intervals, count, how, settings, peaks)
        for one in range(CANDIDATES):
            if plans[one, KIND] == 0.0 and plans[one, PART] == 0.0:
                # What is left of a stop is no higher than all of it.
                peaks[one, 0] = min(peaks[one, 0], state[BOUND])
        best = _best(peaks, kept, times[ends - 1], settings, limit, block == PARTS, follow)
        safe = kept[best] != 0 and peaks[best, 0] <= limit
        answer[TRIED] += 1.0
        block += 1
    state[BOUND] = peaks[best, 0]
    if plans[best, KIND] == 1.0:
        state[DURATION : DURATION + 3] = plans[best, LAW:]
    answer[SHARE], answer[NOMINAL] = plans[best, PART], peaks[best, 1]
    answer[PEAK] = peaks[best, 0] + state[EXTRA]
    _take(state, stop, settings, rows[best], ends[best])
    answer[REST] = _trimmed(state, stop, settings)
    chosen[:] = state[AX : AX + 3]
    for model in range(MODELS):
        runs, modes = records(stores[model])
        advance(runs[0], modes, chosen[0], chosen[1], chosen[2], 0.0, UPRIGHT, settings[PERIOD])
    return 0 if safe else 1
