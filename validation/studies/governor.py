"""Measures the governor: heights under random commands with wrong models.

    tools/run python validation/studies/governor.py [--runs 5000] [--half 1] [--workers 1]

A stream of commands is 3 s, at 50 Hz, of steps, ramps, swings and jitter, with pauses and NaN;
cup, limit and liquid are drawn, too. The liquid's frequency is up to 3 % off, its damping by a
factor of up to 2. The governed motion is simulated with 12 such liquids: 4 drawn ones, 8 on a
grid; with an observer by the one that it sees, 40 ms late, with an error of 0.3 mm. *Without*
keeps acceleration and jerk alone. *Delay* is the time until 90 % of a
changed velocity. In the last row up to a fifth of the steps is left out, and each comes up to a
fifth of a period late. Tuned on `--half 0`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import with_tools  # noqa: F401
from camera_sequences import ROOT
from observer_accuracy import write_table

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_governor.core import Command, Governed, Governor, SeenLiquid
from slosh_governor.governed_cup import GovernedCup, GovernedStep
from slosh_model import Cylinder, Inputs, Model, Rectangle, wall_heights
from slosh_model.containers import Container
from slosh_model.simulate import Simulator
from slosh_plan.heights import first_period, msh_of
from slosh_plan.planning.limits import PlanLimits

PAGE = ROOT / "docs" / "governor.md"
PERIOD, COMMANDS, WATCHED = 0.02, 150, 3.0
FREQUENCY, DAMPING = 0.03, 2.0
GRID = [(1.0 + FREQUENCY * part, 1.0 / DAMPING) for part in (-1.0, -0.75, -0.25, 0.25, 0.75, 1.0)]
GRID += [(0.97, 2.0), (1.03, 2.0)]
LATE, NOISE, ALIKE = 2, 3e-4, 0.94
FINE = 0.002
"""Time between two simulated heights [s]."""
OPEN, OBSERVED, UNEVEN = "open loop", "observed", "open loop, steps late or left out"
HEAD = (
    "liquid", "streams", "liquids", "above the limit", "highest, of the limit",
    "without: streams above", "delay [s]", "without [s]", "ratio", "margin, of the limit",
)  # fmt: skip


class Stream(NamedTuple):
    """A cup with its height limit, and a sequence of commands to the governor."""

    model: Model
    limits: PlanLimits
    commands: Array


def drawn_cup(rng: np.random.Generator) -> tuple[Model, float]:
    """Draws a container model and a height limit [m]."""
    if rng.random() < 0.7:
        radius = rng.uniform(0.03, 0.06)
        size = radius
        container: Container = Cylinder(radius, radius * rng.uniform(1.0, 2.0))
    else:
        width = rng.uniform(0.06, 0.12)
        size = width / 2.0
        container = Rectangle(width, width * rng.uniform(0.6, 1.0), width * rng.uniform(0.5, 1.0))
    model = Model(container).with_effect("vertical_acceleration").nonlinear()
    return model, size * rng.uniform(0.12, 0.35)


def drawn(rng: np.random.Generator) -> Stream:
    """Draws a cup and its velocity commands (COMMANDS, 3) [m/s], with NaN and pauses."""
    model, height = drawn_cup(rng)
    limits = PlanLimits(height, acceleration=5.0, jerk=74.0)
    speed = rng.uniform(0.1, 0.5)
    scale = speed * np.array([1.0, 1.0, 0.3 * (rng.random() < 0.3)])
    return Stream(model, limits, drawn_commands(rng, scale, 0.2 * speed, first_period(model)))


def drawn_commands(rng: np.random.Generator, scale: Array, jitter: float, period: float) -> Array:
    """Draws commands (COMMANDS, D) of a given size, oscillating near a period [s]; see `drawn`."""
    count = len(scale)
    commands, t = np.zeros((COMMANDS, count)), PERIOD * np.arange(COMMANDS)
    at = 0
    while at < COMMANDS:
        until = min(at + int(rng.uniform(0.1, 1.2) / PERIOD), COMMANDS)
        part, kind = slice(at, until), rng.integers(0, 5)
        one, other = rng.normal(size=count) * scale, rng.normal(size=count) * scale
        u = np.linspace(0.0, 1.0, until - at)[:, np.newaxis]
        swing = rng.uniform(0.7, 1.3) / period
        choices = (
            one + 0.0 * u, one + (other - one) * u, 0.0 * u * one,
            one * np.sin(2.0 * np.pi * swing * t[part])[:, np.newaxis],
            one + jitter * rng.normal(size=(until - at, count)),
        )  # fmt: skip
        commands[part] = choices[kind]
        at = until
    commands[rng.random(COMMANDS) < 0.002] = np.nan
    if rng.random() < 0.2:
        begin = rng.integers(0, COMMANDS)
        commands[begin : begin + round(0.3 / PERIOD)] = np.inf
    return commands


def other(model: Model, frequency: float, damping: float) -> Model:
    """Returns a model with natural frequency and damping ratio multiplied by factors."""
    first = model.mode_constants()[0]
    return replace(
        model,
        natural_frequency=model.mode_frequency(1) * frequency,
        damping_ratio=first.damping_ratio * damping,
    )


def governed(
    stream: Stream, limits: PlanLimits, truth: Model | None, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Returns velocity, acceleration (N, 3) and height margin (N,) of a governed motion."""
    governor = Governor(stream.model, limits, period=PERIOD, at_rest=True)
    liquid = None if truth is None else Simulator(truth)
    error = np.zeros(4)
    told: list[Governed] = []
    seen = [np.zeros((stream.model.modes, 4))]
    if liquid is not None:
        liquid.step(0.0, 0.0, 0.0, 0.0)
    step = 0
    while step < COMMANDS or (told[-1].rest > 0.0 and step < 2 * COMMANDS):
        now = 1 + step * round(PERIOD * SECOND)
        row = stream.commands[step] if step < COMMANDS else np.full(3, np.inf)
        if not np.isinf(row).any():
            governor.take(Command(now, tuple(row)))
        if liquid is not None and truth is not None and step >= LATE:
            factor = truth.mode_frequency(1) / stream.model.mode_frequency(1)
            gain = truth.height_gains()[0]
            scale = NOISE / gain * np.array([1.0, 1.0, *2 * [truth.mode_frequency(1)]])
            error = ALIKE * error + math.sqrt(1.0 - ALIKE**2) * scale * rng.normal(size=4)
            late = now - LATE * round(PERIOD * SECOND)
            governor.see(SeenLiquid(late, seen[-1 - LATE] + error, NOISE, factor, 0.0))
        told.append(governor.step(now))
        if liquid is not None:
            liquid.step(PERIOD, *told[-1].acceleration)
            seen.append(liquid.modal)
        step += 1
    columns = (
        [one.velocity for one in told], [one.acceleration for one in told],
        [one.margin for one in told],
    )  # fmt: skip
    return tuple(np.array(column) for column in columns)  # type: ignore[return-value]


def unevenly_governed(stream: Stream, rng: np.random.Generator) -> tuple[Array, Inputs, Array]:
    """Returns velocity at each command (N, 3), the motion, and height margins (M,)."""
    governor = Governor(stream.model, stream.limits, period=PERIOD, at_rest=True)
    cup = GovernedCup(stream.model, 1.0 / FINE, PERIOD)
    many = np.where(rng.random(4 * COMMANDS) < rng.uniform(0.0, 0.2), 2, 1)
    times = PERIOD * (np.cumsum(many) + rng.uniform(0.0, 0.2, len(many)))
    told: list[Governed] = []
    samples = [(0.0, np.zeros(3))]
    for t in times.tolist():
        index = int(t / PERIOD)
        row = stream.commands[index] if index < COMMANDS else np.full(3, np.inf)
        now = 1 + round(t * SECOND)
        if not np.isinf(row).any():
            governor.take(Command(now, tuple(row)))
        one = governor.step(now)
        told.append(one)
        reached = GovernedStep(one.steps, t, np.array(one.velocity), np.array(one.acceleration))
        samples += [(moved.t, moved.acceleration) for moved in cup.move(reached)]
        if index >= COMMANDS and one.rest == 0.0:
            break
    velocity = np.array([one.velocity for one in told])
    grid = PERIOD * np.arange(COMMANDS + 1)
    at = [np.interp(grid, times[: len(told)], column) for column in velocity.T]
    rest = [(samples[-1][0] + FINE * k, np.zeros(3)) for k in range(1, round(WATCHED / FINE))]
    t, acceleration = zip(*(samples + rest), strict=True)
    motion = Inputs(np.array(t), np.array(acceleration))
    return np.column_stack(at), motion, np.array([one.margin for one in told])


def tracked(
    commands: Array,
    limits: PlanLimits,
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
    acceleration: Sequence[float] = (0.0, 0.0, 0.0),
) -> tuple[Array, Array]:
    """Returns velocity and acceleration (N, 3) of a motion that follows commands, then stops.

    They keep acceleration and jerk alone; what is no number is a stop.
    """
    v, a = np.array(velocity), np.array(acceleration)
    rows: list[tuple[Array, Array]] = []
    step, wanted = limits.jerk * PERIOD, np.where(np.isfinite(commands), commands, 0.0)
    while len(rows) < len(wanted) or np.linalg.norm(v) > 1e-4 or np.linalg.norm(a) > 1e-3:
        goal = wanted[len(rows)] if len(rows) < len(wanted) else 0.0 * v
        left = goal - v - 0.5 * PERIOD * a
        size = max(float(np.linalg.norm(left)), 1e-12)
        most = min(math.sqrt(step**2 + 2.0 * limits.jerk * size) - step, limits.acceleration)
        change = left / size * most - a
        change *= min(1.0, step / max(float(np.linalg.norm(change)), 1e-12))
        v = v + PERIOD * (a + 0.5 * change)
        a = a + change
        rows.append((v, a))
    return np.array([one for one, _ in rows]), np.array([*(one for _, one in rows), 0.0 * v])


def highest(models: list[Model], acceleration: Array) -> float:
    """Returns the greatest height [m] of a motion over all liquids, sampled every 2 ms."""
    rest = np.zeros((round(WATCHED / PERIOD), 3))
    rows = np.concatenate([np.zeros((1, 3)), acceleration, rest])
    t: Array = PERIOD * np.arange(len(rows), dtype=np.float64)
    inputs = Inputs(t, rows)
    return highest_of(models, inputs.resampled(np.arange(0.0, inputs.t[-1], FINE)))


def highest_of(models: list[Model], motion: Inputs) -> float:
    """Returns the greatest height [m] at the samples of a motion over all liquids."""
    found = wall_heights(models, motion, threads=1)
    return max(float(msh_of(models[0].container, one).max()) for one in found)


def delays(commands: Array, velocity: Array) -> float:
    """Returns the median time [s] until 90 % of a lasting change of velocity; NaN if none."""
    found = []
    with np.errstate(invalid="ignore"):
        steps = np.linalg.norm(np.diff(commands, axis=0), axis=1)
    changes = np.flatnonzero(steps > 0.05) + 1
    for at, until in zip(changes, [*changes, COMMANDS][1:], strict=True):
        if (until - at) * PERIOD < 0.4 or not np.isfinite(commands[at:until]).all():
            continue
        change = commands[at] - velocity[at - 1]
        size = float(change @ change)
        if size < 0.05**2 or np.ptp(commands[at:until], axis=0).max() > 0:
            continue
        done = (velocity[at:] - velocity[at - 1]) @ change >= 0.9 * size
        found.append(PERIOD * (np.argmax(done) if done.any() else until - at))
    return float(np.median(found)) if found else math.nan


def run(kind: str, seed: int) -> tuple[float, ...]:
    """Returns heights with and without governor, delays [s] and margin, relative to the limit."""
    rng = np.random.default_rng(seed)
    stream = drawn(rng)
    pairs = [
        (1.0 + FREQUENCY * rng.uniform(-1.0, 1.0), DAMPING ** rng.uniform(-1.0, 1.0))
        for _ in range(4)
    ]
    chosen = pairs[:1] if kind == OBSERVED else pairs + GRID
    liquids = [other(stream.model, *pair) for pair in chosen]
    if kind == UNEVEN:
        velocity, motion, margins = unevenly_governed(stream, rng)
        peak = highest_of(liquids, motion)
    else:
        truth = liquids[0] if kind == OBSERVED else None
        velocity, acceleration, margins = governed(stream, stream.limits, truth, rng)
        peak = highest(liquids, acceleration)
    limit = stream.limits.height
    free, pushed = tracked(stream.commands, stream.limits)
    return (
        peak / limit, highest(liquids, pushed) / limit,
        delays(stream.commands, velocity), delays(stream.commands, free),
        float(np.median(margins)) / limit, len(liquids),
    )  # fmt: skip


def row(kind: str, runs: Array) -> str:
    """Formats the results (N, 6) of `run` as a table row."""
    peak, blind, delay, free, margin, liquids = runs.T
    steps = np.isfinite(delay) & np.isfinite(free)
    above = np.mean(blind > 1.0)
    ratio = np.median(delay[steps] / np.maximum(free[steps], PERIOD))
    return (
        f"| {kind} | {len(runs)} | {int(liquids.sum())} "
        f"| {int((peak > 1.0).sum())} | {peak.max():.3f} | {100 * above:.0f} % "
        f"| {np.median(delay[steps]):.2f} | {np.median(free[steps]):.2f} | {ratio:.2f} "
        f"| {np.median(margin):.2f} |"
    )


def main() -> int:
    """Simulates all random commands and writes the table; returns the exit code."""
    rows = [(partial(run, kind), partial(row, kind)) for kind in (OPEN, OBSERVED, UNEVEN)]
    return write_table(__doc__, "governor", HEAD, rows, PAGE)


if __name__ == "__main__":
    sys.exit(main())
