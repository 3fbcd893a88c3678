"""Compiled fractions of a container's limits (height, friction, tipping) that a motion reaches.

Heights come from `governor.lane_heights`, a lane for each model and candidate. What a loosely
standing container needs of friction and of its base is computed as in
`slosh_model.standing_use`, from the displacement of the liquid's mass that the heights tell.
"""

from __future__ import annotations

import math

import numpy as np

from slosh_base.compiled.compilation import compiled, compiled_apart
from slosh_governor.core.lane_heights import add_heights
from slosh_governor.core.layout import (
    ARM_X,
    BASE,
    CENTRE,
    EXTRA,
    FRICTION,
    LIGHT,
    LIMIT,
    MASS_POINT,
    MASS_X,
    NOMINAL,
    PARTS_OF_ROW,
    PEAK,
    POINT,
    PUMP,
    PUSH,
    RESERVE,
    SIZE,
    SLIP,
    SPREAD,
    SWAY,
    TIP,
    USE,
)
from slosh_governor.core.waves import LANES
from slosh_model.constants import GRAVITY
from slosh_model.indices import GAIN, GAIN_Y
from slosh_model.kernel import constants_of, lightness, turned
from slosh_model.layout import records

BEYOND = 1.0 + 1e-9
"""Least share of a limit that a motion uses which was not looked at to its end."""
LEAST = 1e-3
"""Least specific force that presses a container on its tray [m/s²]."""


@compiled
def _displacements(store, heights, lane, felt, count, placed):  # type: ignore[no-untyped-def]
    """Computes the displacement of the first mode's mass at each sample from wall heights [m].

    In the axes of the mode.
    """
    runs, modes = records(store)
    run, constants = runs[0], constants_of(modes[0])
    by_x, by_y = 1.0 / constants[GAIN], 1.0 / constants[GAIN_Y]
    placed[0, 0], placed[0, 1] = modes[0]["x"], modes[0]["y"]
    still_x, still_y = run["static_height"], run["static_height_y"]
    for row in range(1, count):
        x, y = turned(heights[row, 0, lane], heights[row, 1, lane], run["axes"])
        if still_x != 0.0 or still_y != 0.0:
            light = lightness(run["lift"], felt[row, 2])
            ax, ay = turned(felt[row, 0], felt[row, 1], run["axes"])
            x += still_x * light * ax
            y += still_y * light * ay
        placed[row, 0], placed[row, 1] = x * by_x, y * by_y


@compiled
def _curvature(intervals, count, weights):  # type: ignore[no-untyped-def]
    """Computes finite-difference weights of the second derivative for unequal intervals."""
    for row in range(1, count - 1):
        before, behind = intervals[row - 1], intervals[row]
        weights[row, 0] = 2.0 / (before * (before + behind))
        weights[row, 2] = 2.0 / (behind * (before + behind))
        weights[row, 1] = -weights[row, 0] - weights[row, 2]


@compiled
def _pressures(felt, axes, count, pushing, pressing):  # type: ignore[no-untyped-def]
    """Computes horizontal and vertical acceleration of a container that stands on a tray.

    Args:
        felt: (rows, 3) the acceleration at the centre of mass [m/s²].
        axes: azimuth of the first mode's axes [rad].
        count: of the rows.
        pushing: (rows, 2) receives the horizontal acceleration in the axes of the mode.
        pressing: (rows, 2) receives the vertical one with gravity, and its inverse square; 0: the
            container lifts off.
    """
    for row in range(count):
        force = felt[row, 2] + GRAVITY
        pushing[row, 0], pushing[row, 1] = turned(felt[row, 0], felt[row, 1], axes)
        pressing[row, 0] = force
        pressing[row, 1] = 1.0 / (force * force) if force > LEAST else 0.0


@compiled
def _standing(cup, extra, placed, pushing, weights, pressing, count):  # type: ignore[no-untyped-def]
    """Returns the largest fractions of friction and support base that a candidate motion uses.

    An unknown wave of the height `extra` [m] may push in the worst direction at any time.
    """
    slip = tip = 0.0
    push_more, sway_more = extra * cup[PUSH], extra * cup[SWAY]
    for row in range(1, count - 1):
        force, inverse = pressing[row, 0], pressing[row, 1]
        if inverse == 0.0:
            return math.inf, math.inf
        lateral = moment = 0.0
        for k in range(2):
            q, mass, push = placed[row, k], cup[MASS_X + k], pushing[row, k]
            change = weights[row, 0] * placed[row - 1, k] + weights[row, 1] * q
            change += weights[row, 2] * placed[row + 1, k]
            slides = push + mass * change
            tips = mass * (q * force - cup[ARM_X + k] * change) - cup[CENTRE] * push
            lateral += slides * slides
            moment += tips * tips
        if extra > 0.0:
            lateral, moment = math.sqrt(lateral) + push_more, math.sqrt(moment) + sway_more
            lateral, moment = lateral * lateral, moment * moment
        slip, tip = max(slip, lateral * inverse), max(tip, moment * inverse)
    return math.sqrt(slip) / cup[FRICTION], math.sqrt(tip) / cup[BASE]


@compiled
def _refined(cup, driven, which, ends, intervals, count):  # type: ignore[no-untyped-def]
    """Divides the rows of candidate motions so that a container's fastest mode is sampled finely.

    Between two rows accelerations are linear in time.

    Returns:
        `driven`, `ends`, `intervals`, `count` of `add_uses` for the finer rows.
    """
    parts = int(cup[PARTS_OF_ROW])
    if parts == 1:
        return driven, ends, intervals, count
    size = (count - 1) * parts + 1
    finer, short = np.zeros((driven.shape[0], driven.shape[1], size, 3)), np.empty(size - 1)
    for row in range(size - 1):
        short[row] = intervals[row // parts] / parts
    for one in which:
        for point in (int(cup[POINT]), int(cup[MASS_POINT])):
            for row in range(size):
                first, share = row // parts, (row % parts) / parts
                last = min(first + 1, count - 1)
                for k in range(3):
                    a, b = driven[one, point, first, k], driven[one, point, last, k]
                    finer[one, point, row, k] = a + share * (b - a)
    return finer, (ends - 1) * parts + 1, short, size


@compiled
def _unknown(cup, felt, intervals, count):  # type: ignore[no-untyped-def]
    """Returns the largest height of an unknown wave [m] in a candidate motion.

    Vertical accelerations change its stiffness: its energy grows at most by the natural frequency
    times their share of gravity.
    """
    if cup[EXTRA] == 0.0 or cup[PUMP] == 0.0:
        return cup[EXTRA]
    pumped = 0.0
    for row in range(1, count):
        pumped += 0.5 * intervals[row - 1] * (abs(felt[row - 1, 2]) + abs(felt[row, 2]))
    return cup[EXTRA] * math.exp(cup[PUMP] * pumped)


@compiled
def _raised(values, models, settings):  # type: ignore[no-untyped-def]
    """Returns a quantity's largest value over several models, plus a margin for other models.

    Of fewer models it is never greater than of all.
    """
    highest, least = 0.0, math.inf
    for n in range(models.shape[0]):
        highest = max(highest, values[n])
        if 0 < models[n] <= LIGHT:
            least = min(least, values[n])
    spread = max(highest - least, 0.0)
    return (highest + settings[SPREAD] * spread) * (1.0 + settings[RESERVE])


@compiled_apart
def add_uses(  # type: ignore[no-untyped-def]
    stores, cup, driven, which, models, ends, intervals, count, settings, exact, uses
):
    """Stores in `uses` the fractions of a container's limits that candidate motions reach.

    Args:
        stores: (MODELS, …) of the container at this moment.
        cup: (CUP,).
        driven: (CANDIDATES, P, rows, 3) acceleration at each point.
        which: (N,) the candidates.
        models: (M,) the models; of a part of them the shares are lower bounds.
        ends: (CANDIDATES,) rows until each is at rest.
        intervals: time from a row to the next [s].
        count: of the rows that are looked at.
        settings: (SETTINGS,).
        exact: shares above it may be lower bounds, 1 or infinite.
        uses: (CANDIDATES, USES); the rows of these candidates are written.

    Returns:
        the model that uses most in the last of the candidates.
    """
    driven, ends, intervals, count = _refined(cup, driven, which, ends, intervals, count)
    lanes = models.shape[0]
    heights, highest = np.empty((count, 2, LANES)), np.zeros(which.shape[0] * lanes)
    ceiling = (exact * cup[LIMIT] - cup[EXTRA]) / (1.0 + settings[RESERVE])
    done = add_heights(
        stores, cup, driven, which, models, ends, intervals, count, max(ceiling, 0.0), heights,
        highest,
    )  # fmt: skip
    exceeded = BEYOND if done < count else 0.0
    count = done
    axes, loose = records(stores[0, : int(cup[SIZE])])[0][0]["axes"], cup[FRICTION] > 0.0
    tops, slips, tips = np.zeros(lanes), np.zeros(lanes), np.zeros(lanes)
    placed, pushing = np.empty((count, 2)), np.empty((count, 2))
    pressing, weights = np.empty((count, 2)), np.empty((count, 3))
    if loose:
        _curvature(intervals, count, weights)
    worst = 0
    for one in range(which.shape[0]):
        candidate, most = which[one], -1.0
        found, pressed = uses[candidate], driven[candidate, int(cup[MASS_POINT])]
        for n in range(lanes):
            tops[n] = highest[one * lanes + n]
        extra = _unknown(cup, driven[candidate, int(cup[POINT])], intervals, count)
        found[PEAK], found[NOMINAL] = _raised(tops, models, settings) + extra, tops[0]
        found[USE] = max(found[PEAK] / cup[LIMIT], exceeded)
        stands = loose and found[USE] <= exact
        if stands:
            _pressures(pressed, axes, count, pushing, pressing)
        for n in range(lanes):
            share = tops[n] / cup[LIMIT]
            if stands:
                store = stores[models[n], : int(cup[SIZE])]
                felt = driven[candidate, int(cup[POINT])]
                _displacements(store, heights, one * lanes + n, felt, count, placed)
                slips[n], tips[n] = _standing(
                    cup, extra, placed, pushing, weights, pressing, count
                )
                share = max(share, max(slips[n], tips[n]))
            if share > most:
                worst, most = models[n], share
        if stands:
            found[SLIP] = _raised(slips, models, settings)
            found[TIP] = _raised(tips, models, settings)
            found[USE] = max(found[USE], max(found[SLIP], found[TIP]))
    return worst
