"""Measures governed trays and robot joints under random commands with wrong models.

    tools/run python validation/studies/governed_loads.py [--runs 500] [--half 1] [--workers 1]

Streams, liquids and delays are those of `governor.py`; every limit is checked by `simulate`,
`standing_use` and Pinocchio. *Four cups*: each drawn with its own limit, two stand loosely.
*Joints*: velocities of the arm of `six_axes.py`, that tilt the cup by some degrees. *Twist, pose*:
velocities or targets of the cup that this arm carries, from a drawn position; half of the streams
drive it out of its reach; the joints are those of `carried_joints.py`. *Without*:
acceleration and jerk alone, of the tray, the cup or of each joint. Tuned on `--half 0`.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import with_tools  # noqa: F401
from carried_joints import carried_use
from governor import (
    COMMANDS,
    DAMPING,
    FREQUENCY,
    GRID,
    PAGE,
    PERIOD,
    WATCHED,
    delays,
    drawn_commands,
    drawn_cup,
    other,
    tracked,
)
from observer_accuracy import write_table
from six_axes import UPRIGHT, six_axes

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_governor.core import Command, Governed, GovernedArm, Governor
from slosh_model import Inputs, Model, simulate
from slosh_model.standing import Standing
from slosh_model.standing_use import standing_use
from slosh_model.tray import Tray, TrayContainer
from slosh_plan.errors import SloshPlanError
from slosh_plan.heights import first_period
from slosh_plan.planning.limits import PlanLimits

FREE = 1.0
"""Limit of a height without regard to the liquid [m]."""
JOINT_SCALE = (0.7, 0.35, 0.5, 0.35, 0.5, 0.0)
"""Sizes of commanded velocities of the joints [rad/s]."""
STARTS = (1.0, 0.3, 0.25, 1.0, 1.5, 1.0)
"""By which positions of joints vary at the start, to either side [rad]."""
TILTING = 0.02
"""Speed with which the fourth and the sixth joint tilt the cup [rad/s]."""
HEAD = (
    "load", "streams", "liquids", "above a limit", "highest, of the limit",
    "friction or base, of what holds", "joints, of their limits", "without: streams above",
    "delay [s]", "without [s]", "ratio",
)  # fmt: skip


class Load(NamedTuple):
    """Containers, limits, commands and robot of one test case for the governor.

    Attributes:
        tray, limits: of the governor.
        commands: (COMMANDS, D) velocities.
        arm: its joints are commanded; None: the container is.
        carrier: its joints carry the commanded container; None: not regarded.
        targets: (COMMANDS, 3) of the container, commanded in place of the velocities [m].
    """

    tray: Tray
    limits: PlanLimits
    commands: Array
    arm: GovernedArm | None = None
    carrier: GovernedArm | None = None
    targets: Array | None = None

    def command(self, row: int, stamp_ns: int) -> Command | None:
        """Returns the command of a row with a stamp [ns]; None in a pause."""
        given = self.commands[row]
        if np.isinf(given).any():
            return None
        if self.targets is None or np.isnan(given).any():
            return Command(stamp_ns, tuple(given.tolist()))
        return Command(stamp_ns, (), tuple(self.targets[row].tolist()))


class Moves(NamedTuple):
    """Velocities, accelerations and positions (N, D) of a motion from rest, at steps of PERIOD."""

    velocity: Array
    acceleration: Array
    place: Array


def four_cups(rng: np.random.Generator) -> Load:
    """Draws four cups on a tray, two of which stand loosely."""
    cups = []
    for number in range(4):
        model, height = drawn_cup(rng)
        standing = None
        if number < 2:
            size = math.sqrt(model.container.volume / model.container.fill_height / math.pi)
            standing = Standing(
                mass=rng.uniform(0.05, 0.3), base_radius=size * rng.uniform(0.2, 0.8),
                centre_height=0.5 * model.container.fill_height, friction=rng.uniform(0.06, 0.4),
            )  # fmt: skip
        cups.append(TrayContainer(f"cup{number}", model, limit=height, standing=standing))
    speed = rng.uniform(0.1, 0.5)
    scale = speed * np.array([1.0, 1.0, 0.3 * (rng.random() < 0.3)])
    commands = drawn_commands(rng, scale, 0.2 * speed, first_period(cups[0].model))
    limits = PlanLimits(FREE, FREE, acceleration=5.0, jerk=74.0)
    return Load(Tray(tuple(cups)), limits, commands)


def of_joints(rng: np.random.Generator) -> Load:
    """Draws a cup carried by a robot arm whose joints keep the cup nearly upright."""
    model, height = drawn_cup(rng)
    scale = rng.uniform(0.5, 1.5) * np.array(JOINT_SCALE)
    commands = drawn_commands(rng, scale, 0.05, first_period(model))
    tilts = TILTING * rng.normal(size=2)
    commands[:, 3] = tilts[0] - commands[:, 1] - commands[:, 2]
    commands[:, 5] = tilts[1]
    cup = TrayContainer("", model, limit=height)
    limits = PlanLimits(FREE, FREE, acceleration=5.0, jerk=74.0)
    return Load(Tray((cup,)), limits, commands, six_axes())


def carried(rng: np.random.Generator) -> Load:
    """Draws random commanded velocities of a cup on an arm, half of them beyond its reach."""
    model, height = drawn_cup(rng)
    speed = rng.uniform(0.1, 0.5)
    commands = drawn_commands(rng, np.full(3, speed), 0.2 * speed, first_period(model))
    if rng.random() < 0.5:
        way = rng.normal(size=3)
        commands += rng.uniform(0.3, 0.8) * way / np.linalg.norm(way)
    start = np.array(UPRIGHT) + rng.uniform(-1.0, 1.0, 6) * STARTS
    cup = TrayContainer("", model, limit=height)
    limits = PlanLimits(FREE, FREE, acceleration=5.0, jerk=74.0)
    return Load(Tray((cup,)), limits, commands, carrier=six_axes(start.tolist()))


def carried_to_targets(rng: np.random.Generator) -> Load:
    """Draws random commanded positions of a cup on an arm."""
    load = carried(rng)
    steps = np.nan_to_num(load.commands, nan=0.0, posinf=0.0)
    return load._replace(targets=PERIOD * np.cumsum(steps, axis=0))


LOADS = {
    "four cups": four_cups, "joints": of_joints, "twist, robot": carried,
    "pose, robot": carried_to_targets,
}  # fmt: skip


def governor_of(load: Load, period: float) -> Governor:
    """Creates the governor of a test case, with a step period [s]."""
    return Governor(
        load.tray, load.limits, period=period, arm=load.arm, carrier=load.carrier, at_rest=True
    )


def begun(load: Load, steps: int) -> tuple[Governor, list[Governed]]:
    """Returns the governor after a number of steps of a case's commands, and these steps."""
    governor, told = governor_of(load, PERIOD), []
    for step in range(steps):
        now = 1 + step * round(PERIOD * SECOND)
        command = load.command(step, now)
        if command is not None:
            governor.take(command)
        told.append(governor.step(now))
    return governor, told


def moves_of(load: Load, told: list[Governed]) -> Moves:
    """Returns velocities, accelerations and positions of the governor's steps."""
    rows = [
        (one.velocity, one.acceleration, one.position) if load.arm is None else one.joints
        for one in told
    ]
    start = np.zeros(3) if load.arm is None else load.arm.start
    still = np.zeros(len(start))
    columns = (
        np.array([first, *(row[k] for row in rows)])
        for k, first in enumerate((still, still, start))
    )
    return Moves(*columns)


def unregarded(load: Load, commands: Array, before: Moves | None = None) -> Moves:
    """Returns a motion that follows the commands and then stops, without regard to the liquid.

    Args:
        load: the limits of acceleration and jerk; of joints each by its own.
        commands: (N, D) velocities.
        before: what it goes on from; None: rest.
    """
    size = commands.shape[1]
    last = (
        [np.zeros(size)] * 2 if before is None else [before.velocity[-1], before.acceleration[-1]]
    )
    parts = [slice(0, size)] if load.arm is None else [slice(k, k + 1) for k in range(size)]
    found = []
    for k, part in enumerate(parts):
        limits = load.limits
        if load.arm is not None:
            own = load.arm.limits
            limits = replace(limits, acceleration=own.acceleration[k], jerk=own.jerk[k])
        velocity, acceleration = (one[part].tolist() for one in last)
        found.append(tracked(commands[:, part], limits, velocity, acceleration))
    count = max(len(acceleration) for _, acceleration in found)
    columns = [
        np.concatenate(
            [np.pad(one[n], ((0, count - len(one[n])), (0, 0))) for one in found], axis=1
        )
        for n in range(2)
    ]
    past = Moves(*[np.zeros((1, size))] * 3) if before is None else before
    velocity, acceleration = (
        np.concatenate([old, new]) for old, new in zip(past[:2], columns, strict=True)
    )
    start = np.zeros(size) if load.arm is None else load.arm.start
    steps = 0.5 * PERIOD * (velocity[1:] + velocity[:-1])
    place = np.concatenate([start[np.newaxis], start + np.cumsum(steps, axis=0)])
    return Moves(velocity, acceleration, place)


def inputs_of(load: Load, moves: Moves) -> Inputs:
    """Returns the motion of the container or tray as simulation input, with a rest at its end."""
    t: Array = PERIOD * np.arange(len(moves.place), dtype=np.float64)
    if load.arm is not None:
        velocity, acceleration, place = moves
        motion = load.arm.arm.motion(t, load.arm.limits.names, place, velocity, acceleration)
        return motion.inputs(WATCHED, 0.002)
    rows = np.concatenate([moves.acceleration, np.zeros((round(WATCHED / PERIOD), 3))])
    t = PERIOD * np.arange(len(rows), dtype=np.float64)
    return Inputs(t, rows).resampled(np.arange(0.0, t[-1], 0.002))


def highest(load: Load, moves: Moves, pairs: list[tuple[float, float]]) -> Array:
    """Returns the greatest height and use of friction or base, as fractions of their limits."""
    inputs, found = inputs_of(load, moves), np.zeros(2)
    for cup in load.tray.containers:
        for pair in pairs:
            liquid: Model = other(cup.model, *pair)
            liquid = liquid if load.arm is None else liquid.with_gravity_tilt()
            found[0] = max(found[0], simulate(liquid, inputs)[0].msh.max() / cup.limit)
            if cup.standing is not None:
                found[1] = max(found[1], *standing_use(liquid, cup.standing, inputs))
    return found


def joint_use(load: Load, moves: Moves) -> float:
    """Returns the largest fraction of a joint limit: position, velocity, acceleration or jerk."""
    if load.carrier is not None:
        return carried_use(load.carrier, *moves, PERIOD)
    if load.arm is None:
        return 0.0
    limits = load.arm.limits
    middle, half = 0.5 * (limits.upper + limits.lower), 0.5 * (limits.upper - limits.lower)
    parts = (
        (moves.place - middle) / half, moves.velocity / limits.velocity,
        moves.acceleration / limits.acceleration,
        np.diff(moves.acceleration, axis=0) / PERIOD / limits.jerk,
    )  # fmt: skip
    return max(float(np.abs(part).max()) for part in parts)


def drawn_pairs(rng: np.random.Generator, count: int) -> list[tuple[float, float]]:
    """Draws random errors of natural frequency and damping ratio."""
    return [
        (1.0 + FREQUENCY * rng.uniform(-1.0, 1.0), DAMPING ** rng.uniform(-1.0, 1.0))
        for _ in range(count)
    ]


def run(name: str, seed: int) -> tuple[float, ...]:
    """Governs one case; returns used fractions of limits, delays [s] and number of liquids."""
    rng = np.random.default_rng(seed)
    load = LOADS[name](rng)
    pairs = drawn_pairs(rng, 4) + GRID
    governor, told = begun(load, COMMANDS)
    moves = moves_of(load, told + governor.stopped())
    free = unregarded(load, load.commands)
    heights = highest(load, moves, pairs)
    try:
        blind = highest(load, free, pairs[:1])
    except SloshPlanError:  # far beyond the range of a joint
        blind = np.full(2, math.inf)
    if load.carrier is not None:
        blind[1] = joint_use(load, free)
    return (
        *heights, joint_use(load, moves), blind.max(),
        delays(load.commands, moves.velocity[1:]),
        delays(load.commands, free.velocity[1:]), len(pairs) * len(load.tray.containers),
    )  # fmt: skip


def row(name: str, runs: Array) -> str:
    """Formats the results (N, 7) of `run` as a table row."""
    peak, use, joints, blind, delay, free, liquids = runs.T
    steps = np.isfinite(delay) & np.isfinite(free)
    above = np.count_nonzero((np.maximum(peak, use) > 1.0) | (joints > 1.0 + 1e-6))
    ratio = np.median(delay[steps] / np.maximum(free[steps], PERIOD))
    return (
        f"| {name} | {len(runs)} | {int(liquids.sum())} | {above} | {peak.max():.3f} "
        f"| {f'{use.max():.3f}' if use.max() else '–'} "
        f"| {f'{joints.max():.3f}' if joints.max() else '–'} "
        f"| {100 * np.mean(blind > 1.0):.0f} % | {np.median(delay[steps]):.2f} "
        f"| {np.median(free[steps]):.2f} | {ratio:.2f} |"
    )


def main() -> int:
    """Measures and prints the table."""
    rows = [(partial(run, name), partial(row, name)) for name in LOADS]
    return write_table(__doc__, "loads", HEAD, rows, PAGE)


if __name__ == "__main__":
    sys.exit(main())
