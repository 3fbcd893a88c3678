"""Compiled step of the governor: finds the largest part of a command with a safe stop after it.

The governor holds a *stop* that brings the container to rest within all limits, in every model of
every container; see `stops`. The next acceleration is a mixture of the stop's and of the
command's. It is taken if a stop from there is found. With the share 0 the stop that is held goes
on: there is always an answer.

All candidates are judged by the container that was nearest to its limits, and the best of them by
the others.
"""

from __future__ import annotations

import math

import numpy as np
from numba.types import boolean, int64, void

from slosh_base.compiled.compilation import (
    CHANGED_1,
    CHANGED_2,
    GIVEN_1,
    GIVEN_2,
    compiled,
    entry_point,
)
from slosh_model.kernel import UPRIGHT, advance
from slosh_model.layout import records
from slosh_plan.governor.chain import felt_at
from slosh_plan.governor.layout import (
    ACCELERATION,
    BOUND,
    CANDIDATES,
    CRITICAL,
    DURATION,
    ENOUGH,
    FASTEST,
    HARDEST,
    HASTE,
    JERK,
    KIND,
    LAW,
    LOWER,
    MODELS,
    OTHERS,
    PART,
    PARTS,
    PERIOD,
    PLACE,
    PLAN,
    POINT,
    RATE,
    REST,
    SHARE,
    SHARPEST,
    SIZE,
    SPACING,
    TAIL,
    TRIED,
    TURN,
    UPPER,
    USE,
    USES,
    VELOCITY,
    WHOLE,
)
from slosh_plan.governor.stops import candidate, grid, make_plans, next_held, take, trimmed
from slosh_plan.governor.uses import add_uses

ROUNDING = 1e-9
PARTED = 0.8
"""Factor by which a command's change is reduced until the container keeps its limits,"""
PARTS_TRIED = 12
"""at most so often."""
JUDGED, KNOWN = 1, 2
"""Candidates that are simulated, and what is left of a stop that was."""


@compiled
def _towards(left, jerk, limit, dt):  # type: ignore[no-untyped-def]
    """Returns the acceleration that can still be taken back until the velocity is reached."""
    return min(math.sqrt(jerk * dt * jerk * dt + 2.0 * jerk * left) - jerk * dt, limit)


@compiled
def _wanted(motion, command, settings, found):  # type: ignore[no-untyped-def]
    """Writes the acceleration that reaches the commanded velocity as fast as the limits allow."""
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
    """Whether two accelerations of the container's origin keep its limits."""
    size = change = 0.0
    for k in range(3):
        size += behind[k] ** 2
        change += (behind[k] - before[k]) ** 2
    most = settings[JERK] * interval * (1.0 + ROUNDING)
    return size <= settings[ACCELERATION] ** 2 * (1.0 + ROUNDING) and change <= most * most


@compiled
def _wanted_of_joints(motion, command, limits, settings, held, robot, found):  # type: ignore[no-untyped-def]
    """Writes the same for joints, each by its own limits, and all by the container's."""
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
def _move(motion, following, interval):  # type: ignore[no-untyped-def]
    """Moves the coordinates on by an interval, in which accelerations change linearly."""
    for k in range(following.shape[0]):
        a, b = motion[RATE, k], following[k]
        motion[PLACE, k] += interval * (motion[VELOCITY, k] + interval * (2.0 * a + b) / 6.0)
        motion[VELOCITY, k] += 0.5 * interval * (a + b)
        motion[RATE, k] = b


@compiled
def _drive(motion, rows, end, intervals, robot, settings, must, driven):  # type: ignore[no-untyped-def]
    """Writes the accelerations at each point that a candidate motion causes.

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
            _move(now, rows[row], intervals[row - 1])
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
def _allowed(motion, rows, end, intervals, limits):  # type: ignore[no-untyped-def]
    """Whether a candidate keeps the limits of each coordinate."""
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


@compiled
def _best(uses, kept, rests, settings, in_order, follow):  # type: ignore[no-untyped-def]
    """Returns the best candidate: a safe one, or else the one that uses least.

    Of safe ones the first where they are in order; the quickest in a stop; else height and
    duration count, so that the next steps have a choice.
    """
    best, best_score, best_safe = -1, math.inf, False
    for one in range(uses.shape[0]):
        if not kept[one]:
            continue
        safe = uses[one] <= 1.0
        score = uses[one]
        if safe and in_order:
            score = float(one)
        elif safe:
            enough = settings[ENOUGH] if follow else 1.0
            score = max(score, enough) + settings[HASTE] * rests[one]
        if best < 0 or (safe and not best_safe) or (safe == best_safe and score < best_score):
            best, best_score, best_safe = one, score, safe
    return max(best, 0)


@compiled
def _is_held(plan):  # type: ignore[no-untyped-def]
    """Whether a candidate is the stop that is held already."""
    return plan[KIND] == 0.0 and plan[PART] == 0.0


@compiled
def _is_known(plan, state):  # type: ignore[no-untyped-def]
    """Whether a candidate is the held stop that was found safe: what is left of it is, too."""
    return _is_held(plan) and state[BOUND] <= 1.0


@compiled
def _judged(plans, kept, own, state, shares):  # type: ignore[no-untyped-def]
    """Writes the share of the critical container's limits that each candidate uses."""
    for one in range(CANDIDATES):
        shares[one] = own[one, USE] if kept[one] == JUDGED else math.inf
        if _is_known(plans[one], state):
            shares[one] = state[BOUND]


@compiled
def _chosen(  # type: ignore[no-untyped-def]
    stores, cups, driven, plans, ends, kept, times, intervals, count, settings, state, block,
    follow, told,
):  # fmt: skip
    """Returns the best candidate of a block, and the share of its limits that it uses.

    One that exceeds a limit of another container than the critical one gives way to the next; of
    all of the command only one is tried.
    """
    critical, turn, best = int(state[CRITICAL]), 0, -1
    own, shares = np.full((CANDIDATES, USES), math.nan), np.full(CANDIDATES, math.inf)
    uses = own.copy()
    cup, which = critical, np.flatnonzero(kept == JUDGED)
    while True:
        if which.shape[0] > 0:
            part = stores[cup * MODELS : (cup + 1) * MODELS]
            add_uses(part, cups[cup], driven, which, ends, intervals, count, settings, own)
        if best < 0:
            uses[:] = own
            _judged(plans, kept, own, state, shares)
        else:
            told[cup] = own[best]
            if own[best, USE] > shares[best]:
                shares[best] = own[best, USE]
                state[CRITICAL] = cup
        if best < 0 or (shares[best] > 1.0 and block != WHOLE):
            best = _best(shares, kept, times[ends - 1], settings, block == PARTS, follow)
            told[:] = math.nan
            told[critical] = uses[best]
            turn = 0
        turn += int(turn == critical)
        done = turn >= cups.shape[0] or _is_known(plans[best], state)
        if done or not shares[best] <= 1.0:
            return best, shares[best]
        cup, which = turn, np.array([best])
        turn += 1


@entry_point(
    int64(
        CHANGED_2, CHANGED_2, CHANGED_2, CHANGED_1, GIVEN_1, boolean, GIVEN_1, GIVEN_2, GIVEN_2,
        GIVEN_2, GIVEN_2, CHANGED_2, CHANGED_2, CHANGED_1,
    )
)  # fmt: skip
def govern(  # type: ignore[no-untyped-def]
    stores, stop, motion, state, command, follow, settings, limits, cups, joints, points,
    chosen, told, answer,
):  # fmt: skip
    """Computes one step of the governor, of duration PERIOD.

    Args:
        stores: (C MODELS, …) the models of all containers at this moment; advanced to the next.
        stop: (R, D) the held stop's rows; changed.
        motion: (3, D); changed.
        state: (STATE,); changed.
        command: (D,) velocity of each coordinate [m/s or rad/s].
        follow: whether the command counts; else the stop goes on.
        settings: (SETTINGS,).
        limits: (5, D) of each coordinate.
        cups: (C, CUP).
        joints, points: see `chain.felt_at`; no joints: the coordinates are x, y, z.
        chosen: (P, 3) receives the acceleration of the next moment at each point [m/s²].
        told: (C, USES) receives what the answer uses of each container's limits; NaN: not looked
            at, as its stop was found safe before.
        answer: (ANSWER,).

    Returns:
        0: the answer keeps the limits; 1: no stop that was found does.
    """
    robot = (joints, points)
    size, coordinates = stop.shape[0] + 2, stop.shape[1]
    intervals, times = np.zeros(size), np.zeros(size)
    first = grid(state, settings, size, intervals, times)
    wanted, held = np.empty(coordinates), np.empty(coordinates)
    next_held(motion, state, stop, settings, held)
    if joints.shape[0] == 0:
        _wanted(motion, command, settings, wanted)
    else:
        _wanted_of_joints(motion, command, limits, settings, held, robot, wanted)
    rows, plans = np.zeros((CANDIDATES, size, coordinates)), np.zeros((CANDIDATES, PLAN))
    driven = np.zeros((CANDIDATES, points.shape[0], size, 3))
    ends, kept = np.zeros(CANDIDATES, dtype=np.int64), np.zeros(CANDIDATES, dtype=np.int64)
    tail = math.ceil(settings[TAIL] / settings[SPACING])
    state[TURN] += 1.0
    best, use, answer[TRIED] = 0, math.inf, 0.0
    block = WHOLE if follow else OTHERS
    while block <= OTHERS and not use <= 1.0:
        make_plans(state, settings, block, follow, plans, best)
        count = 0
        for one in range(CANDIDATES):
            ends[one] = candidate(
                motion, state, stop, settings, plans[one], wanted, held, first, times, rows[one]
            )
            must, known = _is_held(plans[one]), _is_known(plans[one], state)
            kept[one] = must or (
                ends[one] + tail < size
                and (joints.shape[0] == 0
                     or _allowed(motion, rows[one], ends[one], intervals, limits))
            )  # fmt: skip
            if kept[one]:
                last = 1 if known else min(ends[one], size - 1)
                within = _drive(
                    motion, rows[one], last, intervals, robot, settings, must, driven[one]
                )
                kept[one] = KNOWN if known else (JUDGED if must or within else 0)
            if kept[one] == JUDGED:
                count = max(count, min(ends[one] + tail, size))
        if kept.any():
            best, use = _chosen(
                stores, cups, driven, plans, ends, kept, times, intervals, count, settings, state,
                block, follow, told,
            )  # fmt: skip
        answer[TRIED] += 1.0
        block += 1
    state[BOUND] = use
    if plans[best, KIND] == 1.0:
        state[DURATION : DURATION + 3] = plans[best, LAW:]
    answer[SHARE] = plans[best, PART]
    for point in range(points.shape[0]):
        chosen[point] = driven[best, point, 1]
    take(motion, state, stop, settings, rows[best], ends[best])
    answer[REST] = trimmed(motion, state, stop, settings)
    for number in range(stores.shape[0]):
        cup = cups[number // MODELS]
        runs, modes = records(stores[number, : int(cup[SIZE])])
        felt = chosen[int(cup[POINT])]
        advance(runs[0], modes, felt[0], felt[1], felt[2], 0.0, UPRIGHT, settings[PERIOD])
    return 0 if use <= 1.0 else 1


@entry_point(void(GIVEN_2, GIVEN_2, CHANGED_2, CHANGED_2))
def feel(joints, points, motion, felt):  # type: ignore[no-untyped-def]
    """Computes what containers on a link feel; the arguments are those of `chain.felt_at`."""
    felt_at(joints, points, motion, felt, np.empty(3))
