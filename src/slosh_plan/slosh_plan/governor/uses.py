"""Compiled fractions of a container's limits (height, friction, tipping) that a motion reaches.

Heights come from `slosh_model.batch_kernel`, a lane for each model and candidate. What a loosely
standing container needs of friction and of its base is computed as in
`slosh_model.standing_use`, from the displacement of the liquid's mass that the heights tell.
"""

from __future__ import annotations

import math

import numpy as np

from slosh_base.compiled.compilation import compiled, compiled_apart
from slosh_model.batch_kernel import advance_lanes
from slosh_model.constants import GRAVITY
from slosh_model.indices import GAIN, GAIN_Y, POSE_COUNT
from slosh_model.kernel import constants_of, highest_on_wall, lightness, turned
from slosh_model.layout import records
from slosh_plan.governor.layout import (
    ARM_X,
    BASE,
    CENTRE,
    DRIVEN,
    EXTRA,
    FRICTION,
    LIGHT,
    LIMIT,
    MASS_POINT,
    MASS_X,
    MODULATED,
    NOMINAL,
    PEAK,
    POINT,
    RESERVE,
    SIZE,
    SLIP,
    SPREAD,
    STEPS,
    TIP,
    USE,
)

BEYOND = 1.0 + 1e-9
"""Least share of a limit that a motion uses which was not looked at to its end."""
LEAST = 1e-3
"""Least specific force that presses a container on its tray [m/s²]."""


@compiled
def _simulated(  # type: ignore[no-untyped-def]
    stores, cup, driven, which, models, intervals, count, ceiling, heights
):
    """Simulates the wall heights of several models in several candidate motions.

    Returns:
        for how many rows: fewer than `count` after a height beyond the ceiling [m].
    """
    lanes, size = which.shape[0] * models.shape[0], int(cup[SIZE])
    copies = np.empty((lanes, size))
    rows = np.empty(lanes, dtype=np.int64)
    for lane in range(lanes):
        for k in range(size):
            copies[lane, k] = stores[models[lane % models.shape[0]], k]
        rows[lane] = lane // models.shape[0]
    inputs = np.empty((which.shape[0], count, 3))
    for one in range(which.shape[0]):
        for row in range(count):
            inputs[one, row] = driven[which[one], int(cup[POINT]), row]
    counts = np.full(count - 1, int(cup[STEPS]))
    return advance_lanes(
        copies, counts, np.zeros(lanes, dtype=np.int64), rows,
        intervals[: count - 1].copy().reshape(1, count - 1), inputs,
        np.empty((0, count)), np.empty((0, count, POSE_COUNT)), cup[DRIVEN] != 0.0,
        cup[MODULATED] != 0.0, heights, ceiling,
    )  # fmt: skip


@compiled
def _at_any_phase(run, x, y):  # type: ignore[no-untyped-def]
    """Returns the largest wall height [m] of waves along x and y whose phases are unknown.

    Args:
        run: the container's record of `layout.RUN`.
        x, y: their amplitudes in the axes of the modes [m].
    """
    if run["corner_count"] == 0.0:  # alike in all quadrants
        return highest_on_wall(run, x, y)
    best = 0.0
    for along, across in ((x, y), (x, -y), (-x, y), (-x, -y)):
        height_x, height_y = turned(along, across, -run["axes"])
        best = max(best, highest_on_wall(run, height_x, height_y))
    return best


@compiled
def _highest(heights, count, end, run, mode):  # type: ignore[no-untyped-def]
    """Returns the largest wall height [m] of one simulation; inf if a height is unknown.

    After a stop waves along two axes with different frequencies may meet with their crests at any
    time: the highest of both add.
    """
    beating = run["cornered"] != 0.0 or mode["frequency_ratio"] != 1.0 or mode["along_x"] != 0.0
    top = last_x = last_y = 0.0
    if not beating and run["corner_count"] == 0.0:
        for row in range(1, count):
            square = heights[row, 0] * heights[row, 0] + heights[row, 1] * heights[row, 1]
            top = max(top, square) if square == square else math.inf
        return math.sqrt(top)
    for row in range(1, count):
        x, y = heights[row, 0], heights[row, 1]
        if x != x or y != y:
            return math.inf
        if beating and row >= end - 1:
            x, y = turned(x, y, run["axes"])
            last_x, last_y = max(last_x, abs(x)), max(last_y, abs(y))
            top = max(top, _at_any_phase(run, last_x, last_y))
        else:
            top = max(top, highest_on_wall(run, x, y))
    return top


@compiled
def _displacements(store, heights, felt, count, placed):  # type: ignore[no-untyped-def]
    """Computes the displacement of the first mode's mass at each sample from the wall heights.

    In the axes of the mode.
    """
    runs, modes = records(store)
    run, constants = runs[0], constants_of(modes[0])
    by_x, by_y = 1.0 / constants[GAIN], 1.0 / constants[GAIN_Y]
    placed[0, 0], placed[0, 1] = modes[0]["x"], modes[0]["y"]
    still_x, still_y = run["static_height"], run["static_height_y"]
    for row in range(1, count):
        x, y = turned(heights[row, 0], heights[row, 1], run["axes"])
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
def _standing(cup, placed, pushing, weights, pressing, count):  # type: ignore[no-untyped-def]
    """Returns the largest fractions of friction and support base that a motion uses."""
    slip = tip = 0.0
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
        slip, tip = max(slip, lateral * inverse), max(tip, moment * inverse)
    return math.sqrt(slip) / cup[FRICTION], math.sqrt(tip) / cup[BASE]


@compiled
def _raised(values, models, settings):  # type: ignore[no-untyped-def]
    """Returns the largest value of several models, with a margin for models between them.

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
    stores, cup, driven, which, models, ends, intervals, count, settings, whole, uses
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
        whole: whether shares are wanted if they exceed a limit; else they are lower bounds then.
        uses: (CANDIDATES, USES); the rows of these candidates are written.

    Returns:
        the model that uses most in the last of the candidates.
    """
    lanes = models.shape[0]
    heights = np.empty((which.shape[0] * lanes, count, 2))
    ceiling = math.inf if whole else cup[LIMIT]
    done = _simulated(stores, cup, driven, which, models, intervals, count, ceiling, heights)
    exceeded = BEYOND if done < count else 0.0
    count = done
    runs, modes = records(stores[0, : int(cup[SIZE])])
    loose = cup[FRICTION] > 0.0
    tops, slips, tips = np.zeros(lanes), np.zeros(lanes), np.zeros(lanes)
    placed, pushing = np.empty((count, 2)), np.empty((count, 2))
    pressing, weights = np.empty((count, 2)), np.empty((count, 3))
    if loose:
        _curvature(intervals, count, weights)
    worst = 0
    for one in range(which.shape[0]):
        candidate, most = which[one], -1.0
        pressed = driven[candidate, int(cup[MASS_POINT])]
        if loose:
            _pressures(pressed, runs[0]["axes"], count, pushing, pressing)
        for n in range(lanes):
            lane = heights[one * lanes + n]
            tops[n] = _highest(lane, count, ends[candidate], runs[0], modes[0])
            if loose:
                store = stores[models[n], : int(cup[SIZE])]
                _displacements(store, lane, driven[candidate, int(cup[POINT])], count, placed)
                slips[n], tips[n] = _standing(cup, placed, pushing, weights, pressing, count)
            share = max(tops[n] / cup[LIMIT], max(slips[n], tips[n]))
            if share > most:
                worst, most = models[n], share
        found = uses[candidate]
        found[PEAK], found[NOMINAL] = _raised(tops, models, settings) + cup[EXTRA], tops[0]
        found[USE] = max(found[PEAK] / cup[LIMIT], exceeded)
        if loose:
            found[SLIP] = _raised(slips, models, settings)
            found[TIP] = _raised(tips, models, settings)
            found[USE] = max(found[USE], max(found[SLIP], found[TIP]))
    return worst
