"""Compiled extended Kalman filter for the modal state of the liquid.

The observer runs a model of its own with the estimator's input. Its state is, for each mode and
axis, place q [m] and rate q̇ [m/s] of the mass, and four slow parameters: ε and κ with
ω' = ω exp(ε), ζ' = ζ exp(κ), the still level and the offset of the measurement's clock. Small
errors of the state follow

    δ̈ + 2ζ'ω'δ̇ + ω'²δ = -2ω'² q δε - 2ζ'ω' q̇ (δε + δκ) + w

with white noise w (extended Kalman filter: Gelb, Applied Optimal Estimation, 1974, §6.1).
Measurements come late: the covariance stands at the last one, the *anchor*, and a correction at a
past moment is carried on to the newest input through a ring of past states.
"""

from __future__ import annotations

import math

import numpy as np
from numba.types import boolean, float64, int64, void

from slosh_base.compiled.compilation import (
    CHANGED_1,
    CHANGED_2,
    GIVEN_1,
    GIVEN_2,
    compiled,
    entry_point,
)
from slosh_model import kernel
from slosh_model.chains import all_modulations
from slosh_model.constants import GRAVITY
from slosh_model.indices import DAMPING as MODE_DAMPING
from slosh_model.indices import FREQUENCY as MODE_FREQUENCY
from slosh_model.indices import FREQUENCY_RATIO, GAIN_Y
from slosh_model.indices import GAIN as MODE_GAIN
from slosh_model.layout import records
from slosh_model.tank_wall import place_on_wall

OMEGA, ZETA, GAIN = range(3)
"""Columns of a block, one for each mode and axis: ω' [rad/s], ζ', wall height per displacement."""
PHI, SENSITIVITY, NOISE = 3, 7, 11
"""Since the anchor: the transition matrix (4), the derivatives of q and q̇ by ε and κ (4), and the
covariance that the noise has added (3)."""
BLOCK = 14

FREQUENCY, DAMPING, LEVEL, CLOCK = range(4)
"""The slow parameters ε, κ [1], the still level [m] and by how much stamps of measurements are
late [s]."""
PARAMETERS = 4

(
    FLOOR, SHARE, WAVE, MEMORY, FREQUENCY_WALK, DAMPING_WALK, LEVEL_WALK, CLOCK_WALK, GATE, COMMON,
    FORM, STEEP, MOST_FREQUENCY, MOST_DAMPING, RELATIVE, ALIKE, MEAN,
) = range(17)  # fmt: skip
"""Noise: spectral density of w at rest [m²/s³]; its amplitude as parts of the acceleration and of
the wave's own, and how long such an error lasts [s]; random walks of ε, κ [1/s], of the level
[m²/s] and of the clock [s]; the largest innovation, as of a normal deviate; the part of a variance
that all points of a measurement share; error of a height η by the form of the wave, in η²/R;
height of a wave whose own error is twice as large, as part of R; largest |ε| and |κ|; error of a
height as part of the wave; how long errors of heights are alike, and time of the average at rest
[s]."""
NOISES = 17

TIME, LIFT, DENSITY, HEIGHT_X, HEIGHT_Y, TURN, MODES = range(7)
"""Columns of the ring: time [s], vertical acceleration as part of g, spectral density of w,
heights along the modal axes [m], the container's angle in them [rad]; then q and q̇ of each
block."""

(
    SH_X, SH_Y, MSH, AZIMUTH, STDDEV_X, STDDEV_Y, STDDEV, ENVELOPE, ENVELOPE_STDDEV, DECAY, STATE,
) = range(11)  # fmt: skip
"""Columns of an answer: heights at +x and +y, their maximum [m] and its azimuth [rad], standard
deviations of the three heights [m]; the largest height that the wave reaches if nothing moves from
now on, and its standard deviation [m]; the slowest mode's ζω [1/s]; then x, y, vx, vy of each
mode."""

MEAN_X, MEAN_Y, COUNT = range(3)
"""Mean of the acceleration that drives the liquid at rest [m/s²], and of how many inputs."""


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
def _step(block, dt, lift, density, q, u):  # type: ignore[no-untyped-def]
    """Propagates transition, sensitivity and noise of one mode axis with state q, u by dt."""
    decay = block[OMEGA] * block[ZETA]
    stiffness = block[OMEGA] * block[OMEGA] * lift
    a, b, c, d = _oscillation(stiffness, decay, dt)
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
def _between(blocks, one, two, begin, end):  # type: ignore[no-untyped-def]
    """Propagates all mode axes over a part of the time between two stored inputs."""
    whole = two[TIME] - one[TIME]
    middle = (0.5 * (begin + end) - one[TIME]) / whole if whole > 0.0 else 1.0
    lift = one[LIFT] + middle * (two[LIFT] - one[LIFT])
    density = one[DENSITY] + middle * (two[DENSITY] - one[DENSITY])
    for k in range(blocks.shape[0]):
        at = MODES + 2 * k
        q = one[at] + middle * (two[at] - one[at])
        u = one[at + 1] + middle * (two[at + 1] - one[at + 1])
        _step(blocks[k], end - begin, lift, density, q, u)


@compiled
def _anchored(blocks):  # type: ignore[no-untyped-def]
    """Resets transition, sensitivity and noise of all mode axes at the reference time."""
    for k in range(blocks.shape[0]):
        block = blocks[k]
        block[PHI:] = 0.0
        block[PHI] = block[PHI + 3] = 1.0


@compiled
def _rows(blocks, heights, size):  # type: ignore[no-untyped-def]
    """Returns the measurement matrix (2, size) of the heights, and their noise (2,)."""
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
def _product(one, matrix, other):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(one.shape[0]):
        if one[i] != 0.0:
            part = 0.0
            for j in range(other.shape[0]):
                part += matrix[i, j] * other[j]
            total += one[i] * part
    return total


@compiled
def _averaged(run, averages, time, dt):  # type: ignore[no-untyped-def]
    """Updates the mean acceleration that acts on the liquid."""
    averages[COUNT] += 1.0
    share = max(1.0 / averages[COUNT], dt / (time + dt))
    averages[MEAN_X] += share * (run["ax"] - averages[MEAN_X])
    averages[MEAN_Y] += share * (run["ay"] - averages[MEAN_Y])


@compiled
def _envelope(store, blocks, covariance, averages, out):  # type: ignore[no-untyped-def]
    """Writes the largest height that the wave can still reach if the container rests.

    Each mode goes along an ellipse about the place where the liquid rests; its longer half axis is
    the height. The standard deviation is bounded from above.
    """
    modes, size = records(store)[1], covariance.shape[0]
    row, states = np.zeros(size), 2 * blocks.shape[0]
    height = variance = 0.0
    decay = math.inf
    for n in range(modes.shape[0]):
        mode, wave, axes = modes[n], np.zeros(4), 0.0
        for axis in range(2):
            block = blocks[2 * n + axis]
            omega, gain = block[OMEGA], block[GAIN]
            place, rate = (mode["x"], mode["vx"]) if axis == 0 else (mode["y"], mode["vy"])
            wave[axis] = gain * (place + averages[MEAN_X + axis] / (omega * omega))
            wave[2 + axis] = gain * rate / omega
            decay = min(decay, omega * block[ZETA])
            widest = 0.0
            for i, scale in ((0, gain), (1, gain / omega)):
                row[:] = 0.0
                for j in range(2):
                    row[2 * (2 * n + axis) + j] = scale * block[PHI + 2 * i + j]
                    row[states + j] = scale * block[SENSITIVITY + 2 * i + j]
                noisy = scale * scale * block[NOISE + 2 * i]
                widest = max(widest, _product(row, covariance, row) + noisy)
            axes += widest
        squares = wave[0] ** 2 + wave[1] ** 2 + wave[2] ** 2 + wave[3] ** 2
        area = wave[0] * wave[3] - wave[1] * wave[2]
        rest = max(squares * squares - 4.0 * area * area, 0.0)
        height += math.sqrt(0.5 * (squares + math.sqrt(rest)))
        variance += axes
    out[ENVELOPE], out[ENVELOPE_STDDEV], out[DECAY] = height, math.sqrt(max(variance, 0.0)), decay


@compiled
def _answer(store, blocks, covariance, averages, row, out):  # type: ignore[no-untyped-def]
    """Writes the fused state that belongs to a stored input."""
    _envelope(store, blocks, covariance, averages, out)
    runs, modes = records(store)
    hx, hy = kernel.turned(row[HEIGHT_X], row[HEIGHT_Y], row[TURN])
    rows, noise = _rows(blocks, (row[HEIGHT_X], row[HEIGHT_Y]), covariance.shape[0])
    xx = _product(rows[0], covariance, rows[0]) + noise[0]
    yy = _product(rows[1], covariance, rows[1]) + noise[1]
    xy = _product(rows[0], covariance, rows[1])
    c, s = math.cos(row[TURN]), math.sin(row[TURN])
    vx = c * c * xx + 2.0 * c * s * xy + s * s * yy
    vy = s * s * xx - 2.0 * c * s * xy + c * c * yy
    vxy = c * s * (yy - xx) + (c * c - s * s) * xy
    out[SH_X], out[SH_Y] = hx, hy
    if runs[0]["cornered"] != 0.0:
        out[MSH] = kernel.corner_height(hx, hy)
        out[AZIMUTH] = kernel.corner_azimuth(hx, hy, modes[0]["radius"], modes[0]["radius_y"])
        c, s = math.copysign(1.0, hx), math.copysign(1.0, hy)
    else:
        out[MSH] = math.sqrt(hx * hx + hy * hy)
        out[AZIMUTH] = math.atan2(hy, hx)
        c, s = math.cos(out[AZIMUTH]), math.sin(out[AZIMUTH])
    out[STDDEV_X], out[STDDEV_Y] = math.sqrt(max(vx, 0.0)), math.sqrt(max(vy, 0.0))
    highest = c * c * vx + 2.0 * c * s * vxy + s * s * vy
    out[STDDEV] = math.sqrt(max(highest, 0.0))
    for n in range(modes.shape[0]):
        mode, at = modes[n], STATE + 4 * n
        out[at], out[at + 1], out[at + 2], out[at + 3] = (
            mode["x"], mode["y"], mode["vx"], mode["vy"],
        )  # fmt: skip


@compiled
def _take_constants(store, blocks):  # type: ignore[no-untyped-def]
    """Writes frequency, damping and height gain of each mode axis."""
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
def _change_constants(store, frequency, damping):  # type: ignore[no-untyped-def]
    """Multiplies the natural frequency by exp(frequency), the damping by exp(damping)."""
    factor = math.exp(frequency)
    square = factor * factor
    modes = records(store)[1]
    for n in range(modes.shape[0]):
        mode = modes[n]
        mode["natural_frequency"] *= factor
        mode["damping_ratio"] *= math.exp(damping)
        mode["curvature"] *= square
        mode["height_gain"] *= square
        mode["height_gain_y"] *= square


@entry_point(void(CHANGED_1, CHANGED_2))
def begin(store, blocks):  # type: ignore[no-untyped-def]
    """Sets the reference time of the filter to the current state of the model.

    Args:
        store: the observer's model, as `slosh_model.layout` has it.
        blocks: (2 modes, BLOCK); changed.
    """
    _take_constants(store, blocks)
    _anchored(blocks)


@entry_point(
    boolean(
        CHANGED_1, GIVEN_2, float64, float64, float64, float64, float64, float64, CHANGED_2, int64,
        CHANGED_2, CHANGED_1, GIVEN_1, float64,
    )
)  # fmt: skip
def follow(  # type: ignore[no-untyped-def]
    store, poses, now, dt, ax, ay, az, yaw, ring, count, blocks, averages, noise, bound
):
    """Propagates the filter to the newest input.

    Args:
        store: the observer's model; changed.
        poses, ax, ay, az, yaw, dt: the input, as in `estimate_kernel.step`.
        now: its stamp [s].
        ring: (K, MODES + 2 blocks) past states; changed.
        count: states before it, since the last restart.
        blocks: (2 modes, BLOCK) since the anchor; changed.
        averages: (3,) of the acceleration; changed.
        noise: (NOISES,).
        bound: a mass farther out is no liquid any more [m].

    Returns:
        False where the model has left the physical range.
    """
    runs, modes = records(store)
    run = runs[0]
    row = ring[count % ring.shape[0]]
    pose = kernel.pose_at(poses, 0)
    row[HEIGHT_X], row[HEIGHT_Y], row[TURN] = kernel.advance(run, modes, ax, ay, az, yaw, pose, dt)
    _averaged(run, averages, noise[MEAN], dt)
    row[TIME], row[LIFT] = now, 1.0 + run["lift"] * run["az"] / GRAVITY
    wave, inside = 0.0, True
    for n in range(modes.shape[0]):
        mode, at = modes[n], MODES + 4 * n
        row[at], row[at + 1] = mode["x"], mode["vx"]
        row[at + 2], row[at + 3] = mode["y"], mode["vy"]
        inside &= -bound < mode["x"] < bound and -bound < mode["y"] < bound
        for k in (2 * n, 2 * n + 1):
            at = MODES + 2 * k
            square = blocks[k, OMEGA] * blocks[k, OMEGA]
            wave += square * (square * row[at] * row[at] + row[at + 1] * row[at + 1])
    # The higher the wave, the less the model's third order describes it.
    height = math.hypot(row[HEIGHT_X], row[HEIGHT_Y]) / (noise[STEEP] * modes[0]["radius"])
    part = noise[WAVE] * (1.0 + height * height)
    push = noise[SHARE] ** 2 * (run["ax"] ** 2 + run["ay"] ** 2) + part * part * wave
    row[DENSITY] = noise[FLOOR] + noise[MEMORY] * push
    if count > 0:
        before = ring[(count - 1) % ring.shape[0]]
        _between(blocks, before, row, before[TIME], now)
    return inside


@entry_point(void(GIVEN_1, GIVEN_2, GIVEN_2, int64, GIVEN_2, GIVEN_1, CHANGED_1))
def read(store, blocks, ring, count, covariance, averages, out):  # type: ignore[no-untyped-def]
    """Writes the fused state at the time of the newest input.

    Args:
        store, blocks, ring: as in `follow`.
        count: inputs since the last restart.
        covariance: of the state at the anchor.
        averages: as in `follow`.
        out: (STATE + 4 modes,) receives the answer.
    """
    _answer(store, blocks, covariance, averages, ring[(count - 1) % ring.shape[0]], out)


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
def _carried_covariance(blocks, covariance, noise, elapsed):  # type: ignore[no-untyped-def]
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
    """Returns the covariance with one more state, which has a given variance."""
    size = covariance.shape[0]
    wide = np.zeros((size + 1, size + 1))
    wide[:size, :size] = covariance
    wide[size, size] = variance
    return wide


@compiled
def _tested(covariance, rows, innovations, variances, shared, gate):  # type: ignore[no-untyped-def]
    """Returns the normalised innovation of a measurement, divided by its limit."""
    count = innovations.shape[0]
    wide = _widened(covariance, shared)
    total = _update(np.zeros(wide.shape[0]), wide, rows, innovations, variances)
    # Wilson and Hilferty: about the same quantile of χ² for every count.
    part = 2.0 / (9.0 * count)
    limit = count * (1.0 - part + gate * math.sqrt(part)) ** 3
    return total / limit if total == total else math.inf


@compiled
def _measured(  # type: ignore[no-untyped-def]
    blocks,
    covariance,
    noise,
    heights,
    rates,
    turn,
    cornered,
    reaches,
    theta,
    elapsed,
    points,
    mean,
):
    """Updates the covariance by a measurement and writes the correction of the mean.

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
        c, s = math.cos(azimuth), math.sin(azimuth)
        if cornered:
            c, s = place_on_wall(azimuth, reaches[0], reaches[1])
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
    """Adds a correction at the reference time to a later stored state."""
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
def _expected(blocks, one, two, moment):  # type: ignore[no-untyped-def]
    """Interpolates heights along the modal axes, their rates and the angle at a time."""
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
def _carry_correction(store, ring, at, last, blocks, mean, moment):  # type: ignore[no-untyped-def]
    """Adds a correction to all later stored states and to the model."""
    kept, start = ring.shape[0], moment
    if ring[at % kept, TIME] == moment:
        _corrected(blocks, mean, ring[at % kept])
    for row in range(at, last):
        one, two = ring[row % kept], ring[(row + 1) % kept]
        _between(blocks, one, two, start, two[TIME])
        start = two[TIME]
        _corrected(blocks, mean, two)
    modes, newest = records(store)[1], ring[last % kept]
    for n in range(modes.shape[0]):
        place = MODES + 4 * n
        modes[n]["x"], modes[n]["vx"] = newest[place], newest[place + 1]
        modes[n]["y"], modes[n]["vy"] = newest[place + 2], newest[place + 3]


@compiled
def _bounded(theta, mean, states, noise):  # type: ignore[no-untyped-def]
    """Limits the correction so that the frequency and damping errors stay within bounds."""
    for i, most in ((FREQUENCY, noise[MOST_FREQUENCY]), (DAMPING, noise[MOST_DAMPING])):
        mean[states + i] = min(max(mean[states + i], -most - theta[i]), most - theta[i])


@entry_point(
    float64(
        CHANGED_1, CHANGED_2, int64, int64, CHANGED_2, CHANGED_1, CHANGED_2, GIVEN_1, float64,
        float64, boolean, GIVEN_1, GIVEN_2,
    )
)  # fmt: skip
def correct(  # type: ignore[no-untyped-def]
    store, ring, first, last, blocks, theta, covariance, noise, since, moment, cornered, reaches,
    points,
):  # fmt: skip
    """Corrects the state by a measurement, which may be delayed.

    Args:
        store: the observer's model at the newest input; changed.
        ring: past states; changed behind the moment.
        first, last: counts of the ring's rows that are the last before the anchor and the newest.
        blocks: since the anchor; changed: since the moment.
        theta, covariance: the slow parameters, and of the state at the anchor; changed.
        noise: (NOISES,).
        since: time of the anchor [s].
        moment: of the measurement [s]: not before the anchor, not after the newest input.
        cornered: whether the wall has corners.
        reaches: (2,) from the axis to the wall along x and y [m].
        points: (M, 3) azimuth about the container's axis [rad], or NaN: where it is highest;
            height above the still level and its standard deviation [m]. None: the anchor is
            moved to the moment.

    Returns:
        the normalised innovation over its limit: above 1 the measurement is rejected.
    """
    kept, size = ring.shape[0], covariance.shape[0]
    trial, carried, mean = blocks.copy(), covariance.copy(), np.zeros(size)
    _anchored(trial)
    start, at = since, first
    while at < last and ring[(at + 1) % kept, TIME] <= moment:
        one, two = ring[at % kept], ring[(at + 1) % kept]
        _between(trial, one, two, start, two[TIME])
        start = two[TIME]
        at += 1
    one, two = ring[at % kept], ring[min(at + 1, last) % kept]
    if moment > start:
        _between(trial, one, two, start, moment)
    elapsed = moment - since
    _carried_covariance(trial, carried, noise, elapsed)
    ratio = 0.0
    if points.shape[0] > 0:
        heights, rates, turn = _expected(blocks, one, two, moment)
        ratio = _measured(
            trial,
            carried,
            noise,
            heights,
            rates,
            turn,
            cornered,
            reaches,
            theta,
            elapsed,
            points,
            mean,
        )
    if not ratio <= 1.0:
        return ratio
    states = 2 * blocks.shape[0]
    _bounded(theta, mean, states, noise)
    for i in range(PARAMETERS):
        theta[i] += mean[states + i]
    covariance[:, :] = carried
    _anchored(trial)
    _carry_correction(store, ring, at, last, trial, mean, moment)
    _change_constants(store, mean[states + FREQUENCY], mean[states + DAMPING])
    blocks[:, :] = trial
    _take_constants(store, blocks)
    return ratio
