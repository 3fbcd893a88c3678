"""Computes how much of the height error a found equation removes on held-out motions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.gap import closed_share
from validation.blind.truth_model import Truth
from validation.peers.drive import Drive, drive_at
from validation.peers.library import EFFECT_OF, TERMS, solved
from validation.peers.oracle import Latent, wall_gain

Array = NDArray[np.float64]
STEP = 0.008
"""Of the integration [s]; the first mode's period is 0.3 s and more."""
SURFACE = "surface_nonlinearity"
FAR = 1.0
"""A mass that is farther off has left every cup; there it stays [m]."""


def closed(base: Truth, held_out: Sequence[Latent], coefficients: Array) -> list[float]:
    """Returns for each model the removed share of the maximum height's error; NaN if no error.

    Each model starts in the true state and runs on the true inputs; compared are heights without
    noise. The ratio of height to coordinate is the base model's, and that of a nonlinear surface
    where the model says one.

    Args:
        base: the model that was given.
        held_out: motions that nothing was fitted to.
        coefficients: (M, TERMS).
    """
    models = np.concatenate([np.zeros((1, len(TERMS))), coefficients])
    squares, samples = np.zeros(len(models)), 0
    for motion in held_out:
        times, heights = heights_of(base, motion, models)
        true = np.interp(times, motion.t, motion.msh)
        squares += np.sum((heights - true[:, np.newaxis]) ** 2, axis=0)
        samples += len(times)
    rms = np.sqrt(squares / samples)
    return [closed_share(float(rms[0]), float(after), 0.0, samples) for after in rms[1:]]


def heights_of(base: Truth, motion: Latent, models: Array) -> tuple[Array, Array]:
    """Simulates M models on a motion; returns times (S,) [s] and heights (S, M) [m]."""
    steps = int((motion.t[-1] - motion.t[0]) / STEP)
    times = motion.t[0] + STEP * np.arange(steps + 1)
    halves = motion.t[0] + 0.5 * STEP * np.arange(2 * steps + 1)
    drive = drive_at(base, motion.inputs, halves)
    state = np.repeat(np.concatenate([motion.q[:1], motion.v[:1]], axis=1), len(models), axis=0)
    heights = np.empty((steps + 1, len(models)))
    heights[0] = np.hypot(state[:, 0], state[:, 1])
    for step in range(steps):
        state = _step(drive, 2 * step, state, models)
        heights[step + 1] = np.hypot(state[:, 0], state[:, 1])
    return times, _gains(base, models) * heights


def _gains(base: Truth, models: Array) -> Array:
    """Returns each model's wall height per modal displacement |q|, (M,)."""
    curved = base.plus(SURFACE, {})
    bends = np.array([effect == SURFACE for effect in EFFECT_OF.values()])
    said = np.any(models[:, bends] != 0.0, axis=1)
    return np.where(said, wall_gain(curved), wall_gain(base))


def _step(drive: Drive, index: int, state: Array, models: Array) -> Array:
    """Makes one classical Runge-Kutta step of all models; inputs are given at half steps."""
    start, middle, end = (drive.row(index + k) for k in range(3))

    def slope(row: Drive, at: Array) -> Array:
        acceleration = solved(row, at[:, :2], at[:, 2:], models)
        return np.concatenate([at[:, 2:], acceleration], axis=1)

    first = slope(start, state)
    second = slope(middle, state + 0.5 * STEP * first)
    third = slope(middle, state + 0.5 * STEP * second)
    fourth = slope(end, state + STEP * third)
    following = state + STEP / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
    return np.clip(np.nan_to_num(following, nan=FAR), -FAR, FAR)
