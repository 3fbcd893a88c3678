"""Measures the time of a discovery on six motions of 5 s with all modelled effects.

    tools/run python benchmarks/bench_discover.py [--motions 6] [--cases "one effect"]

Each case in the same run: nothing missing (the shortest way), one effect missing, two missing, and
a cause outside the list (the longest way). Beside it the time of what a discovery consists of: one
simulation of all six motions, by the compiled kernel as the fits run it and by SciPy's `solve_ivp`
at rtol 1e-8, which a user would write. The claim: below 60 s on two cores, and the ratio.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from measuring import parsed, timed
from scipy.integrate import solve_ivp

from slosh_discovery.discover import MeasuredMotion, discover
from slosh_discovery.discover.problem import prepare
from slosh_model import Cylinder, Inputs, Model, predicted_heights

BASE = Model(Cylinder(0.05, 0.07), damping_ratio=0.006)
CASES = ("nothing missing", "one effect", "two effects", "outside the list")
SECONDS, RATE, NOISE = 5.0, 250.0, 2e-4


def inputs_of(seed: int) -> Inputs:
    """Returns a smooth motion of 3.5 s in all directions, followed by rest."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, SECONDS, 1.0 / RATE)
    window = np.where(t < 3.5, np.sin(np.pi * t / 3.5) ** 2, 0.0)
    waves = random.uniform(0.5, 2.5, 3) * np.sin(
        np.outer(t, random.uniform(9.0, 15.0, 3)) + random.uniform(0.0, 6.0, 3)
    )
    return Inputs(t, window[:, np.newaxis] * waves)


def measured(truth: Model, seed: int) -> MeasuredMotion:
    """Returns a motion with simulated heights of a camera at 60 Hz, with noise."""
    inputs = inputs_of(seed)
    t = np.arange(0.01, SECONDS - 0.02, 1.0 / 60.0)
    noise = NOISE * np.random.default_rng(seed + 100).normal(size=len(t))
    return MeasuredMotion(
        f"motion {seed}", inputs, t, msh=predicted_heights(truth, inputs, t)[:, 0] + noise
    )


def shaken(motion: MeasuredMotion) -> MeasuredMotion:
    """Adds a slow sway of the camera to the heights, which no modelled effect explains."""
    sway = 2e-3 * np.sin(2.0 * np.pi * 0.7 * motion.t) * np.sin(2.0 * np.pi * 0.23 * motion.t)
    assert motion.msh is not None
    return MeasuredMotion(motion.name, motion.inputs, motion.t, msh=motion.msh + sway)


def scipy_once(inputs: Inputs) -> int:
    """Simulates one motion of the linear model with SciPy; returns its number of steps."""
    omega, zeta = BASE.mode_constants()[0].natural_frequency, 0.006

    def rate(t: float, q: np.ndarray) -> list[float]:
        ax = np.interp(t, inputs.t, inputs.acceleration[:, 0])
        ay = np.interp(t, inputs.t, inputs.acceleration[:, 1])
        damping, stiffness = 2.0 * zeta * omega, omega * omega
        return [
            q[2], q[3], -damping * q[2] - stiffness * q[0] - ax,
            -damping * q[3] - stiffness * q[1] - ay,
        ]  # fmt: skip

    return len(solve_ivp(rate, (0.0, SECONDS), np.zeros(4), rtol=1e-8, max_step=0.02).t)


def main() -> None:
    """Measures discoveries and single simulations, and prints their times."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--motions", type=int, default=6)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=CASES)
    given = parsed(parser, motions=1, cases=CASES[:1])
    count = given.motions
    plain = [measured(BASE, seed) for seed in range(count)]
    discover(plain[:2], BASE)  # compiles, or loads what was compiled
    one = BASE.with_effect("vertical_acceleration")
    two = BASE.with_effect("static_tilt", roll=0.02, pitch=-0.01).with_effect(
        "time_offset", tau=0.02
    )
    cases = {
        "nothing missing": plain,
        "one effect": [measured(one, seed) for seed in range(count)],
        "two effects": [measured(two, seed) for seed in range(count)],
        "outside the list": [shaken(motion) for motion in plain],
    }
    for name in given.cases:
        motions = cases[name]
        start = time.perf_counter()
        finding = discover(motions, BASE)
        seconds = time.perf_counter() - start
        found = " + ".join(effect.name for effect in finding.effects) or "-"
        print(f"{name:18s} {seconds:6.1f} s   {finding.verdict.value:12s} {found}")
    prepared = [prepare(motion) for motion in plain]
    kernel = min(timed(lambda: [m.simulate(BASE) for m in prepared]) for _ in range(7))
    scipy = timed(lambda: [scipy_once(motion.inputs) for motion in plain])
    print(f"all motions once: kernel {1e3 * kernel:.1f} ms, SciPy {1e3 * scipy:.0f} ms, ", end="")
    print(f"ratio {scipy / kernel:.0f}")


if __name__ == "__main__":
    main()
