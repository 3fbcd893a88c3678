"""Propagates small errors of the observer's state and their covariance; see `observer_kernel`."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.compiled.compilation import compiled
from slosh_estimator.observer.layout import (
    COUNT,
    DENSITY,
    FREQUENCY_WALK,
    GAIN,
    LIFT,
    MEAN_X,
    MEAN_Y,
    MODES,
    NOISE,
    OMEGA,
    PARAMETERS,
    PHI,
    SENSITIVITY,
    SPECTRUM,
    TIME,
    ZETA,
)
from slosh_model import kernel
from slosh_model.chains import all_modulations
from slosh_model.indices import DAMPING as MODE_DAMPING
from slosh_model.indices import FREQUENCY as MODE_FREQUENCY
from slosh_model.indices import FREQUENCY_RATIO, GAIN_Y
from slosh_model.indices import GAIN as MODE_GAIN
from slosh_model.layout import records


@compiled
def _oscillation(stiffness, decay, dt):  # type: ignore[no-untyped-def]
    """Returns the transition matrix of ẍ + 2 decay ẋ + stiffness x = 0 over dt, by rows."""
    squared = stiffness - decay * decay
    if squared > 1e-9:
        omega = math.sqrt(squared)
        c, s = math.cos(omega * dt), math.sin(omega * dt) / omega
    elif squared < -1e-9:
        omega = math.sqrt(-squared)
        c, s = math.cosh(omega * dt), math.sinh(omega * dt) / omega
    else:
        c, s = 1.0, dt
    fade = math.exp(-decay * dt)
    return fade * (c + decay * s), fade * s, -fade * stiffness * s, fade * (c - decay * s)


@compiled
def _step(block, swing, dt, lift, density, q, u):  # type: ignore[no-untyped-def]
    """Propagates the matrices of one mode and axis by a time step dt [s].

    swing: its transition matrix over dt; q, u: its state.
    """
    decay = block[OMEGA] * block[ZETA]
    stiffness = block[OMEGA] * block[OMEGA] * lift
    a, b, c, d = swing
    # A constant force moves the place by `still` and the rate by b.
    still = (1.0 - a) / stiffness if abs(stiffness) > 1e-9 else 0.5 * dt * dt
    by_damping = -2.0 * decay * u
    by_frequency = -2.0 * stiffness * q + by_damping
    for i, push in ((0, by_frequency), (1, by_damping)):
        one, two = block[SENSITIVITY + i], block[SENSITIVITY + 2 + i]
        block[SENSITIVITY + i] = a * one + b * two + still * push
        block[SENSITIVITY + 2 + i] = c * one + d * two + b * push
        one, two = block[PHI + i], block[PHI + 2 + i]
        block[PHI + i] = a * one + b * two
        block[PHI + 2 + i] = c * one + d * two
    xx, xv, vv = block[NOISE], block[NOISE + 1], block[NOISE + 2]
    block[NOISE] = a * a * xx + 2.0 * a * b * xv + b * b * vv + density * dt**3 / 3.0
    block[NOISE + 1] = a * c * xx + (a * d + b * c) * xv + b * d * vv + density * dt * dt / 2.0
    block[NOISE + 2] = c * c * xx + 2.0 * c * d * xv + d * d * vv + density * dt


@compiled
def propagated(blocks, one, two, begin, end):  # type: ignore[no-untyped-def]
    """Advances the accumulated transition and noise matrices of all modes from begin to end."""
    whole = two[TIME] - one[TIME]
    middle = (0.5 * (begin + end) - one[TIME]) / whole if whole > 0.0 else 1.0
    lift = one[LIFT] + middle * (two[LIFT] - one[LIFT])
    density = one[DENSITY] + middle * (two[DENSITY] - one[DENSITY])
    dt = end - begin
    swing = (1.0, 0.0, 0.0, 1.0)
    for k in range(blocks.shape[0]):
        at, block = MODES + 2 * k, blocks[k]
        omega, zeta = block[OMEGA], block[ZETA]
        # In a round container both axes of a mode swing alike.
        if k % 2 == 0 or omega != blocks[k - 1, OMEGA] or zeta != blocks[k - 1, ZETA]:
            swing = _oscillation(omega * omega * lift, omega * zeta, dt)
        q = one[at] + middle * (two[at] - one[at])
        u = one[at + 1] + middle * (two[at + 1] - one[at + 1])
        _step(block, swing, dt, lift, density, q, u)


@compiled
def anchored(blocks):  # type: ignore[no-untyped-def]
    """Sets transition to identity, sensitivity and noise to 0, at a new reference time."""
    for k in range(blocks.shape[0]):
        block = blocks[k]
        block[PHI:] = 0.0
        block[PHI] = block[PHI + 3] = 1.0


@compiled
def averaged(run, averages, time, dt):  # type: ignore[no-untyped-def]
    """Updates the running mean of the acceleration on the liquid, and its noise density."""
    averages[COUNT] += 1.0
    share = max(1.0 / averages[COUNT], dt / (time + dt))
    averages[MEAN_X] += share * (run["ax"] - averages[MEAN_X])
    averages[MEAN_Y] += share * (run["ay"] - averages[MEAN_Y])
    noise = (run["ax"] - averages[MEAN_X]) ** 2 + (run["ay"] - averages[MEAN_Y]) ** 2
    averages[SPECTRUM] += share * (0.5 * noise * dt - averages[SPECTRUM])


@compiled
def take_constants(store, blocks):  # type: ignore[no-untyped-def]
    """Copies frequency, damping and height gain of each mode and axis to the filter."""
    runs, modes = records(store)
    run = runs[0]
    for n in range(modes.shape[0]):
        mode = all_modulations(kernel.constants_of(modes[n]), run["elapsed"], run["parameters"])
        for axis in range(2):
            block = blocks[2 * n + axis]
            ratio = mode[FREQUENCY_RATIO] if axis == 1 else 1.0
            block[OMEGA], block[ZETA] = mode[MODE_FREQUENCY] * ratio, mode[MODE_DAMPING]
            block[GAIN] = mode[GAIN_Y] if axis == 1 else mode[MODE_GAIN]


@compiled
def change_mode(mode, frequency, damping):  # type: ignore[no-untyped-def]
    """Multiplies a mode's natural frequency ω by exp(frequency), its damping ζ by exp(damping)."""
    factor = math.exp(frequency)
    square = factor * factor
    mode["natural_frequency"] *= factor
    mode["damping_ratio"] *= math.exp(damping)
    mode["curvature"] *= square
    mode["height_gain"] *= square
    mode["height_gain_y"] *= square


@compiled
def change_constants(store, frequency, damping):  # type: ignore[no-untyped-def]
    """Multiplies all modes' frequencies ω by exp(frequency), their damping by exp(damping)."""
    modes = records(store)[1]
    for n in range(modes.shape[0]):
        change_mode(modes[n], frequency, damping)


@compiled
def _transition(blocks, size):  # type: ignore[no-untyped-def]
    """Returns the transition matrix (size, size) of the state since the reference time."""
    states = 2 * blocks.shape[0]
    transition = np.eye(size)
    for k in range(blocks.shape[0]):
        for i in range(2):
            for j in range(2):
                transition[2 * k + i, 2 * k + j] = blocks[k, PHI + 2 * i + j]
                transition[2 * k + i, states + j] = blocks[k, SENSITIVITY + 2 * i + j]
    return transition


@compiled
def _product_by_transposed(one, other):  # type: ignore[no-untyped-def]
    """Returns A Bᵀ, summed in the same order on every machine."""
    product = np.zeros((one.shape[0], other.shape[0]))
    for i in range(one.shape[0]):
        for j in range(other.shape[0]):
            for k in range(one.shape[1]):
                product[i, j] += one[i, k] * other[j, k]
    return product


@compiled
def carried_covariance(blocks, covariance, noise, elapsed):  # type: ignore[no-untyped-def]
    """Propagates the covariance from the reference time in place: F P Fᵀ + Q."""
    size, states = covariance.shape[0], 2 * blocks.shape[0]
    transition = _transition(blocks, size)
    # P is symmetric: F (F P)ᵀ is F P Fᵀ.
    new = _product_by_transposed(transition, _product_by_transposed(transition, covariance))
    for k in range(blocks.shape[0]):
        new[2 * k, 2 * k] += blocks[k, NOISE]
        new[2 * k, 2 * k + 1] += blocks[k, NOISE + 1]
        new[2 * k + 1, 2 * k] += blocks[k, NOISE + 1]
        new[2 * k + 1, 2 * k + 1] += blocks[k, NOISE + 2]
    for i in range(PARAMETERS):
        new[states + i, states + i] += noise[FREQUENCY_WALK + i] * elapsed
    for i in range(size):
        for j in range(size):
            covariance[i, j] = 0.5 * (new[i, j] + new[j, i])
