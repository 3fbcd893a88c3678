"""Measures emergency stops of the governor and plain stops: time, distance and height.

    tools/run python validation/studies/emergency_stop.py [--runs 100] [--half 1] [--workers 1]

Cups move by the streams of `governor.py` and are stopped at a random moment, in one of two ways:
by the governor, and without regard to the liquid, as fast as acceleration and jerk allow.
*Joints*: those of `governed_loads.py`, each as fast as its own limits allow. The liquid's
frequency and damping are wrong as there. Rows of medians; *above* counts stops whose height
exceeds the limit, which the motion before kept.
"""

from __future__ import annotations

import copy
import math
import sys
from functools import partial

import numpy as np
import with_tools  # noqa: F401
from governed_loads import begun, drawn_pairs, joint_use, moves_of, of_joints, unregarded
from governed_loads import highest as highest_of
from governor import COMMANDS, DAMPING, FREQUENCY, PAGE, PERIOD, drawn, highest, other, tracked
from observer_accuracy import write_table

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_governor.core import Command, Governed, Governor

HEAD = (
    "stop",
    "stops",
    "time [s]",
    "distance [mm]",
    "above",
    "highest, of the limit",
    "joints, of their limits",
)
WAYS = ("governor", "without the liquid")
JOINT_WAYS = ("joints: governor", "joints: without the liquid")
LEAST = 0.1
"""Speed of a container that is stopped [m/s]."""
TURN = PERIOD * SECOND


def moving(seed: int) -> tuple[Governor, list[Governed], np.random.Generator] | None:
    """Returns a governor during a random motion, or None if the motion is too slow."""
    rng = np.random.default_rng(seed)
    stream = drawn(rng)
    governor, told = Governor(stream.model, stream.limits, period=PERIOD, at_rest=True), []
    for step, row in enumerate(stream.commands[: int(rng.integers(50, COMMANDS))], 1):
        if np.isfinite(row).all():
            governor.take(Command(round(step * TURN), tuple(row)))
        told.append(governor.step(round(step * TURN)))
    return (governor, told, rng) if np.linalg.norm(told[-1].velocity) > LEAST else None


def stop_of(governor: Governor, told: list[Governed], way: str) -> Array:
    """Returns the accelerations (N, 3) [m/s²] of a stop at the governor's rate."""
    limits, before = governor.limits, told[-1]
    if way == "governor":
        return np.array([one.acceleration for one in copy.deepcopy(governor).stopped()])
    return tracked(np.empty((0, 3)), limits, before.velocity, before.acceleration)[1]


def run_joints(way: str, seed: int) -> tuple[float, float, float, float]:
    """Simulates one stop of an arm with commanded joints; returns the same values as `run`."""
    rng = np.random.default_rng(seed)
    load = of_joints(rng)
    governor, told = begun(load, int(rng.integers(50, COMMANDS)))
    if np.linalg.norm(told[-1].velocity) <= LEAST:
        return math.nan, math.nan, 0.0, 0.0
    before = moves_of(load, told)
    if way == JOINT_WAYS[0]:
        moves = moves_of(load, told + governor.stopped())
    else:
        moves = unregarded(load, np.empty((0, len(load.commands[0]))), before)
    (pair,) = drawn_pairs(rng, 1)
    arm = governor.arm
    assert arm is not None
    place, _ = arm.arm.poses(arm.limits.names, moves.place[len(before.place) - 1 :])
    gone = np.linalg.norm(np.diff(place, axis=0), axis=1).sum()
    count = len(moves.place) - len(before.place)
    height = highest_of(load, moves, [pair])[0]
    return count * PERIOD, float(gone), float(height), joint_use(load, moves)


def run(way: str, seed: int) -> tuple[float, float, float, float]:
    """Simulates one stop: time [s], distance [m], fractions of the height and joint limits.

    NaN: not moving.
    """
    started = moving(seed)
    if started is None:
        return math.nan, math.nan, 0.0, 0.0
    governor, told, rng = started
    pair = 1.0 + FREQUENCY * rng.uniform(-1.0, 1.0), DAMPING ** rng.uniform(-1.0, 1.0)
    rows = stop_of(governor, told, way)
    past = np.array([one.acceleration for one in told])
    height = highest([other(governor.model, *pair)], np.concatenate([past, rows]))
    before = np.concatenate([past[-1:], rows[:-1]])
    velocity = np.array(told[-1].velocity) + np.cumsum(0.5 * PERIOD * (before + rows), axis=0)
    way_gone = np.linalg.norm(velocity, axis=1).sum() * PERIOD
    return len(rows) * PERIOD, float(way_gone), height / governor.limits.height, 0.0


def row(way: str, runs: Array) -> str:
    """Formats the results of many stops (N, 4) as a table row."""
    time, distance, height, joints = runs[np.isfinite(runs).all(axis=1)].T
    return (
        f"| {way} | {len(time)} | {np.median(time):.2f} | {1e3 * np.median(distance):.0f} "
        f"| {100 * np.mean(height > 1.0):.0f} % | {height.max():.2f} "
        f"| {f'{joints.max():.3f}' if joints.any() else '–'} |"
    )


def main() -> int:
    """Simulates all stops and writes the table; returns the exit code."""
    rows = [(partial(run, way), partial(row, way)) for way in WAYS]
    rows += [(partial(run_joints, way), partial(row, way)) for way in JOINT_WAYS]
    return write_table(__doc__, "stops", HEAD, rows, PAGE)


if __name__ == "__main__":
    sys.exit(main())
