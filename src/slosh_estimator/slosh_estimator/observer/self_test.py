"""Compares the observer's compiled code with plain Python; see slosh_model.self_test."""

from __future__ import annotations

import numpy as np

from slosh_base.types import Array
from slosh_estimator.estimate_kernel import MAX_STEP
from slosh_estimator.observer import layout
from slosh_estimator.observer import observer_kernel as kernel
from slosh_estimator.tuning import TUNING
from slosh_model.layout import divided
from slosh_model.model import Model
from slosh_model.self_test import compare, reference_models, reference_motion
from slosh_model.simulate import store_of

INPUTS = 6


class _Arrays:
    """State arrays of the observer's compiled functions after some inputs."""

    def __init__(self, model: Model) -> None:
        self.store = store_of(model.nonlinear(), MAX_STEP)
        modes = divided(self.store)[1]
        modes["x"], modes["vy"] = 1e-3, 0.02
        count = len(modes)
        self.blocks = np.zeros((2 * count, layout.BLOCK))
        self.ring = np.zeros((8, layout.MODES + 4 * count))
        self.covariance = 1e-4 * np.eye(4 * count + layout.PARAMETERS)
        self.averages, self.out = np.zeros(layout.AVERAGES), np.zeros(layout.STATE + 4 * count)
        self.noise = np.full(layout.NOISES, 0.1)
        self.noise[layout.GATE] = 40.0
        kernel.begin.load()(self.store, self.blocks)
        motion = reference_motion()
        self.poses = motion.poses[:1]
        self.inputs = [
            (float(t), 0.003 if i else 0.0, *map(float, a), float(yaw))
            for i, (t, a, yaw) in enumerate(
                zip(motion.t[:INPUTS], motion.acceleration, motion.yaws, strict=False)
            )
        ]

    def follow(self, at: int) -> tuple[object, ...]:
        """Returns the arguments of `follow` for the input with this index."""
        return (
            self.store, self.poses, *self.inputs[at], self.ring, at, self.blocks, self.averages,
            self.noise, TUNING.runaway,
        )  # fmt: skip


def _behind(model: Model) -> _Arrays:
    arrays, follow = _Arrays(model), kernel.follow.load()
    for at in range(INPUTS - 1):
        follow(*arrays.follow(at))
    return arrays


def _check_begin() -> None:
    for model in reference_models():
        arrays = _Arrays(model)
        compare(kernel.begin, arrays.store, arrays.blocks)


def _check_follow() -> None:
    for model in reference_models():
        compare(kernel.follow, *_behind(model).follow(INPUTS - 1))


def _check_read() -> None:
    for model in reference_models():
        one = _behind(model)
        compare(
            kernel.read, one.store, one.blocks, one.ring, INPUTS - 1, one.covariance,
            one.averages, np.array([-0.02, 0.02, -0.7, 0.7]), one.out,
        )  # fmt: skip


def _check_correct() -> None:
    points: Array = np.array([[0.3, 2e-3, 1e-3], [-1.0, 1e-3, 1e-3], [np.nan, 1e-3, 1e-3]])
    for model in reference_models():
        one, container = _behind(model), model.container
        compare(
            kernel.correct, one.store, one.ring, 0, INPUTS - 2, one.blocks,
            np.zeros(layout.PARAMETERS), one.covariance, one.noise, one.inputs[0][0],
            one.inputs[2][0] + 1e-3, container.cornered, np.array(container.reaches), points,
        )  # fmt: skip


kernel.begin.check_with(_check_begin)
kernel.follow.check_with(_check_follow)
kernel.read.check_with(_check_read)
kernel.correct.check_with(_check_correct)
