"""Computes heights and standard deviations from the observer's state."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.compiled.compilation import compiled
from slosh_estimator.observer.layout import (
    AZIMUTH,
    DAMPING,
    FREQUENCY,
    GAIN,
    HEIGHT_X,
    HEIGHT_Y,
    MSH,
    NOISE,
    PHI,
    SENSITIVITY,
    SH_X,
    SH_Y,
    STATE,
    STDDEV,
    STDDEV_X,
    STDDEV_Y,
    TURN,
)
from slosh_model import kernel
from slosh_model.layout import records
from slosh_model.outline_wall import place_at_corners


@compiled
def _rows(blocks, heights, size):  # type: ignore[no-untyped-def]
    """Returns the matrix (2, size) from filter state to heights at +x and +y, and their noise."""
    rows, noise = np.zeros((2, size)), np.zeros(2)
    states = 2 * blocks.shape[0]
    for k in range(blocks.shape[0]):
        block, axis = blocks[k], k % 2
        gain = block[GAIN]
        rows[axis, 2 * k] = gain * block[PHI]
        rows[axis, 2 * k + 1] = gain * block[PHI + 1]
        rows[axis, states + FREQUENCY] += gain * block[SENSITIVITY]
        rows[axis, states + DAMPING] += gain * block[SENSITIVITY + 1]
        noise[axis] += gain * gain * block[NOISE]
    for axis in range(2):  # the gain follows ω'², so that a constant tilt stays the same
        rows[axis, states + FREQUENCY] += 2.0 * heights[axis]
    return rows, noise


@compiled
def product(one, matrix, other):  # type: ignore[no-untyped-def]
    """Returns the product aᵀ M b of vectors and a matrix; `a` is mostly zeros."""
    total = 0.0
    for i in range(one.shape[0]):
        if one[i] != 0.0:
            part = 0.0
            for j in range(other.shape[0]):
                part += matrix[i, j] * other[j]
            total += one[i] * part
    return total


@compiled
def answered(store, blocks, covariance, row, out):  # type: ignore[no-untyped-def]
    """Computes heights and standard deviations of the fused state at a stored input."""
    runs, modes = records(store)
    hx, hy = kernel.turned(row[HEIGHT_X], row[HEIGHT_Y], row[TURN])
    rows, noise = _rows(blocks, (row[HEIGHT_X], row[HEIGHT_Y]), covariance.shape[0])
    xx = product(rows[0], covariance, rows[0]) + noise[0]
    yy = product(rows[1], covariance, rows[1]) + noise[1]
    xy = product(rows[0], covariance, rows[1])
    c, s = math.cos(row[TURN]), math.sin(row[TURN])
    vx = c * c * xx + 2.0 * c * s * xy + s * s * yy
    vy = s * s * xx - 2.0 * c * s * xy + c * c * yy
    vxy = c * s * (yy - xx) + (c * c - s * s) * xy
    out[SH_X], out[SH_Y] = hx, hy
    out[MSH], out[AZIMUTH] = kernel.highest_and_azimuth(runs[0], modes[0], hx, hy)
    count = int(runs[0]["corner_count"])
    if count > 0:
        c, s = place_at_corners(
            out[AZIMUTH], runs[0]["corners"], count, modes[0]["radius"], modes[0]["radius_y"]
        )
    elif runs[0]["cornered"] != 0.0:
        c, s = math.copysign(1.0, hx), math.copysign(1.0, hy)
    else:
        c, s = math.cos(out[AZIMUTH]), math.sin(out[AZIMUTH])
    out[STDDEV_X], out[STDDEV_Y] = math.sqrt(max(vx, 0.0)), math.sqrt(max(vy, 0.0))
    highest = c * c * vx + 2.0 * c * s * vxy + s * s * vy
    out[STDDEV] = math.sqrt(max(highest, 0.0))
    for n in range(modes.shape[0]):
        mode, at = modes[n], STATE + 4 * n
        out[at], out[at + 1], out[at + 2], out[at + 3] = (
            mode["x"], mode["y"], mode["vx"], mode["vy"],
        )  # fmt: skip
