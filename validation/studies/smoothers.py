"""Compares the window filter of poses with a fixed-lag Kalman smoother.

tools/run python validation/studies/smoothers.py

The smoother is a Kalman filter of constant jerk (white noise in its derivative), run back over the
lag by Rauch, Tung and Striebel's equations, with the resolution as measurement noise and the same
delay as the window. Its process noise was chosen on motions of even seeds; odd ones are reported.
Errors are rms, of the height in percent of the peak, of the acceleration in m/s².
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import with_tools  # noqa: F401
from input_accuracy import Motion, Sampled, motion, settings

from slosh_base.types import Array
from slosh_estimator.estimator import Estimator
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import Sample, Samples
from slosh_testing.joint_driver import cup_position, quaternion
from slosh_testing.random_moves import MODEL

RATES, RESOLUTIONS, JITTERS = (125, 500), (0.02, 0.1, 1.0), (0.0, 4.0)
"""Hz, mm, ms."""
DELAY = 0.065
"""Of the window filter's default for this cup [s]."""
DELAYS = (0.0, 0.03, 0.065, 0.1, 0.13, 0.16)
"""Of the parameter `smoothing` [s]; 0: the default."""
PROCESS = (1e4, 1e5, 1e6, 1e7)
"""Spectral density of the noise in the jerk's derivative [m²/s⁷]."""
STEP = 1e-4


class Errors(NamedTuple):
    """Rms errors of height [% of the peak] and of acceleration [m/s²]."""

    height: float
    acceleration: float


def smoothed(t: Array, places: Array, resolution: float, process: float) -> tuple[Array, Array]:
    """Returns accelerations (M, 3) by the fixed-lag smoother, and their times (M,).

    Args:
        t: (N,) [s].
        places: (N, 3) [m].
        resolution: of the places [m].
        process: see PROCESS.
    """
    noise = resolution * resolution / 12.0
    state, spread = np.zeros((4, 3)), np.diag([noise, 1.0, 100.0, 1e5])
    state[0] = places[0]
    kept: list[tuple[Array, Array, Array, Array, Array]] = []
    times, found = [], []
    first = 0
    for k, now in enumerate(t.tolist()):
        step = now - float(t[k - 1]) if k else 0.0
        move, added = transition(step, process)
        ahead, wide = move @ state, move @ spread @ move.T + added
        gain = wide[:, 0] / (wide[0, 0] + noise)
        state = ahead + np.outer(gain, places[k] - ahead[0])
        spread = wide - np.outer(gain, wide[0])
        kept.append((state, spread, ahead, wide, move))
        while now - float(t[first]) >= DELAY:
            times.append(float(t[first]))
            found.append(back(kept, first, k)[2])
            first += 1
    return np.array(found), np.array(times)


def transition(step: float, process: float) -> tuple[Array, Array]:
    """Returns transition matrix and added covariance of constant jerk over a step [s]."""
    powers = [step**n / math.factorial(n) for n in range(4)]
    move = np.zeros((4, 4))
    added = np.zeros((4, 4))
    for i in range(4):
        move[i, i:] = powers[: 4 - i]
        for j in range(4):
            a, b = 3 - i, 3 - j
            scale = math.factorial(a) * math.factorial(b) * (a + b + 1)
            added[i, j] = process * step ** (a + b + 1) / scale
    return move, added


def back(kept: Sequence[tuple[Array, Array, Array, Array, Array]], first: int, last: int) -> Array:
    """Returns the smoothed state at a row, given the data up to a later row."""
    state = kept[last][0]
    for k in range(last - 1, first - 1, -1):
        own, spread, _, _, _ = kept[k]
        _, _, ahead, wide, move = kept[k + 1]
        gain = np.linalg.solve(wide + 1e-18 * np.eye(4), move @ spread).T
        state = own + gain @ (state - ahead)
    return state


def by_window(robot: Motion, sampled: Sampled, t: Array, delay: float) -> tuple[Array, Array]:
    """Returns accelerations (M, 3) by the estimator's window filter, and their times (M,)."""
    reader = settings("pose")._replace(smoothing=delay).reader("pose")
    assert isinstance(reader, PoseInput)
    q = robot.joints(t)
    places = sampled.rounded(cup_position(*q.T))
    found: list[Sample] = []
    for at, place, row in zip(t.tolist(), places.tolist(), q.tolist(), strict=True):
        found += reader.update(round(at * 1e9), tuple(place), quaternion(*row[1:]))
    columns = Samples.of(found)
    return columns.accelerations, np.asarray(columns.stamps * 1e-9, dtype=np.float64)


def errors(robot: Motion, times: Array, accelerations: Array) -> Errors:
    """Returns the errors against the true acceleration and the wave that it causes."""
    places = [cup_position(*robot.joints(times + k * STEP).T) for k in (-1, 0, 1)]
    true = (places[0] - 2.0 * places[1] + places[2]) / STEP**2
    restarted = np.zeros(len(times), dtype=bool)
    restarted[0] = True
    stamps = np.rint(times * 1e9).astype(np.int64)
    given = Samples(stamps, np.ascontiguousarray(accelerations), np.zeros(len(times)), restarted)
    found = Estimator(MODEL).update_many(given)
    wave = np.interp(times, robot.t, robot.wave)
    height = float(np.sqrt(np.mean((found.heights[:, 1, 0] - wave) ** 2)) / robot.wave.max())
    off = np.sum((accelerations - true) ** 2, axis=1)
    return Errors(100.0 * height, float(np.sqrt(np.mean(off))))


def rows(robots: Sequence[tuple[int, Motion]]) -> Iterator[str]:
    """Yields a line for each sampling: window errors by delay, smoother errors by noise."""
    for rate in RATES:
        for resolution in RESOLUTIONS:
            for jitter in JITTERS:
                sampled = Sampled(rate, 1e-3 * resolution, 1e-3 * jitter)
                cells = []
                found: dict[str, list[Errors]] = {}
                for seed, robot in robots:
                    t = sampled.times(robot.end, seed)
                    for delay in DELAYS:
                        a, at = by_window(robot, sampled, t, delay)
                        found.setdefault(f"w{delay:g}", []).append(errors(robot, at, a))
                    places = sampled.rounded(cup_position(*robot.joints(t).T))
                    for process in PROCESS:
                        a, at = smoothed(t, places, 1e-3 * resolution, process)
                        found.setdefault(f"s{process:.0e}", []).append(errors(robot, at, a))
                for name, several in found.items():
                    height, off = np.median(np.array(several), axis=0)
                    cells.append(f"{name} {height:.2f} {off:.2f}")
                yield f"{rate:5} Hz {resolution:5} mm {jitter:g} ms | {' | '.join(cells)}"


def main() -> int:
    """Compares both filters on random motions and prints all results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--motions", type=int, default=6)
    parser.add_argument("--tuning", action="store_true", help="use the seeds for tuning")
    arguments = parser.parse_args()
    first = 0 if arguments.tuning else 1
    seeds = range(first, first + 2 * arguments.motions, 2)
    for row in rows([(seed, motion(seed)) for seed in seeds]):
        print(row, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
