"""Measures when the observer reports calm liquid, compared with when it is calm.

    tools/run python validation/studies/calm_waits.py [--runs 500] [--half 1]

A cup stops after one move; its liquid and sensors differ from the model as in
`observer_accuracy`, its damping by a factor of 0.5 to 2 and its frequency by up to 2 %. A calm
that is told while the wave still exceeds the tolerance is false. The constant wait is the longest
that one of the stops needs.

The least safe wait is that of an oracle without a camera: it knows the motion exactly, and of the
liquid the ranges from which it is drawn. It must wait for the worst liquid in these, since an
acceleration does not show the damping. Its median over the constant wait is the best ratio that is
attainable.
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
from slosh_model.simulate import Inputs, simulate
from slosh_motion.inputs.sampling import Sample

TOLERANCE, LENGTH, BEGIN = 1e-3, 150.0, 0.5
FREQUENCY, DAMPING, ALPHA = (0.98, 1.02), (0.5, 2.0), (0.45, 0.7)
"""Ranges of the liquid's frequency and damping over the model's, and of its nonlinearity."""
BEHIND = 5.0
"""So long behind the true calm a stop is watched, once calm is told [s]."""
HEAD = ("camera", "stops", "false calms", "false at the first", "wait, median [s]",
        "needed, median [s]", "constant wait [s]", "ratio", "ratio of the oracle")  # fmt: skip


def main() -> int:
    """Simulates the stops and writes the table; returns the exit code."""
    rows = [(partial(stop, camera), partial(row, camera)) for camera in (True, False)]
    return write_table(__doc__, "calm", HEAD, rows)


def row(camera: bool, stops: Array) -> str:
    """Formats the results of many stops (N, 5), see `stop`, as a table row."""
    needed, told, false, states, least = stops.T
    wait, need, constant = np.median(told), np.median(needed), needed.max()
    return (
        f"| {'yes' if camera else 'no'} | {len(stops)} | {100 * false.sum() / states.sum():.3f} % "
        f"| {100 * np.mean(told < needed):.2f} % | {wait:.2f} | {need:.2f} | {constant:.2f} "
        f"| {wait / constant:.2f} | {np.median(least) / constant:.2f} |"
    )


def least_wait(t: Array, acceleration: Array, end: float) -> float:
    """Returns the time from a stop until the worst liquid is within the tolerance [s].

    Args:
        t: (N,) times [s].
        acceleration: (N, 3) exact [m/s²].
        end: of the motion [s].
    """
    (mode,) = CUP.mode_constants()
    begin = t <= end + 4.0
    inputs, last, longest = Inputs(t[begin], acceleration[begin]), -round(0.5 / STEP), 0.0
    for frequency in np.linspace(*FREQUENCY, 5):
        decay = DAMPING[0] * mode.damping_ratio * frequency * mode.natural_frequency
        for alpha in ALPHA:
            liquid = CUP.with_effect("frequency_mismatch", factor=float(frequency))
            liquid = liquid.with_effect("damping_mismatch", factor=DAMPING[0])
            liquid = liquid.with_effect("surface_nonlinearity", alpha=alpha)
            height = simulate(liquid, inputs)[0].msh[last:]
            crest = int(np.argmax(height))
            rest = math.log(max(float(height[crest]) / TOLERANCE, 1e-9)) / decay
            longest = max(longest, float(inputs.t[last + crest]) - end + rest)
    return longest


def stop(camera: bool, seed: int) -> tuple[float, float, int, int, float]:
    """Simulates one stop; returns true, reported and least possible waiting time, false states.

    In order: true and reported waiting time [s], number of false and of all states, and the
    oracle's waiting time [s], see `least_wait`.
    """
    rng = np.random.default_rng(seed)
    slow, fast = (math.log2(factor) for factor in DAMPING)
    case = Case(
        "stop", float(rng.uniform(*FREQUENCY)), float(2.0 ** rng.uniform(slow, fast)),
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
    wait = LENGTH if math.isnan(told) else told
    return calm_from - end, wait, false, states, least_wait(t, acceleration, end)


if __name__ == "__main__":
    sys.exit(main())
