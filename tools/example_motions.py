"""Makes smooth motions and simulated camera measurements of them, for tests of the discovery."""

from __future__ import annotations

import numpy as np

from slosh_discovery.discover import MeasuredMotion
from slosh_model import Cylinder, Inputs, Model, predicted_heights

BASE = Model(Cylinder(0.05, 0.07), damping_ratio=0.006)
NOISE = 2e-4
DURATION, MOVING = 4.0, 2.5


def inputs_of(seed: int, vertical: float = 1.0) -> Inputs:
    """Returns a smooth rest-to-rest motion in all directions, followed by rest."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, DURATION, 0.004)
    window = np.where(t < MOVING, np.sin(np.pi * t / MOVING) ** 2, 0.0)
    frequencies, sizes = random.uniform(10.0, 15.0, 3), random.uniform(0.4, 1.0, 3)
    phases = random.uniform(0.0, 6.0, 3)
    waves = sizes * np.sin(np.outer(t, frequencies) + phases) * np.array([1.0, 1.0, vertical])
    return Inputs(t, window[:, np.newaxis] * waves)


def measured(
    truth: Model, seed: int, *, offset: float = 0.0, level: float = 0.0, vertical: float = 1.0
) -> MeasuredMotion:
    """Returns a motion with the heights that a camera would measure, with noise and offsets."""
    inputs = inputs_of(seed, vertical)
    t = np.arange(0.01, DURATION, 1.0 / 60.0)
    noise = NOISE * np.random.default_rng(1000 + seed).normal(size=len(t))
    heights = predicted_heights(truth, inputs, t)[:, 0] + noise + level
    return MeasuredMotion(
        f"motion {seed}",
        inputs,
        t + offset,
        msh=heights,
        same_clock=offset == 0.0,
        level_known=level == 0.0,
    )
