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
    entry_point,
)
from slosh_estimator.observer.answer import answered
from slosh_estimator.observer.correction import (
    bounded,
    carry_correction,
    expected_heights,
    measured,
)
from slosh_estimator.observer.envelope import envelope
from slosh_estimator.observer.layout import (
    AX,
    AY,
    AZ,
    DAMPING,
    DENSITY,
    FLOOR,
    FREQUENCY,
    HEIGHT_X,
    HEIGHT_Y,
    LARGE,
    LIFT,
    MEAN,
    MEMORY,
    MODES,
    OMEGA,
    PARAMETERS,
    SHARE,
    STEEP,
    TIME,
    TURN,
    WAVE,
)
from slosh_estimator.observer.propagation import (
    anchored,
    averaged,
    carried_covariance,
    change_constants,
    propagated,
    take_constants,
)
from slosh_estimator.observer.wave_carry import carry_wave, correction_size
from slosh_model import kernel
from slosh_model.constants import GRAVITY
from slosh_model.layout import records


@entry_point(void(CHANGED_1, CHANGED_2))
def begin(store, blocks):  # type: ignore[no-untyped-def]
    """Sets the reference time of the filter to the current state of the model.

    Args:
        store: the observer's model, as `slosh_model.layout` has it.
        blocks: (2 modes, BLOCK); changed.
    """
    take_constants(store, blocks)
    anchored(blocks)


@entry_point(
    boolean(
        CHANGED_1, GIVEN_2, float64, float64, float64, float64, float64, float64, CHANGED_2, int64,
        CHANGED_2, CHANGED_1, GIVEN_1, float64,
    )
)  # fmt: skip
def follow(  # type: ignore[no-untyped-def]
    store, poses, now, dt, ax, ay, az, yaw, ring, count, blocks, averages, noise, bound
):
    """Propagates the Kalman filter to the time of the newest input.

    Args:
        store: the observer's model; changed.
        poses, ax, ay, az, yaw, dt: the input, as in `estimate_kernel.step`.
        now: its stamp [s].
        ring: (K, MODES + 2 blocks) past states; changed.
        count: states before it, since the last restart.
        blocks: (2 modes, BLOCK) since the anchor; changed.
        averages: (AVERAGES,) of the acceleration; changed.
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
    averaged(run, averages, noise[MEAN], dt)
    row[AX], row[AY], row[AZ] = run["ax"], run["ay"], run["az"]
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
        propagated(blocks, before, row, before[TIME], now)
    return inside


@entry_point(void(GIVEN_1, GIVEN_2, GIVEN_2, int64, GIVEN_2, GIVEN_1, GIVEN_1, CHANGED_1))
def read(  # type: ignore[no-untyped-def]
    store, blocks, ring, count, covariance, averages, errors, out
):
    """Computes height, standard deviations and envelope of the wave at the newest input.

    Args:
        store, blocks, ring: as in `follow`.
        count: inputs since the last restart.
        covariance: of the state at the anchor.
        averages: as in `follow`.
        errors: (4,) of the slow parameters that calm allows for, as in `layout`.
        out: (STATE + 4 modes,) receives the answer.
    """
    row = ring[(count - 1) % ring.shape[0]]
    envelope(store, blocks, covariance, averages, errors, out)
    answered(store, blocks, covariance, row, out)


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
    anchored(trial)
    start, at = since, first
    while at < last and ring[(at + 1) % kept, TIME] <= moment:
        one, two = ring[at % kept], ring[(at + 1) % kept]
        propagated(trial, one, two, start, two[TIME])
        start = two[TIME]
        at += 1
    one, two = ring[at % kept], ring[min(at + 1, last) % kept]
    if moment > start:
        propagated(trial, one, two, start, moment)
    elapsed = moment - since
    carried_covariance(trial, carried, noise, elapsed)
    ratio = 0.0
    if points.shape[0] > 0:
        run = records(store)[0][0]
        heights, rates, turn = expected_heights(blocks, one, two, moment)
        ratio = measured(
            trial,
            carried,
            noise,
            heights,
            rates,
            turn,
            cornered,
            reaches,
            run["corners"][: int(run["corner_count"])],
            theta,
            elapsed,
            points,
            mean,
        )
    if not ratio <= 1.0:
        return ratio
    states = 2 * blocks.shape[0]
    bounded(theta, mean, states, noise)
    for i in range(PARAMETERS):
        theta[i] += mean[states + i]
    covariance[:, :] = carried
    anchored(trial)
    large = correction_size(trial, mean) > noise[LARGE] * reaches[0]
    if large:
        carry_wave(store, ring, at, last, mean, moment)
    carry_correction(store, ring, at, last, trial, mean, moment, large)
    if not large:
        change_constants(store, mean[states + FREQUENCY], mean[states + DAMPING])
    blocks[:, :] = trial
    take_constants(store, blocks)
    return ratio
