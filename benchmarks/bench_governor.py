"""Measures the processor time of one governor step, on one core.

    tools/run python benchmarks/bench_governor.py [--streams 20]

Random commands of `validation/studies/governor.py` at 100 and at 1,000 steps a second, without and
with an observed state every 10 ms; and the loads of `validation/studies/governed_loads.py`: four
different cups, two of which stand loosely, the joints of an arm with six axes, and a cup that it
carries within the limits of its joints. The claim: the
99th percentile of a step is at most 1 ms of the processor's time; of the clock's time another
process may take any part.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "validation" / "studies"))
from governed_loads import LOADS, Load, governor_of
from governor import NOISE, PERIOD, drawn
from measuring import need, parsed

from slosh_base.files.nanoseconds import SECOND
from slosh_governor.core import SeenLiquid
from slosh_model.tray import Tray, TrayContainer

GOAL = 1e-3
"""Of the 99th percentile [s]."""
LATE = 0.03
"""Age of an observed state [s],"""
EVERY = 0.01
"""and how often one comes."""


def one_cup(rng: np.random.Generator) -> Load:
    """Draws one container and its commands, as the study of the governor does."""
    model, limits, commands = drawn(rng)
    return Load(Tray((TrayContainer("", model),)), limits, commands)


def step_times(load: Load, period: float, *, observed: bool) -> list[float]:
    """Returns the processor time of each governor step for the commands of a load [s]."""
    governor = governor_of(load, period)
    still, found = np.zeros((governor.model.modes, 4)), []
    for step in range(round(len(load.commands) * PERIOD / period)):
        now = 1 + step * round(period * SECOND)
        command = load.command(int(step * period / PERIOD), now)
        begun = time.thread_time()
        if command is not None:
            governor.take(command)
        if observed and step * period > LATE and step % max(round(EVERY / period), 1) == 0:
            governor.see(SeenLiquid(now - round(LATE * SECOND), still, NOISE, uncorrected=0.0))
        governor.step(now)
        found.append(time.thread_time() - begun)
    return found


CASES = {"one cup": one_cup, **LOADS}


def main() -> int:
    """Measures the step times and prints them; returns the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--streams", type=int, default=20)
    need("pinocchio", "joints.txt")
    streams = range(parsed(parser, streams=1).streams)
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    slow = False
    for (name, make), period, observed in product(CASES.items(), (1e-2, 1e-3), (False, True)):
        times = np.concatenate(
            [
                step_times(make(np.random.default_rng(seed)), period, observed=observed)[1:]
                for seed in streams
            ]
        )
        median, high = 1e6 * np.percentile(times, [50, 99])
        slow |= high > 1e6 * GOAL
        how = f"{name}, {1.0 / period:.0f} Hz, {'observed' if observed else 'open loop'}"
        print(f"{how}: median {median:.0f} µs, 99 % {high:.0f} µs")
    return int(slow)


if __name__ == "__main__":
    sys.exit(main())
