"""Creates random motions with exact positions, accelerations and sloshing heights.

A motion is a handful of moves with piecewise constant jerk, as robots make them, or a shuttle near
the liquid's natural frequency. What an input makes of it is compared with the models under the
true acceleration, at 2 kHz.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_estimator.estimator import Estimates, Estimator
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import Samples, modes_of

Array = NDArray[np.float64]
MODEL = Model(Cylinder(0.04, 0.06), damping_ratio=0.01)
"""A cup of 80 mm: its first mode has 21.2 rad/s."""
FIRST_MODE = MODEL.mode_constants()[0].natural_frequency
REST, AFTER = 0.6, 2.0
"""Seconds of rest before and after a motion."""
LEVEL = (0.0, 0.0, 0.0, 1.0)


class Move(NamedTuple):
    """A random motion with exact positions and accelerations.

    Attributes:
        end: when it ends [s].
        at: positions (N, 3) [m] and accelerations (N, 3) [m/s²] at times (N,) [s].
    """

    end: float
    at: Callable[[Array], tuple[Array, Array]]


def moves(seed: int) -> Move:
    """Returns one to three straight moves in random directions, with or without pauses."""
    random = np.random.default_rng(seed)
    spans, jerks = [REST], [(0.0, 0.0)]
    for _ in range(random.integers(1, 4)):
        ramp, hold = random.uniform(0.03, 0.2), random.uniform(0.0, 0.2)
        cruise, pause = random.uniform(0.0, 0.5), random.uniform(0.0, 0.6)
        jerk, angle = random.uniform(1.0, 3.5) / ramp, random.uniform(0.0, math.tau)
        spans += [ramp, hold, ramp, cruise, ramp, hold, ramp, pause]
        jerks += [
            (sign * jerk * math.cos(angle), sign * jerk * math.sin(angle))
            for sign in (1, 0, -1, 0, -1, 0, 1, 0)
        ]
    begins = np.concatenate(([0.0], np.cumsum(spans)))
    state = np.zeros((len(begins), 4, 2))  # place, speed, acceleration, jerk where each begins
    state[:-1, 3] = jerks
    for k, span in enumerate(spans):
        x, v, a, j = state[k]
        state[k + 1, 2] = a + j * span
        state[k + 1, 1] = v + a * span + j * span**2 / 2.0
        state[k + 1, 0] = x + v * span + a * span**2 / 2.0 + j * span**3 / 6.0
    state[-1, 1:] = 0.0

    def at(t: Array) -> tuple[Array, Array]:
        k = np.searchsorted(begins, t, side="right") - 1
        x, v, a, j = np.moveaxis(state[k], 1, 0)
        d = (t - begins[k])[:, None]
        place = x + d * (v + d * (a / 2.0 + d * j / 6.0))
        return _in_space(place), _in_space(a + d * j)

    return Move(float(begins[-1]), at)


def shuttle(seed: int) -> Move:
    """Returns an oscillation within 10 % of the first natural frequency."""
    random = np.random.default_rng(seed)
    w = FIRST_MODE * random.uniform(0.9, 1.1)
    seconds = random.integers(4, 9) * math.tau / w
    size, angle = random.uniform(0.4, 1.2) / w**2, random.uniform(0.0, math.tau)
    direction, h = np.array([math.cos(angle), math.sin(angle)]), math.pi / seconds

    def at(t: Array) -> tuple[Array, Array]:
        u = np.clip(t - REST, 0.0, seconds)
        s, c = np.sin(h * u), np.cos(h * u)
        swell, slope = s**4, 4.0 * h * s**3 * c
        bend = 4.0 * h * h * (3.0 * s**2 * c**2 - s**4)
        place = swell * np.sin(w * u)
        bent = (bend - w * w * swell) * np.sin(w * u) + 2.0 * w * slope * np.cos(w * u)
        return (
            _in_space(size * place[:, None] * direction),
            _in_space(size * bent[:, None] * direction),
        )

    return Move(REST + float(seconds), at)


def _in_space(plane: Array) -> Array:
    return np.column_stack([plane, np.zeros(len(plane))])


class HighestWaves(NamedTuple):
    """Maximum heights of the nonlinear model [m] during and after a motion, with all flags."""

    peak: float
    residual: float
    flags: int


def heights(estimates: Estimates, move: Move) -> HighestWaves:
    """Returns the largest heights [m] during and after a motion, and the estimates' flags."""
    msh = estimates.heights[:, 1, 0]
    behind = estimates.stamps > (move.end + 0.1) * 1e9
    flags = int(np.bitwise_or.reduce(estimates.flags))
    return HighestWaves(float(msh.max()), float(msh[behind].max()), flags)


def truth(move: Move) -> HighestWaves:
    """Returns the maximum heights [m] that the true acceleration causes."""
    t = np.arange(0.0, move.end + AFTER, 5e-4)
    return heights(Estimator(MODEL).update_many(accelerations(t, move)), move)


def accelerations(t: Array, move: Move) -> Samples:
    """Returns input samples of the true acceleration at times (N,) [s]."""
    restarted = np.zeros(len(t), dtype=bool)
    restarted[0] = True
    stamps = np.rint(t * 1e9).astype(np.int64)
    return Samples(stamps, np.ascontiguousarray(move.at(t)[1]), np.zeros(len(t)), restarted)


class Poses(NamedTuple):
    """Rate, rounding, jitter and losses of simulated poses of a motion.

    Attributes:
        rate: poses per second.
        quantum: of the positions [m].
        jitter: half width of the time by which poses are taken early or late, and say so [s].
        lost: share of the poses that are lost.
        stamped: half width of the time by which stamps alone are early or late [s].
        seed: of the jitter.
    """

    rate: float
    quantum: float = 0.0
    jitter: float = 0.0
    lost: float = 0.0
    stamped: float = 0.0
    seed: int = 0

    def of(self, move: Move) -> tuple[list[int], list[tuple[float, float, float]]]:
        """Returns the stamps [ns] and positions [m] of a motion's poses."""
        random = np.random.default_rng(self.seed)
        count = int((move.end + AFTER) * self.rate)
        t = (np.arange(count) + 1.0) / self.rate + random.uniform(-1.0, 1.0, count) * self.jitter
        t = np.sort(t)[random.random(count) >= self.lost]
        stamps = np.unique(np.rint(t * 1e9).astype(np.int64))
        places = move.at(stamps * 1e-9)[0]
        if self.quantum:
            places = np.round(places / self.quantum) * self.quantum
        if self.stamped:
            early = random.uniform(-1.0, 1.0, len(stamps)) * self.stamped
            stamps = np.sort(stamps + np.rint(early * 1e9).astype(np.int64))
        return stamps.tolist(), [tuple(place) for place in places.tolist()]


def pose_reader(window: float = 0.0, max_gap: float = 0.2) -> PoseInput:
    """Returns the estimator's reader of poses for the test cup."""
    gate = GateSettings(max_gap=max_gap, confirms=False)
    settings = InputSettings("pose", gate, pose_window=window, modes=modes_of(MODEL))
    reader = settings.reader("pose")
    assert isinstance(reader, PoseInput)
    return reader


def by_poses(move: Move, poses: Poses, window: float = 0.0) -> HighestWaves:
    """Returns the maximum heights [m] that the estimator computes from poses."""
    reader = pose_reader(window)
    found = [
        sample
        for stamp, place in zip(*poses.of(move), strict=True)
        for sample in reader.update(stamp, place, LEVEL)
    ]
    return heights(Estimator(MODEL).update_many(Samples.of(found)), move)
