"""Corrects the observer's state by a measurement: scalar Kalman updates."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.compiled.compilation import compiled
from slosh_estimator.observer.layout import (
    ALIKE,
    CLOCK,
    COMMON,
    DAMPING,
    FORM,
    FREQUENCY,
    GAIN,
    GATE,
    HEIGHT_X,
    HEIGHT_Y,
    LEVEL,
    MODES,
    MOST_DAMPING,
    MOST_FREQUENCY,
    PHI,
    RELATIVE,
    SENSITIVITY,
    TIME,
    TURN,
)
from slosh_estimator.observer.propagation import propagated
from slosh_model import kernel
from slosh_model.layout import records
from slosh_model.outline_wall import azimuth_at_corners


@compiled
def _update(mean, covariance, rows, innovations, variances):  # type: ignore[no-untyped-def]
    """Performs scalar Kalman updates in place; returns the normalised innovation.

    `mean` begins with zeros; `variances` are those of independent errors.
    """
    total, size = 0.0, mean.shape[0]
    spread = np.zeros(size)
    for i in range(innovations.shape[0]):
        row = rows[i]
        residual, variance = innovations[i], variances[i]
        for j in range(size):
            residual -= row[j] * mean[j]
            spread[j] = 0.0
            for k in range(size):
                spread[j] += covariance[j, k] * row[k]
        for j in range(size):
            variance += row[j] * spread[j]
        total += residual * residual / variance
        for j in range(size):
            mean[j] += spread[j] / variance * residual
            for k in range(size):
                covariance[j, k] -= spread[j] * spread[k] / variance
    return total


@compiled
def _widened(covariance, variance):  # type: ignore[no-untyped-def]
    """Extends a covariance by one independent state with a given variance."""
    size = covariance.shape[0]
    wide = np.zeros((size + 1, size + 1))
    wide[:size, :size] = covariance
    wide[size, size] = variance
    return wide


@compiled
def _tested(covariance, rows, innovations, variances, shared, gate):  # type: ignore[no-untyped-def]
    """Returns a measurement's normalised innovation as a multiple of the acceptance limit."""
    count = innovations.shape[0]
    wide = _widened(covariance, shared)
    total = _update(np.zeros(wide.shape[0]), wide, rows, innovations, variances)
    # Wilson and Hilferty: about the same quantile of χ² for every count.
    part = 2.0 / (9.0 * count)
    limit = count * (1.0 - part + gate * math.sqrt(part)) ** 3
    return total / limit if total == total else math.inf


@compiled
def measured(  # type: ignore[no-untyped-def]
    blocks,
    covariance,
    noise,
    heights,
    rates,
    turn,
    cornered,
    reaches,
    corners,
    theta,
    elapsed,
    points,
    mean,
):
    """Updates the covariance by a measurement and computes the correction of the state.

    Args:
        elapsed: since the measurement before [s]: errors of images that follow each other closely
            are alike.

    Returns:
        the normalised innovation over its limit; nothing is changed where it exceeds 1.
    """
    count, states, size = points.shape[0], 2 * blocks.shape[0], covariance.shape[0]
    hx, hy = kernel.turned(heights[0], heights[1], turn)
    ux, uy = kernel.turned(rates[0], rates[1], turn)
    wave = math.hypot(hx, hy)
    # One more state: the error that all points of a measurement share.
    rows, innovations = np.zeros((count, size + 1)), np.zeros(count)
    variances = np.zeros(count)
    shared = 0.0
    for i in range(count):
        azimuth, height, stddev = points[i, 0], points[i, 1], points[i, 2]
        if azimuth != azimuth:  # the maximum, wherever it is
            azimuth = math.atan2(hy, hx)
            if corners.shape[0] > 0:
                azimuth = azimuth_at_corners(
                    corners, corners.shape[0], hx, hy, reaches[0], reaches[1]
                )
        c, s = kernel.wall_place(azimuth, cornered, reaches, corners)
        cx, cy = kernel.turned(c, s, -turn)
        for k in range(blocks.shape[0]):
            rows[i, 2 * k] = (cx if k % 2 == 0 else cy) * blocks[k, GAIN]
        expected, rate = c * hx + s * hy, c * ux + s * uy
        rows[i, states + FREQUENCY] = 2.0 * expected
        rows[i, states + LEVEL] = rows[i, size] = 1.0
        rows[i, states + CLOCK] = -rate
        innovations[i] = height - expected - theta[LEVEL] + theta[CLOCK] * rate
        # Crests are higher and troughs flatter: both errors are upwards.
        form = noise[FORM] * height * height / reaches[0]
        shared += (noise[COMMON] * stddev * stddev + form * form) / count
        relative = noise[RELATIVE] * wave
        variances[i] = (1.0 - noise[COMMON]) * stddev * stddev + form * form + relative * relative
    ratio = _tested(covariance, rows, innovations, variances, shared, noise[GATE])
    if not ratio <= 1.0:
        return ratio
    alike = max(noise[ALIKE] / elapsed, 1.0) if elapsed > 0.0 else 1.0
    wide, whole = _widened(covariance, alike * shared), np.zeros(size + 1)
    for i in range(count):
        variances[i] *= alike
    _update(whole, wide, rows, innovations, variances)
    covariance[:, :] = wide[:size, :size]
    mean[:] = whole[:size]
    return ratio


@compiled
def _corrected(blocks, mean, row):  # type: ignore[no-untyped-def]
    """Applies a correction, made at the reference time, to a state stored later."""
    states = 2 * blocks.shape[0]
    by_gain = 2.0 * mean[states + FREQUENCY]
    row[HEIGHT_X] *= 1.0 + by_gain
    row[HEIGHT_Y] *= 1.0 + by_gain
    for k in range(blocks.shape[0]):
        block = blocks[k]
        moves = np.zeros(2)
        for i in range(2):
            for j in range(2):
                moves[i] += block[PHI + 2 * i + j] * mean[2 * k + j]
                moves[i] += block[SENSITIVITY + 2 * i + j] * mean[states + j]
        row[MODES + 2 * k] += moves[0]
        row[MODES + 2 * k + 1] += moves[1]
        row[HEIGHT_X + k % 2] += block[GAIN] * moves[0]


@compiled
def expected_heights(blocks, one, two, moment):  # type: ignore[no-untyped-def]
    """Interpolates modal heights, their rates and the axes' angle between two stored rows."""
    whole = two[TIME] - one[TIME]
    share = (moment - one[TIME]) / whole if whole > 0.0 else 0.0
    heights = (
        one[HEIGHT_X] + share * (two[HEIGHT_X] - one[HEIGHT_X]),
        one[HEIGHT_Y] + share * (two[HEIGHT_Y] - one[HEIGHT_Y]),
    )
    rates = np.zeros(2)
    for k in range(blocks.shape[0]):
        at = MODES + 2 * k + 1
        rates[k % 2] += blocks[k, GAIN] * (one[at] + share * (two[at] - one[at]))
    return heights, rates, one[TURN] + share * (two[TURN] - one[TURN])


@compiled
def carry_correction(  # type: ignore[no-untyped-def]
    store, ring, at, last, blocks, mean, moment, is_added
):
    """Adds a correction to all later states in the ring buffer, and to the model."""
    kept, start = ring.shape[0], moment
    if ring[at % kept, TIME] == moment and not is_added:
        _corrected(blocks, mean, ring[at % kept])
    for row in range(at, last):
        one, two = ring[row % kept], ring[(row + 1) % kept]
        propagated(blocks, one, two, start, two[TIME])
        start = two[TIME]
        if not is_added:
            _corrected(blocks, mean, two)
    modes, newest = records(store)[1], ring[last % kept]
    for n in range(modes.shape[0]):
        place = MODES + 4 * n
        modes[n]["x"], modes[n]["vx"] = newest[place], newest[place + 1]
        modes[n]["y"], modes[n]["vy"] = newest[place + 2], newest[place + 3]


@compiled
def bounded(theta, mean, states, noise):  # type: ignore[no-untyped-def]
    """Limits the correction so that the frequency and damping errors stay within bounds."""
    for i, most in ((FREQUENCY, noise[MOST_FREQUENCY]), (DAMPING, noise[MOST_DAMPING])):
        mean[states + i] = min(max(mean[states + i], -most - theta[i]), most - theta[i])
