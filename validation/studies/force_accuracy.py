"""Measures the accuracy of the identification from force with simulated sensors.

Usage: tools/run python validation/studies/force_accuracy.py [--seeds N] [--tuned] [--rules]

Cups, liquids, motions and sensors are drawn by `slosh_testing.force_sensor`: noise, drift, a
cable's force, a ringing arm, any delay within 0.1 s, any axes and signs, 100 to 1000 Hz. The
even seeds (--tuned) are for choosing tuning numbers; the odd ones are reported. The liquid's force
is that of the fit's own equations: what they lack of real liquids is not in these errors.

--rules tries the numbers by which records are refused: forces in the axes of the base and of the
tool while the container turns by 20° to 170°, and sensors that are clipped for a part of the
motion.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.force import fit, prepared
from slosh_discovery.force.record import ForceRecord
from slosh_discovery.force.result import ForceIdentification
from slosh_discovery.force.tuning import TUNING
from slosh_discovery.force.workflow import identify_force
from slosh_model.model import Model
from slosh_testing.force_sensor import drawn_sensor

GOALS = {"natural frequency": 0.01, "damping ratio": 0.15, "sloshing mass": 0.05}
AXES = (0.5, 0.7, 0.9)
"""Of `fixed_axes`, that are tried."""


def main() -> None:
    """Identifies random cups from simulated forces and prints a table of errors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--tuned", action="store_true", help="use the even seeds, for tuning")
    parser.add_argument("--each", action="store_true", help="print each seed")
    parser.add_argument("--rules", action="store_true", help="try what refuses records instead")
    arguments = parser.parse_args()
    if arguments.rules:
        rules(range(0 if arguments.tuned else 1, 2 * arguments.seeds, 2))
        return
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


def answer(record: ForceRecord, model: Model) -> ForceIdentification | str:
    """Returns what is identified, or why it is refused."""
    try:
        return identify_force(record, model)
    except SloshDiscoveryError as error:
        return str(error)


def rules(seeds: Sequence[int]) -> None:
    """Prints how often records of either kind are refused, and how wrong clipped ones are."""
    turning = []
    for seed in seeds:
        rng = np.random.default_rng([39, seed])
        angle = math.radians(float(rng.uniform(20.0, 170.0)))
        turning.append(replace(drawn_sensor(seed), plane=True, turn=angle))
    print("fixed_axes, named of those in the base's axes, refused of those in the tool's, of each")
    for limit in AXES:
        vars(fit)["TUNING"] = replace(TUNING, fixed_axes=limit)
        base = [answer(replace(one, in_base=True).record(), one.model) for one in turning]
        tool = [answer(one.record(), one.model) for one in turning]
        named = sum("do not turn" in text for text in base if isinstance(text, str))
        print(f"{limit:g}, {named}, {sum(isinstance(one, str) for one in tool)}, {len(turning)}")
    vars(fit)["TUNING"] = TUNING
    print("clipped part of the motion %, error of the sloshing mass %, in its own errors")
    for seed in seeds:
        truth = drawn_sensor(seed)
        record = truth.record()
        force = record.force - np.median(record.force, axis=0)
        most = float(np.random.default_rng([40, seed]).uniform(0.1, 0.9)) * np.abs(force).max()
        clipped = replace(record, force=np.clip(force, -most, most))
        vars(prepared)["TUNING"] = replace(TUNING, most_hidden=0.0)  # which tells the part
        share = re.search(r"clipped during (\d+) %", str(answer(clipped, truth.model)))
        vars(prepared)["TUNING"] = replace(TUNING, most_hidden=1.0)
        found = answer(clipped, truth.model)
        vars(prepared)["TUNING"] = TUNING
        mass = math.nan, math.nan
        if not isinstance(found, str):
            off = found.sloshing_mass.value - truth.mass
            mass = 100.0 * off / truth.mass, off / found.sloshing_mass.error
        print(f"{share[1] if share else 0}, {mass[0]:.1f}, {mass[1]:.1f}")


if __name__ == "__main__":
    main()
