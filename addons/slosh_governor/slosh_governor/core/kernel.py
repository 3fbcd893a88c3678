"""Compiled step of the governor: the largest share of a command after which a stop is safe.

The governor holds a *stop* that brings the container to rest within all limits, in every model of
every container; see `stops`. The next acceleration is a mixture of the stop's and of the
command's. It is taken if a stop from there is found. With the share 0 the stop that is held goes
on: there is always an answer.

Few models of the container that was nearest to its limits tell which candidates are surely unsafe;
the best of the others is verified by all models of all containers.
"""

from __future__ import annotations

import math

import numpy as np
from numba.types import boolean, int64

from slosh_base.compiled.compilation import (
    CHANGED_1,
    CHANGED_2,
    GIVEN_1,
    GIVEN_2,
    compiled,
    compiled_apart,
    entry_point,
)
from slosh_governor.core.carried import carry_on, eased, joints_keep, part
from slosh_governor.core.layout import (
    BOUND,
    CANDIDATES,
    DURATION,
    ENOUGH,
    HASTE,
    HEAVIEST,
    HELD,
    KIND,
    LAW,
    MODELS,
    ORDER,
    OTHERS,
    PART,
    PARTS,
    PERIOD,
    PLAN,
    REST,
    SHARE,
    SPACING,
    TAIL,
    TRIED,
    TURN,
    USE,
    USES,
    WHOLE,
    WORST,
)
from slosh_governor.core.liquids import advance_all
from slosh_governor.core.moving import drive, keeps_limits, wanted_by_axes, wanted_of_joints
from slosh_governor.core.stops import candidate, grid, make_plans, next_held, take, trimmed
from slosh_governor.core.uses import BEYOND, add_uses

JUDGED, KNOWN = 1, 2
"""Candidates that are simulated, and what is left of a stop that was."""
VERIFIED = 2
"""So many candidates of a block are simulated with all models."""


@compiled
def _best(uses, kept, rests, settings, follow):  # type: ignore[no-untyped-def]
    """Returns the index of the best candidate motion: safe and quick, or else nearest to safe.

    Of safe ones the quickest in a stop; else height and duration count, so that the next steps
    have a choice.
    """
    best, best_score, best_safe = -1, math.inf, False
    for one in range(uses.shape[0]):
        if not kept[one]:
            continue
        safe = uses[one] <= 1.0
        score = uses[one]
        if safe:
            enough = settings[ENOUGH] if follow else 1.0
            score = max(score, enough) + settings[HASTE] * rests[one]
        if best < 0 or (safe and not best_safe) or (safe == best_safe and score < best_score):
            best, best_score, best_safe = one, score, safe
    return max(best, 0)


@compiled
def _is_held(plan):  # type: ignore[no-untyped-def]
    """Whether a candidate motion is the stored safe stop, without a share of the command."""
    return plan[KIND] == 0.0 and plan[PART] == 0.0


@compiled
def _is_known(plan, state):  # type: ignore[no-untyped-def]
    """Whether a candidate motion is the stored safe stop, verified and so not simulated again."""
    return _is_held(plan) and state[BOUND] <= 1.0


@compiled
def _tail(settings):  # type: ignore[no-untyped-def]
    """Returns how many samples are simulated after the end of a stop."""
    return math.ceil(settings[TAIL] / settings[SPACING])


@compiled_apart
def _prepared(one, plan, begun, moves, rows):  # type: ignore[no-untyped-def]
    """Computes a candidate's motion and the containers' accelerations; checks the motion limits.

    Args:
        one: the candidate.
        plan: (PLAN,) of it.
        begun: the motion at this moment, the governor's state and stop, settings, limits, robot,
            the next accelerations by command and by stop, the stop's row that is row 2, and
            the carrier of `carried.joints_keep`.
        moves: see `_best_of_all`; the candidate's part is written.
        rows: (R, D) receives its accelerations.

    Returns:
        0: it exceeds a limit of the motion; JUDGED: it is to be simulated; KNOWN.
    """
    motion, state, stop, settings, limits, robot, wanted, held, first, _ = begun
    _, driven, ends, intervals, times = moves
    size = times.shape[0]
    end = candidate(motion, state, stop, settings, plan, wanted, held, first, times, rows)
    ends[one] = end
    must, known = _is_held(plan), _is_known(plan, state)
    if not must:
        kept = end + _tail(settings) < size
        if robot[0].shape[0] > 0:
            kept = kept and keeps_limits(motion, rows, end, intervals, limits)
        if not kept:
            return 0
    last = 1 if known else min(end, size - 1)
    within = drive(motion, rows, last, intervals, robot, settings, must, driven[one])
    if known:
        return KNOWN
    return JUDGED if must or within else 0


@compiled
def _to_front(row, value):  # type: ignore[no-untyped-def]
    """Moves a value to the front of a row; if absent, it replaces the row's last value."""
    place = 0
    while place < row.shape[0] - 1 and row[place] != value:
        place += 1
    for k in range(place, 0, -1):
        row[k] = row[k - 1]
    row[0] = value


@compiled
def _carried(one, plan, begun, moves, rows):  # type: ignore[no-untyped-def]
    """Whether the joints that carry the container keep their limits in a candidate motion.

    They do in what is left of the held stop.
    """
    return _is_held(plan) or joints_keep(begun[0], rows, moves[2][one], moves[3], begun[9])


@compiled_apart
def _verified(one, begun, moves, cups, ranks, exact, told):  # type: ignore[no-untyped-def]
    """Simulates a candidate motion with all models; returns the largest fraction of a limit.

    Containers that were nearest to their limits are looked at first; the first that exceeds one
    ends it.

    Args:
        one: the candidate.
        begun: see `_prepared`.
        moves: see `_best_of_all`.
        cups: see `govern`.
        ranks: (C, RANKS); changed.
        exact: greater shares may be lower bounds.
        told: (C, USES) receives the uses; NaN: not looked at.
    """
    stores, driven, ends, intervals, _ = moves
    settings = begun[3]
    which, models = np.array([one]), np.arange(MODELS)
    count = min(ends[one] + _tail(settings), intervals.shape[0])
    own, order = np.full((CANDIDATES, USES), math.nan), ranks[:, ORDER].copy()
    told[:] = math.nan
    most, critical = -1.0, order[0]
    for cup in order:
        part = stores[cup * MODELS : (cup + 1) * MODELS]
        model = add_uses(
            part, cups[cup], driven, which, models, ends, intervals, count, settings, exact, own
        )
        _to_front(ranks[cup, WORST:], model)
        told[cup] = own[one]
        if not own[one, USE] <= most:
            most, critical = own[one, USE], cup
        if not most <= 1.0:
            break
    _to_front(ranks[:, ORDER], critical)
    return most


@compiled
def _screened(moves, kept, cups, settings, bound, ranks, shares):  # type: ignore[no-untyped-def]
    """Stores in `shares` a lower bound of each candidate motion's largest fraction of a limit."""
    stores, driven, ends, intervals, _ = moves
    which = np.flatnonzero(kept == JUDGED)
    own = np.full((CANDIDATES, USES), math.inf)
    if which.shape[0] > 0:
        cup, count = ranks[0, ORDER], min(ends[which].max() + _tail(settings), intervals.shape[0])
        part = stores[cup * MODELS : (cup + 1) * MODELS]
        models = ranks[cup, WORST:].copy()
        add_uses(
            part, cups[cup], driven, which, models, ends, intervals, count, settings, math.inf, own
        )
    for one in range(CANDIDATES):
        shares[one] = bound if kept[one] == KNOWN else own[one, USE]


@compiled
def _best_part(plans, begun, moves, rows, cups, ranks, told):  # type: ignore[no-untyped-def]
    """Bisects for the largest safe share of the command; returns candidate index and limit use.

    The last candidate is the held stop. What is not looked at is taken to be as its neighbours.
    """
    trial = told.copy()
    best, use, above, below = HELD, math.inf, -1, HELD
    while above + 1 < below:
        one = (above + below) // 2
        found = math.inf
        judged = _prepared(one, plans[one], begun, moves, rows[one]) == JUDGED
        if judged and _carried(one, plans[one], begun, moves, rows[one]):
            found = _verified(one, begun, moves, cups, ranks, 1.0, trial)
        if found <= 1.0:
            best, use, below = one, found, one
            told[:] = trial
        else:
            above = one
    if best == HELD:
        told[:] = math.nan
        known = _prepared(HELD, plans[HELD], begun, moves, rows[HELD]) == KNOWN
        use = begun[1][BOUND]
        if not known:
            use = _verified(best, begun, moves, cups, ranks, math.inf, told)
    return best, use


@compiled
def _best_of_all(plans, begun, moves, rows, kept, cups, ranks, follow, last, told):  # type: ignore[no-untyped-def]
    """Returns the best candidate motion's index, and the largest fraction of a limit it reaches.

    Few models tell which are surely unsafe; the best of the others are verified by all models.

    Args:
        plans: (CANDIDATES, PLAN).
        begun: see `_prepared`.
        moves: all models, what drives containers in each candidate, its rows until it is at rest,
            and the intervals and times of rows.
        rows: (CANDIDATES, R, D) accelerations.
        kept: (CANDIDATES,) what `_prepared` returns; changed.
        cups: see `govern`.
        ranks: (C, RANKS); changed.
        follow: whether the command counts.
        last: whether no other candidates follow: then something is told in any case.
        told: (C, USES) receives what the best one uses.
    """
    shares, rests, settings = np.empty(CANDIDATES), moves[4][moves[2] - 1], begun[3]
    _screened(moves, kept, cups, settings, begun[1][BOUND], ranks, shares)
    best = _best(shares, kept, rests, settings, follow)
    for _ in range(VERIFIED):
        if kept[best] != JUDGED or not shares[best] <= 1.0:
            break
        if _carried(best, plans[best], begun, moves, rows[best]):
            shares[best] = _verified(best, begun, moves, cups, ranks, 1.0, told)
            if shares[best] <= 1.0:
                return best, shares[best]
        else:
            kept[best], shares[best] = 0, math.inf
        best = _best(shares, kept, rests, settings, follow)
    for one in range(CANDIDATES):
        if kept[one] == JUDGED:
            shares[one] = max(shares[one], BEYOND)
    best = _best(shares, kept, rests, settings, follow)
    while last and kept[best] == JUDGED:
        if _carried(best, plans[best], begun, moves, rows[best]):
            break
        kept[best], shares[best] = 0, math.inf
        best = _best(shares, kept, rests, settings, follow)
    told[:] = math.nan
    if last and kept[best] == JUDGED:
        shares[best] = _verified(best, begun, moves, cups, ranks, math.inf, told)
    return best, shares[best]


@entry_point(
    int64(
        CHANGED_2, CHANGED_2, CHANGED_2, CHANGED_1, GIVEN_1, boolean, GIVEN_1, GIVEN_2, GIVEN_2,
        GIVEN_2, GIVEN_2, GIVEN_2, GIVEN_2, GIVEN_1, CHANGED_2, CHANGED_1, int64[:, ::1],
        CHANGED_2, CHANGED_2, CHANGED_1,
    )
)  # fmt: skip
def govern(  # type: ignore[no-untyped-def]
    stores, stop, motion, state, command, follow, settings, limits, cups, joints, points,
    links, ranges, goal, carrying, refused, ranks, chosen, told, answer,
):  # fmt: skip
    """Computes one step of the governor: advances motion and models by one period.

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
        links, ranges, goal, carrying, refused: joints that carry a container that is governed by
            x, y, z; see `carried.joints_keep`; the last two are changed.
        ranks: (C, RANKS); changed.
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
    carrier = (links, ranges, goal, carrying, refused)
    refused[:HEAVIEST] = 0.0
    next_held(motion, state, stop, settings, held)
    if joints.shape[0] == 0:
        wanted_by_axes(motion, eased(motion, command, carrier), settings, wanted)
        part(motion, held, settings, carrier, wanted)
    else:
        wanted_of_joints(motion, command, limits, settings, held, robot, wanted)
    rows, plans = np.zeros((CANDIDATES, size, coordinates)), np.zeros((CANDIDATES, PLAN))
    driven = np.zeros((CANDIDATES, points.shape[0], size, 3))
    ends, kept = np.ones(CANDIDATES, dtype=np.int64), np.zeros(CANDIDATES, dtype=np.int64)
    moves = (stores, driven, ends, intervals, times)
    begun = (motion, state, stop, settings, limits, robot, wanted, held, first, carrier)
    state[TURN] += 1.0
    best, use, answer[TRIED] = 0, math.inf, 0.0
    block = WHOLE if follow else OTHERS
    while block <= OTHERS and not use <= 1.0:
        make_plans(state, settings, block, follow, plans, best)
        if block == PARTS:
            best, use = _best_part(plans, begun, moves, rows, cups, ranks, told)
        else:
            for one in range(CANDIDATES):
                kept[one] = _prepared(one, plans[one], begun, moves, rows[one])
            best, use = _best_of_all(
                plans, begun, moves, rows, kept, cups, ranks, follow, block == OTHERS, told
            )
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
    carry_on(motion, settings[PERIOD], carrier)
    advance_all(stores, cups, chosen, settings[PERIOD])
    return 0 if use <= 1.0 else 1
