"""Measures the accuracy of the identification from force with simulated sensors.

Usage: tools/run python validation/studies/force_accuracy.py [--seeds N] [--tuned]

Cups, liquids, motions and sensors are drawn by `slosh_testing.force_sensor`: noise, drift, a
cable's force, a ringing arm, any delay within 0.1 s, any axes and signs, 100 to 1000 Hz. The
even seeds (--tuned) are for choosing tuning numbers; the odd ones are reported. The liquid's force
is that of the fit's own equations: what they lack of real liquids is not in these errors.
"""

from __future__ import annotations

import argparse

import numpy as np

from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.force.workflow import identify_force
from slosh_testing.force_sensor import drawn_sensor

GOALS = {"natural frequency": 0.01, "damping ratio": 0.15, "sloshing mass": 0.05}


def main() -> None:
    """Identifies random cups from simulated forces and prints a table of errors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--tuned", action="store_true", help="use the even seeds, for tuning")
    parser.add_argument("--each", action="store_true", help="print each seed")
    arguments = parser.parse_args()
    errors: list[list[float]] = []
    scores: list[list[float]] = []
    refused = turned = 0
    for seed in range(0 if arguments.tuned else 1, 2 * arguments.seeds, 2):
        truth = drawn_sensor(seed)
        try:
            found = identify_force(truth.record(), truth.model)
        except SloshDiscoveryError as error:
            refused += 1
            print(f"seed {seed}: {error}")
            continue
        pairs = [
            (found.natural_frequency, truth.frequency),
            (found.damping_ratio, truth.damping),
            (found.sloshing_mass, truth.mass),
        ]
        errors.append([one.value / true - 1.0 for one, true in pairs])
        scores.append([(one.value - true) / one.error for one, true in pairs])
        axes = np.array(truth.axes)
        turned += any(sensor @ (axes @ along) < 0.98 for along, sensor in found.directions)
        if arguments.each:
            late = found.delay.value - truth.delay
            print(seed, np.round(errors[-1], 4), np.round(scores[-1], 1), f"{1e3 * late:.1f} ms")
    table = np.abs(np.array(errors))
    print("quantity, median error %, 95th percentile %, within goal %, truth within 2 errors %")
    for place, (name, goal) in enumerate(GOALS.items()):
        within = np.mean(table[:, place] < goal)
        covered = np.mean(np.abs(np.array(scores)[:, place]) < 2.0)
        print(
            f"{name}, {100 * np.median(table[:, place]):.2f}, "
            f"{100 * np.quantile(table[:, place], 0.95):.2f}, {100 * within:.0f}, "
            f"{100 * covered:.0f}"
        )
    print(f"{len(errors)} sensors, {refused} refused, {turned} with wrong axes")


if __name__ == "__main__":
    main()
