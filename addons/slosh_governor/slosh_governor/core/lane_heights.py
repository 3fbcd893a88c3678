"""Compiled wall heights of a container, one vector lane per pair of model and motion."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.compiled.compilation import compiled
from slosh_governor.core.layout import (
    DRIVEN,
    MODULATED,
    POINT,
    SIZE,
    WAVE,
)
from slosh_governor.core.waves import (
    LANES,
    OTHER,
    PENDULUM,
    STEEP,
    STEEPEST,
    TOP,
    VX,
    VY,
    WORK,
    X,
    Y,
    begin_waves,
    simulate_waves,
)
from slosh_model.batch_kernel import advance_lanes
from slosh_model.indices import POSE_COUNT
from slosh_model.kernel import highest_on_wall, turned
from slosh_model.layout import records


@compiled
def _of_any_model(  # type: ignore[no-untyped-def]
    stores, cup, driven, which, models, intervals, count, ceiling, heights
):
    """Simulates wall heights of models of every kind; arguments as in `add_heights`."""
    lanes, size = which.shape[0] * models.shape[0], int(cup[SIZE])
    copies, found = np.empty((lanes, size)), np.empty((lanes, count, 2))
    rows = np.empty(lanes, dtype=np.int64)
    for lane in range(lanes):
        for k in range(size):
            copies[lane, k] = stores[models[lane % models.shape[0]], k]
        rows[lane] = lane // models.shape[0]
    inputs = np.empty((which.shape[0], count, 3))
    for one in range(which.shape[0]):
        for row in range(count):
            inputs[one, row] = driven[which[one], int(cup[POINT]), row]
    done = advance_lanes(
        copies, np.ones(count - 1, dtype=np.int64), np.zeros(lanes, dtype=np.int64), rows,
        intervals[: count - 1].copy().reshape(1, count - 1), inputs,
        np.empty((0, count)), np.empty((0, count, POSE_COUNT)), cup[DRIVEN] != 0.0,
        cup[MODULATED] != 0.0, found, ceiling,
    )  # fmt: skip
    for lane in range(lanes):
        for row in range(1, done):
            heights[row, 0, lane], heights[row, 1, lane] = found[lane, row]
    return done


@compiled
def _of_waves(  # type: ignore[no-untyped-def]
    stores, cup, driven, which, models, ends, intervals, count, ceiling, heights, tops
):
    """Simulates wall heights of models whose only effect is waves, in vectors; see `waves`.

    Returns:
        for how many rows; 0: a pendulum swings further than can be simulated so.
    """
    pendulum, w = cup[WAVE] == PENDULUM, np.zeros(WORK)
    inputs, point = np.empty((count, 3, LANES)), int(cup[POINT])
    begin_waves(stores, int(cup[SIZE]), which, models, ends, pendulum, w)
    for lane in range(LANES):
        used = lane if lane < which.shape[0] * models.shape[0] else 0
        felt = driven[which[used // models.shape[0]], point]
        for row in range(count):
            for axis in range(3):
                inputs[row, axis, lane] = felt[row, axis]
    done = simulate_waves(w, inputs, intervals, count, pendulum, ceiling, heights)
    for lane in range(tops.shape[0]):
        known = w[X + lane] + w[Y + lane] + w[VX + lane] + w[VY + lane]
        if pendulum and not (known == known and w[STEEP + lane] <= STEEPEST * STEEPEST):
            return 0
        top = w[TOP + lane]
        tops[lane] = top if pendulum else math.sqrt(top)
        if known != known:
            tops[lane] = math.inf
    return done


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
def _highest(heights, lane, count, end, run, mode):  # type: ignore[no-untyped-def]
    """Returns the largest wall height [m] of one simulation; inf if a height is unknown.

    After a stop waves along two axes with different frequencies may meet with their crests at any
    time: the highest of both add.
    """
    beating = run["cornered"] != 0.0 or mode["frequency_ratio"] != 1.0 or mode["along_x"] != 0.0
    top = last_x = last_y = 0.0
    if not beating and run["corner_count"] == 0.0:
        for row in range(1, count):
            x, y = heights[row, 0, lane], heights[row, 1, lane]
            square = x * x + y * y
            top = max(top, square) if square == square else math.inf
        return math.sqrt(top)
    for row in range(1, count):
        x, y = heights[row, 0, lane], heights[row, 1, lane]
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
def add_heights(  # type: ignore[no-untyped-def]
    stores, cup, driven, which, models, ends, intervals, count, ceiling, heights, tops
):
    """Simulates wall heights of a container's models in several candidate motions.

    Args:
        stores, cup, driven, which, models, ends, intervals, count: see `uses.add_uses`.
        ceiling: a greater height may end it [m].
        heights: (count, 2, LANES) receives the heights but for the first row [m].
        tops: (N M,) receives the greatest height on the wall of each lane [m].

    Returns:
        for how many rows: fewer than `count` after a height beyond the ceiling.
    """
    done = 0
    if cup[WAVE] != OTHER:
        done = _of_waves(
            stores, cup, driven, which, models, ends, intervals, count, ceiling, heights, tops
        )
    if done > 0:
        return done
    done = _of_any_model(stores, cup, driven, which, models, intervals, count, ceiling, heights)
    runs, modes = records(stores[0, : int(cup[SIZE])])
    for lane in range(tops.shape[0]):
        end = ends[which[lane // models.shape[0]]]
        tops[lane] = _highest(heights, lane, done, end, runs[0], modes[0])
    return done
