"""Measures when the observer reports calm liquid, compared with when it is calm.

    tools/run python validation/studies/calm_waits.py [--runs 500] [--half 1]

A cup stops after one move; its liquid and sensors differ from the model as in
`observer_accuracy`, its damping by a factor of 0.5 to 2 and its frequency by up to 2 %. A calm
that is told while the wave still exceeds the tolerance is false. The constant wait is the longest
that one of the stops needs.
"""

from __future__ import annotations

import math
import sys
from functools import partial

import numpy as np
import with_tools  # noqa: F401
from observer_accuracy import CUP, STEP, Case, drawn, seen, stamp_of, write_table

from slosh_base.types import Array
from slosh_estimator.observer.calm import CalmWatch
from slosh_estimator.observer.observer import Observer
from slosh_estimator.sample import Sample
from slosh_model.simulate import Inputs, simulate

TOLERANCE, LENGTH, BEGIN = 1e-3, 150.0, 0.5
BEHIND = 5.0
"""So long behind the true calm a stop is watched, once calm is told [s]."""
HEAD = ("camera", "stops", "false calms", "false at the first", "wait, median [s]",
        "needed, median [s]", "constant wait [s]", "ratio")  # fmt: skip


def main() -> int:
    """Simulates the stops and writes the table; returns the exit code."""
    rows = [(partial(stop, camera), partial(row, camera)) for camera in (True, False)]
    return write_table(__doc__, "calm", HEAD, rows)


def row(camera: bool, stops: Array) -> str:
    """Formats the results of many stops (N, 4) as a table row."""
    needed, told, false, states = stops.T
    wait, need, constant = np.median(told), np.median(needed), needed.max()
    return (
        f"| {'yes' if camera else 'no'} | {len(stops)} | {100 * false.sum() / states.sum():.3f} % "
        f"| {100 * np.mean(told < needed):.2f} % | {wait:.2f} | {need:.2f} | {constant:.2f} "
        f"| {wait / constant:.2f} |"
    )


def stop(camera: bool, seed: int) -> tuple[float, float, int, int]:
    """Simulates one stop; returns true and reported waiting time [s], and false states."""
    rng = np.random.default_rng(seed)
    case = Case(
        "stop", float(rng.uniform(0.98, 1.02)), float(2.0 ** rng.uniform(-1.0, 1.0)),
        blind=(math.inf, math.inf) if camera else (0.0, math.inf),
    )  # fmt: skip
    one = drawn(rng, case)
    t = np.arange(0.0, LENGTH, STEP)
    length, azimuth = rng.uniform(0.3, 1.2), rng.uniform(0.0, 2.0 * np.pi)
    u = (t - BEGIN) / length
    pulse = np.where((u >= 0.0) & (u < 1.0), np.sin(2.0 * np.pi * u), 0.0)
    way = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    acceleration = rng.uniform(0.5, 3.0) * pulse[:, np.newaxis] * way
    wall = simulate(one.truth, Inputs(t, acceleration))[0]
    heights = np.column_stack([wall.sh_x, wall.sh_y])
    end = BEGIN + length
    high = np.flatnonzero(wall.msh > TOLERANCE)
    calm_from = max(float(t[high[-1]]) if len(high) else end, end)
    last = min(calm_from + 20.0, LENGTH) if camera else LENGTH
    images = seen(rng, one, case, t[t <= last], heights[t <= last])
    observer, watch = Observer(CUP), CalmWatch(TOLERANCE)
    told, false, states, image = math.nan, 0, 0, 0
    measured = one.gain * acceleration + one.noise * rng.normal(size=acceleration.shape)
    for i, moment in enumerate(t[t <= last]):
        while image < len(images) and images[image][0] <= moment:
            observer.take(images[image][1])
            image += 1
        ax, ay, az = measured[i].tolist()
        state = observer.follow(Sample(stamp_of(moment), ax, ay, az, restarted=i == 0))
        if state is None or moment < end:
            continue
        calm = watch.update(state).calm
        states += 1
        false += calm and moment < calm_from
        if calm and math.isnan(told):
            told = moment - end
        if not math.isnan(told) and moment > calm_from + BEHIND:
            break
    return calm_from - end, LENGTH if math.isnan(told) else told, false, states


if __name__ == "__main__":
    sys.exit(main())
