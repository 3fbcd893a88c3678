"""Compares simulation times of a cup defined by its contour and of a cylinder.

    tools/run python benchmarks/bench_shapes.py [--rounds 60]

Both go through the same compiled kernel, one mode each, in turns. The claim is the ratio of the
shortest times: what else the machine does only adds to one.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
from measuring import parsed

from slosh_model.model import Model
from slosh_model.shapes import Frustum
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, Simulator

GOAL = 1.02
SAMPLES, RATE = 50_000, 1000.0


def main() -> int:
    """Prints times per sample and their ratio; returns 1 if it exceeds the goal."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=60)
    given = parsed(parser, rounds=1)
    t = np.arange(SAMPLES) / RATE
    columns = [2.0 * np.sin(9.0 * t), 2.0 * np.cos(7.0 * t) - 2.0, np.sin(11.0 * t)]
    inputs = Inputs(t, np.stack(columns, axis=1))
    cup = Frustum(bottom_radius=0.028, top_radius=0.04, height=0.092, fill_height=0.065)
    # Equally fast waves: the sub-steps of both are the same.
    containers = {"cylinder": Cylinder(cup.size, 0.065), "cup": cup}
    simulators = {
        name: Simulator(Model(one, damping_ratio=0.007).spatial())
        for name, one in containers.items()
    }
    shortest = dict.fromkeys(simulators, np.inf)
    for _ in range(given.rounds):
        for name, simulator in simulators.items():
            started = time.perf_counter()
            simulator.run(inputs)
            shortest[name] = min(shortest[name], time.perf_counter() - started)
    for name, seconds in shortest.items():
        print(f"{name:10s} {1e9 * seconds / SAMPLES:8.1f} ns/sample")
    ratio = shortest["cup"] / shortest["cylinder"]
    print(f"cup / cylinder {ratio:6.3f}   goal: at most {GOAL:.2f}{', MISSED' * (ratio > GOAL)}")
    return int(ratio > GOAL)


if __name__ == "__main__":
    sys.exit(main())
