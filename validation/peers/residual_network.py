"""Trains a small neural network in the base model's equation through the integrator.

What it closes of the gap bounds what any equation of these inputs can close; it names nothing.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.gap import closed_share
from validation.blind.truth import simulate
from validation.blind.truth_model import Truth
from validation.peers.chosen import Job, case_of
from validation.peers.drive import GRAVITY, drive_at
from validation.peers.oracle import Latent, base_of, oracle, wall_gain
from validation.peers.rows import Row

jax.config.update("jax_enable_x64", True)

Array = NDArray[np.float64]
HIDDEN = 8
FRAME = 1.0 / 60.0
"""Between two heights [s]."""
STEPS = 2
"""Of the integration, in a frame."""
STEP = FRAME / STEPS
PRIOR = 0.3
"""Deviation that is expected of a weight; of the output's, in m/s²."""
ITERATIONS = 15
ENOUGH = 1e-4
"""An iteration that lowers the cost by a smaller share is the last."""


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Inputs, true states and heights of several motions, padded to one length.

    Attributes:
        start: (M, 4) true states at the start.
        base: (M, 2 S + 1, 8) the base's ω², 2ζω, c, its spring's cubic share over R² and its
            vertical share, felt acceleration x, y, z; at half steps.
        extra: (M, 2 S + 1, I) what the network gets beside the state.
        heights: (M, F, 2) true wall heights along axes that do not yaw [m], NaN: padding.
        scale: (4,) by which the network's states are divided.
        gain: height at the wall over the coordinate.
    """

    start: Array
    base: Array
    extra: Array
    heights: Array
    scale: Array
    gain: float


def ask_network(job: Job) -> Row:
    """Trains a network on a test case; returns the error share that it removes.

    Trained on wall heights at 60 Hz with the case's own noise.
    """
    start = time.process_time()
    case = case_of(job)
    base = base_of(case)
    fit, held_out = oracle(case)
    batch = batch_of(case.truth, base, [*fit, *held_out])
    used = np.any(batch.extra != 0.0, axis=(0, 1))
    extra = batch.extra[:, :, used]
    random = np.random.default_rng(job[1])
    weights = first_weights(random, extra.shape[2])
    measured = batch.heights + random.normal(0.0, case.noise, batch.heights.shape)
    count = len(fit)
    weights, iterations = trained(weights, batch, extra, measured, case.noise, count)
    none = np.zeros_like(weights)
    before, after = (np.asarray(_heights(each, batch, extra)) for each in (none, weights))
    return {
        "case": case.name,
        "kind": case.kind,
        "hidden": list(case.hidden),
        "noise": case.noise,
        "weights": len(weights),
        "iterations": iterations,
        "fit_closed": _share(batch.heights[:count], before[:count], after[:count], case.noise),
        "closed": _share(batch.heights[count:], before[count:], after[count:], case.noise),
        "cpu_seconds": round(time.process_time() - start, 1),
    }


def batch_of(truth: Truth, base: Truth, motions: Sequence[Latent]) -> Batch:
    """Creates the network's data from motions, with true heights."""
    frames = [int((motion.t[-1] - motion.t[0]) / FRAME) for motion in motions]
    most = max(frames)
    rows, extras, heights = [], [], []
    for motion, count in zip(motions, frames, strict=True):
        halves = motion.t[0] + 0.5 * STEP * np.arange(2 * STEPS * most + 1)
        drive = drive_at(base, motion.inputs, np.minimum(halves, motion.t[-1]))
        spring = (drive.alpha / drive.radius**2, drive.vertical)
        columns = (drive.squared, drive.damping, drive.curvature, *spring)
        rows.append(np.column_stack([*columns, drive.felt]))
        turn = np.column_stack([drive.spin, drive.spin_rate / 10.0])
        arms = drive.arms[:, :, :2].reshape(-1, 6)
        shown = (drive.felt / 5.0, drive.lean[:, :2], turn, arms / 5.0, drive.t[:, None] / 5.0)
        extras.append(np.column_stack(shown))
        wave = simulate(truth, motion.inputs)
        times = motion.t[0] + FRAME * np.arange(1, most + 1)
        true = np.column_stack([np.interp(times, wave.t, one) for one in wave.height.T])
        true[count:] = np.nan
        heights.append(true)
    start = np.array([np.concatenate([motion.q[0], motion.v[0]]) for motion in motions])
    omega = float(np.sqrt(motions[0].drive.squared[0]))
    size = 0.3 * base.radius * np.array([1.0, 1.0, omega, omega])
    return Batch(start, np.array(rows), np.array(extras), np.array(heights), size, wall_gain(base))


def first_weights(random: np.random.Generator, extra: int) -> Array:
    """Draws small initial weights; those of the direct linear part are zero."""
    inputs = 4 + extra + 1
    direct = np.zeros(2 * inputs)
    hidden = random.normal(0.0, 0.5 / np.sqrt(inputs), HIDDEN * inputs)
    return np.concatenate([direct, hidden, random.normal(0.0, 0.05, 2 * HIDDEN)])


def trained(
    weights: Array, batch: Batch, extra: Array, measured: Array, noise: float, count: int
) -> tuple[Array, int]:
    """Trains the weights by Levenberg-Marquardt; keeps those best for a validation motion.

    The last motion is not learned from: kept are the weights of the iteration that suited it best.

    Args:
        weights: at the start.
        batch, extra: the motions.
        measured: (M, F, 2) heights with noise.
        noise: their standard deviation [m].
        count: so many motions from the first are for training.
    """
    seen = np.isfinite(measured[:count])
    goal = np.where(seen, measured[:count], 0.0)
    part = Batch(
        batch.start[:count], batch.base[:count], extra[:count], goal, batch.scale, batch.gain
    )

    def errors(at: Any) -> Any:
        return jnp.where(seen, _heights(at, part, part.extra) - goal, 0.0) / noise

    def learned(at: Any) -> Any:
        return errors(at)[:-1].ravel()

    def normal(at: Any) -> Any:
        slopes, value = jax.jacfwd(lambda w: (learned(w),) * 2, has_aux=True)(at)
        return slopes.T @ slopes, slopes.T @ value

    def costs(at: Any) -> Any:
        squares = jnp.sum(errors(at) ** 2, axis=(1, 2))
        return jnp.sum(squares[:-1]) + jnp.sum((at / PRIOR) ** 2), squares[-1]

    return _levenberg(weights, jax.jit(costs), jax.jit(normal))


def _levenberg(weights: Array, costs: Any, normal: Any) -> tuple[Array, int]:
    """Minimises one cost; returns the weights with the lowest second cost along the way."""
    none = np.zeros_like(weights)
    best, least = none, float(costs(none)[1])
    cost, damping = float(costs(weights)[0]), 1.0
    for iteration in range(1, ITERATIONS + 1):
        matrix, slope = (np.asarray(each) for each in normal(weights))
        matrix = matrix + np.eye(len(weights)) / PRIOR**2
        slope = slope + weights / PRIOR**2
        before = cost
        for _ in range(8):
            damped = matrix + damping * np.diag(np.diag(matrix))
            tried = weights - np.linalg.solve(damped, slope)
            new, check = map(float, costs(tried))
            if new < cost:  # not where it is NaN
                weights, cost, damping = tried, new, damping / 5.0
                if check < least:
                    best, least = tried, check
                break
            damping *= 5.0
        if before - cost <= ENOUGH * before:
            return best, iteration
    return best, ITERATIONS


def _heights(weights: Any, batch: Batch, extra: Array) -> Any:
    """Simulates the wall heights (M, F, 2) of all motions with the network [m]."""
    frames = (batch.base.shape[1] - 1) // (2 * STEPS)
    one = jax.vmap(lambda *motion: _run(weights, jnp.asarray(batch.scale), *motion))
    states = one(batch.start, jnp.asarray(batch.base), jnp.asarray(extra))
    return batch.gain * states[:, STEPS - 1 :: STEPS, :2][:, :frames]


def _run(weights: Any, scale: Any, start: Any, base: Any, extra: Any) -> Any:
    """Integrates the states (S, 4) of one motion with the network by Runge-Kutta."""

    def step(state: Any, rows: Any) -> Any:
        first = _slope(weights, scale, state, *rows[0])
        second = _slope(weights, scale, state + 0.5 * STEP * first, *rows[1])
        third = _slope(weights, scale, state + 0.5 * STEP * second, *rows[1])
        fourth = _slope(weights, scale, state + STEP * third, *rows[2])
        following = state + STEP / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        return following, following

    each = tuple((base[k:last:2], extra[k:last:2]) for k, last in ((0, -1), (1, None), (2, None)))
    return jax.lax.scan(step, start, each)[1]


def _slope(weights: Any, scale: Any, state: Any, base: Any, extra: Any) -> Any:
    q, v = state[:2], state[2:]
    squared, damping, curvature, cubic, vertical = base[:5]
    c2 = curvature**2
    spring = squared * (1.0 + cubic * (q @ q) + vertical * base[7] / GRAVITY)
    momentum = v + c2 * (q @ v) * q
    rest = -c2 * (v @ v) * q - damping * momentum - spring * q - base[5:7]
    rest = rest + _network(weights, jnp.concatenate([state / scale, extra]))
    acceleration = rest - c2 * (q @ rest) / (1.0 + c2 * (q @ q)) * q
    return jnp.concatenate([v, acceleration])


def _network(weights: Any, values: Any) -> Any:
    """Evaluates the network: an acceleration (2,) [m/s²] from a linear and a hidden layer."""
    values = jnp.concatenate([values, jnp.ones(1)])
    width = len(values)
    direct = weights[: 2 * width].reshape(2, width)
    hidden = weights[2 * width : (2 + HIDDEN) * width].reshape(HIDDEN, width)
    last = weights[(2 + HIDDEN) * width :].reshape(2, HIDDEN)
    return direct @ values + last @ jnp.tanh(hidden @ values)


def _share(true: Array, before: Array, after: Array, noise: float) -> float | None:
    """Returns the removed share of the maximum height's error; None if noise would hide it."""
    shown = np.isfinite(true[..., 0])
    size = np.linalg.norm(true, axis=-1)[shown]
    rms = [
        float(np.sqrt(np.mean((np.linalg.norm(each, axis=-1)[shown] - size) ** 2)))
        for each in (before, after)
    ]
    earlier, later = (float(np.hypot(each, noise)) for each in rms)
    share = closed_share(earlier, later, noise, int(shown.sum()))
    return share if np.isfinite(share) else None
