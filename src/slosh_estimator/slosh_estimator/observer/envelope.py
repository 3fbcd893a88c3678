"""Computes the largest height that a wave can still reach if the container rests.

Each mode goes along an ellipse about the place where the liquid rests; its longer half axis is the
height. Two standard deviations belong to it. The one is the filter's and holds any error of the
model. The other is that of what is left if frequency and damping are wrong by given errors: their
part is then no deviation, but moves the wave, which is taken at its highest. That is the smaller
one where no measurement has told the frequency, whose error turns the wave's phase and is linear
in the filter.
"""

from __future__ import annotations

import math

import numpy as np

from slosh_base.compiled.compilation import compiled
from slosh_estimator.observer.answer import product
from slosh_estimator.observer.layout import (
    DECAY,
    ENVELOPE,
    ENVELOPE_NOISE,
    ENVELOPE_STDDEV,
    GAIN,
    HIGH_DAMPING,
    HIGH_FREQUENCY,
    LOW_DAMPING,
    LOW_FREQUENCY,
    MEAN_X,
    NOISE,
    OMEGA,
    PHI,
    SENSITIVITY,
    SPECTRUM,
    WORST_ENVELOPE,
    WORST_STDDEV,
    ZETA,
)
from slosh_model.layout import records


@compiled
def _half_axis(wave):  # type: ignore[no-untyped-def]
    """Returns the longer half axis [m] of a wave's elliptic motion, from x, y and scaled rates."""
    squares = wave[0] ** 2 + wave[1] ** 2 + wave[2] ** 2 + wave[3] ** 2
    area = wave[0] * wave[3] - wave[1] * wave[2]
    rest = max(squares * squares - 4.0 * area * area, 0.0)
    return math.sqrt(0.5 * (squares + math.sqrt(rest)))


@compiled
def _moved(rows, covariance, states):  # type: ignore[no-untyped-def]
    """Returns how the wave (4, 2) changes per unit error of frequency and of damping.

    The state is linear in them: by the covariance at the anchor and by what has come since.
    """
    moves = np.zeros((4, 2))
    a, b = covariance[states, states], covariance[states, states + 1]
    d = covariance[states + 1, states + 1]
    inverse = 1.0 / (a * d - b * b) if a * d > b * b else 0.0
    for i in range(4):
        with_frequency = with_damping = 0.0
        for k in range(covariance.shape[0]):
            with_frequency += rows[i, k] * covariance[k, states]
            with_damping += rows[i, k] * covariance[k, states + 1]
        moves[i, 0] = (with_frequency * d - with_damping * b) * inverse
        moves[i, 1] = (with_damping * a - with_frequency * b) * inverse
    return moves


@compiled
def _left(row, moves, covariance, states):  # type: ignore[no-untyped-def]
    """Returns the part of the wave's variance not due to errors of frequency and damping."""
    explained = 0.0
    for i in range(2):
        for j in range(2):
            explained += moves[i] * covariance[states + i, states + j] * moves[j]
    return max(product(row, covariance, row) - explained, 0.0)


@compiled
def _worst(wave, moves, errors):  # type: ignore[no-untyped-def]
    """Returns the largest wave half axis [m] over likely errors of frequency and damping."""
    trial, highest = np.zeros(4), _half_axis(wave)
    for i in range(3):
        frequency = 0.5 * (i * errors[HIGH_FREQUENCY] + (2 - i) * errors[LOW_FREQUENCY])
        for damping in (errors[LOW_DAMPING], errors[HIGH_DAMPING]):
            for k in range(4):
                # The gain follows the frequency's square, the rate is a part of its inverse.
                scale = 1.0 + (2.0 if k < 2 else 1.0) * frequency
                moved = moves[k, 0] * frequency + moves[k, 1] * damping
                trial[k] = scale * wave[k] + moved
            highest = max(highest, _half_axis(trial))
    return highest


@compiled
def envelope(store, blocks, covariance, averages, errors, out):  # type: ignore[no-untyped-def]
    """Computes the largest height the wave can reach, its standard deviations and decay rate.

    The standard deviations are bounded from above; that of the worst height is of one direction.
    """
    modes, size = records(store)[1], covariance.shape[0]
    states = 2 * blocks.shape[0]
    height = variance = shaken = worst = left = 0.0
    decay = math.inf
    for n in range(modes.shape[0]):
        mode, wave, rows = modes[n], np.zeros(4), np.zeros((4, size))
        for axis in range(2):
            block = blocks[2 * n + axis]
            omega, gain = block[OMEGA], block[GAIN]
            place, rate = (mode["x"], mode["vx"]) if axis == 0 else (mode["y"], mode["vy"])
            wave[axis] = gain * (place + averages[MEAN_X + axis] / (omega * omega))
            wave[2 + axis] = gain * rate / omega
            decay = min(decay, omega * block[ZETA])
            # The stationary variance of an oscillator that white noise drives.
            shaken += gain * gain * averages[SPECTRUM] / (4.0 * block[ZETA] * omega**3)
            for i, scale in ((0, gain), (1, gain / omega)):
                for j in range(2):
                    at = 2 * i + j
                    rows[2 * i + axis, 2 * (2 * n + axis) + j] = scale * block[PHI + at]
                    rows[2 * i + axis, states + j] = scale * block[SENSITIVITY + at]
        moves, alone = _moved(rows, covariance, states), 0.0
        for axis in range(2):
            block, widest, widest_left = blocks[2 * n + axis], 0.0, 0.0
            for i, scale in ((0, block[GAIN]), (1, block[GAIN] / block[OMEGA])):
                row, noisy = rows[2 * i + axis], scale * scale * block[NOISE + 2 * i]
                widest = max(widest, product(row, covariance, row) + noisy)
                found = _left(row, moves[2 * i + axis], covariance, states) + noisy
                widest_left = max(widest_left, found)
            variance += widest
            alone = max(alone, widest_left)
        left += alone
        height += _half_axis(wave)
        worst += _worst(wave, moves, errors)
    out[ENVELOPE], out[ENVELOPE_STDDEV], out[DECAY] = height, math.sqrt(max(variance, 0.0)), decay
    out[ENVELOPE_NOISE] = math.sqrt(shaken)
    out[WORST_ENVELOPE], out[WORST_STDDEV] = worst, math.sqrt(left)
