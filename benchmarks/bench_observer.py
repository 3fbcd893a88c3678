"""Measures the processor time per sample that the observer adds to the estimator.

Samples at 1 kHz, five points of an image at 60 Hz; the least of several turns counts.

    tools/run python benchmarks/bench_observer.py [--turns 7]
"""

from __future__ import annotations

import argparse
import json
import sys
import time

import numpy as np
from measuring import parsed

from slosh_estimator.estimator import Estimator
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import WallHeights
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_motion.inputs.sampling import Sample

GOAL = 3.0
COUNT, IMAGE_EVERY, LATE, MS = 8000, 17, 20, 1_000_000
CUP = Model(Cylinder(0.05, 0.07)).with_effect("vertical_acceleration").nonlinear()


def turn() -> tuple[float, float]:
    """Returns the processor times of estimator and observer per sample [s]."""
    azimuths = np.linspace(-3.0, 3.0, 5)
    points = np.column_stack([azimuths, np.full(5, 1e-3), np.full(5, 1e-3)])
    samples = [
        Sample(1000 * MS + k * MS, 3.0 if k % 400 < 200 else -3.0, 0.0, 0.0, restarted=k == 0)
        for k in range(COUNT)
    ]
    estimator, observer = Estimator(CUP), Observer(CUP)
    begin = time.process_time()
    for sample in samples:
        estimator.update(sample)
    middle = time.process_time()
    for k, sample in enumerate(samples):
        if k % IMAGE_EVERY == 0 and k > LATE:
            observer.take(WallHeights(sample.stamp_ns - LATE * MS, points))
        observer.follow(sample)
    end = time.process_time()
    return (middle - begin) / COUNT, (end - middle) / COUNT


def main() -> int:
    """Prints the times as JSON; returns 1 if the goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--turns", type=int, default=7)
    turn()  # compiles or loads
    found = np.array([turn() for _ in range(parsed(parser, turns=1).turns)])
    estimator, observer = found.min(axis=0).tolist()
    ratio = (estimator + observer) / estimator
    print(json.dumps({
        "estimator_us": round(1e6 * estimator, 2), "observer_us": round(1e6 * observer, 2),
        "ratio": round(ratio, 2), "goal": GOAL,
    }))  # fmt: skip
    return int(ratio > GOAL)


if __name__ == "__main__":
    sys.exit(main())
