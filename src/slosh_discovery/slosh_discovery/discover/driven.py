"""Propagates the noise of a measured acceleration to the heights of a model.

The true container did not feel the noise, the model did: its heights differ from the truth by the
modes' answer to white noise from the motion's start on. That answer is a slow random walk of
amplitude and phase near the natural frequency, for which any fit finds a use. Its covariance has
a closed form, and a few columns are nearly all of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.input_noise import InputNoise
from slosh_discovery.discover.problem import PreparedMotion, heights_of_liquids, liquid_alone
from slosh_discovery.discover.tuning import TUNING
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.interpolation import columns_at
from slosh_model.measure import measured_heights, reading_clock
from slosh_model.model import Model
from slosh_model.response import Response
from slosh_model.simulate import Inputs

MOST_COLUMNS = 150
STEP = 1e-6
"""Of the derivative of what is read by the liquid's heights [m]."""
LEAST_DAMPING = 1e-6


def with_input_noise(
    motion: PreparedMotion, noise: InputNoise | None, model: Model, clock_offset: float
) -> PreparedMotion:
    """Returns a motion that also contains the effect of input noise on a model's heights.

    Args:
        motion: the motion.
        noise: of its acceleration; None: there is none.
        model: that is likely.
        clock_offset: measured minus inputs' clock [s].
    """
    if noise is None:
        return replace(motion, driven=None, blur=None)
    moments = reading_clock(model).moments(motion.t - clock_offset, float(motion.fine.t[0]))
    liquid = _liquid_at(motion.fine, model, moments)
    tolerated = (TUNING.small_answer * motion.noise) ** 2
    shaken = _shaken(motion, noise, model, moments, liquid, tolerated)
    lasting = _lasting(motion, noise, model, moments, liquid)
    seen = np.max(lasting**2, axis=(0, 1)) > tolerated
    driven = np.concatenate([shaken, lasting[:, :, seen]], axis=2)
    if not driven.shape[2]:
        return replace(motion, driven=None, blur=None)
    return replace(motion, driven=driven, blur=_blur(motion, liquid, driven))


def _shaken(
    motion: PreparedMotion,
    noise: InputNoise,
    model: Model,
    moments: Array,
    liquid: Array,
    tolerated: float,
) -> Array:
    """Returns height responses [m] to white input noise, one column per noise component."""
    parts = [np.empty((*motion.heights.shape, 0))]
    if noise.density == 0.0:
        return parts[0]
    read, modes = read_directions(motion, model, moments, liquid), model.mode_constants()
    for axis in (X_AXIS, Y_AXIS):
        for mode, gain in zip(modes, model.height_gains(modes, axis), strict=True):
            own = mode.along(axis)
            factor = (gain * math.sqrt(noise.density)) * answer_columns(
                moments - float(motion.fine.t[0]),
                own.natural_frequency,
                own.damping_ratio,
                tolerated / gain**2 / noise.density,
            )
            parts.append(read[:, :, axis, np.newaxis] * factor[:, np.newaxis, :])
    return np.concatenate(parts, axis=2)


def _lasting(
    motion: PreparedMotion, noise: InputNoise, model: Model, moments: Array, liquid: Array
) -> Array:
    """Returns height responses [m] to constant biases of the acceleration, one column per axis.

    Simulated, as they drive a liquid whose frequency changes with the vertical acceleration.
    """
    inputs, read = motion.fine, _reading(motion, model, moments)
    felt = read(liquid)
    parts = [np.empty((*felt.shape, 0))]
    for axis in (X_AXIS, Y_AXIS):
        if noise.constant[axis]:
            constant = noise.constant[axis] * np.eye(3)[axis]
            without = replace(inputs, acceleration=inputs.acceleration - constant)
            parts.append((felt - read(_liquid_at(without, model, moments)))[..., np.newaxis])
    return np.concatenate(parts, axis=2)


def _decay_and_swing(frequency: float, damping: float) -> tuple[float, float]:
    decay = max(min(damping, 0.99), LEAST_DAMPING) * frequency
    return decay, math.sqrt(frequency**2 - decay**2)


def _blur(motion: PreparedMotion, liquid: Array, driven: Array) -> Array | None:
    """Returns the variance that noise adds to a peak height [m²]; None for heights by azimuth.

    A wave of height A that noise moves by δ across rises by δ²/2A, of the variance σ⁴/2A² - and
    by about σ where there is hardly a wave.
    """
    if motion.azimuths is not None:
        return None
    variance = np.sum(driven**2, axis=2)
    wave = np.sum(liquid**2, axis=1)[:, np.newaxis]
    return np.asarray(variance**2 / np.maximum(2.0 * wave + variance, 1e-300))


def answer_columns(t: Array, frequency: float, damping: float, tolerated: float) -> Array:
    """Returns a low-rank factor L, one row per time: L Lᵀ is nearly the response's covariance.

    By the Cholesky decomposition with pivots: the largest variance that is left comes next.

    Args:
        t: (M,) since the noise began [s].
        frequency: ω of the oscillator [rad/s].
        damping: ζ.
        tolerated: variance that may be left at any time [s³].
    """
    left = answer_covariance(t, t, frequency, damping)
    columns: list[Array] = []
    while len(columns) < MOST_COLUMNS:
        pivot = int(np.argmax(left))
        if left[pivot] <= tolerated:
            break
        column = answer_covariance(t, t[pivot], frequency, damping)
        for other in columns:
            column = column - other[pivot] * other
        column = column / math.sqrt(left[pivot])
        columns.append(column)
        left = np.maximum(left - column**2, 0.0)
    return np.column_stack(columns) if columns else np.empty((len(t), 0))


def answer_covariance(t: Array, other: Array | float, frequency: float, damping: float) -> Array:
    """Returns the covariance [s³] of q at two times for q̈ + 2ζω q̇ + ω² q = white noise.

    ∫ h(t - s) h(t' - s) ds from 0 to the earlier time, with the impulse response
    h(τ) = exp(-σ τ) sin(ν τ)/ν, σ = ζ ω, ν² = ω² - σ², and w of unit density.
    """
    decay, swing = _decay_and_swing(frequency, damping)
    t, other = np.maximum(t, 0.0), np.maximum(other, 0.0)
    apart, both = np.abs(t - other), t + other
    pole = decay - 1j * swing
    slow = np.cos(swing * apart) * (np.exp(-decay * apart) - np.exp(-decay * both)) / decay
    fast = np.real((np.exp(-pole * apart) - np.exp(-pole * both)) / pole)
    return np.asarray((slow - fast) / (4.0 * swing**2))


def read_directions(motion: PreparedMotion, model: Model, moments: Array, liquid: Array) -> Array:
    """Returns derivatives of the measured heights with respect to the heights at +x and +y.

    Args:
        motion: the motion.
        model: that is likely.
        moments: (M,) at which the liquid is read [s].
        liquid: (M, 2) its heights at +x and +y then [m].
    """
    inputs, read = motion.fine, _reading(motion, model, moments)
    steps = STEP * np.eye(2)
    slopes = [(read(liquid + step) - read(liquid - step)) / (2.0 * STEP) for step in steps]
    found = np.stack(slopes, axis=2)
    if motion.azimuths is None:
        flat = np.linalg.norm(found, axis=2) < TUNING.flat
        found[flat] = (1.0, 0.0)
    if model.container.follows_yaw or not len(inputs.poses):
        return found
    yaw = np.interp(moments, inputs.t, inputs.yaws)[:, np.newaxis]
    x, y = found[..., 0], found[..., 1]
    turned = (np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y)
    return np.stack(turned, axis=2)


def _reading(motion: PreparedMotion, model: Model, moments: Array) -> Callable[[Array], Array]:
    """Returns a function that maps the liquid's heights at +x and +y to measured heights."""
    nothing, start = np.empty((len(moments), 0, 4)), float(motion.fine.t[0])

    def read(liquid: Array) -> Array:
        response = Response(moments, liquid[:, 0], liquid[:, 1], nothing)
        return measured_heights(model, response, motion.azimuths, start)

    return read


def _liquid_at(inputs: Inputs, model: Model, moments: Array) -> Array:
    """Returns the liquid's heights (M, 2) at +x and +y [m]; 0 where the model has no solution."""
    (heights,) = heights_of_liquids([liquid_alone(model)], [inputs])
    return np.nan_to_num(columns_at(moments, inputs.t, heights))
