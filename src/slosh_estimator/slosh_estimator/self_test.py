"""Compares the estimator's compiled code with plain Python; see slosh_model.self_test."""

from __future__ import annotations

import numpy as np

from slosh_base.types import Array
from slosh_estimator import estimate_kernel
from slosh_estimator.estimate_kernel import MAX_STEP, MODAL, ROW, new_checks
from slosh_model.layout import divided
from slosh_model.model import Model
from slosh_model.self_test import SAMPLES, compare, reference_models, reference_motion
from slosh_model.simulate import store_of


def check_model(model: Model) -> None:
    """Compares compiled with plain Python code on a model and a reference motion.

    Raises:
        SloshModelError: they differ; one line that says what to do.
    """
    motion = reference_motion()
    stores = _stores(model)
    compare(
        estimate_kernel.steps, *stores, np.zeros((SAMPLES, _row(model))), motion.poses,
        np.diff(motion.t, prepend=motion.t[0]), motion.acceleration, motion.yaws,
    )  # fmt: skip


def _check_steps() -> None:
    for model in reference_models():
        check_model(model)


def _check_step() -> None:
    motion = reference_motion()
    for model in reference_models():
        compare(
            estimate_kernel.step, *_stores(model), np.zeros(_row(model)), motion.poses[:1], 0.002,
            1.0, -2.0, 0.5, 0.1, False,
        )  # fmt: skip


def _stores(model: Model) -> tuple[Array, Array, Array]:
    twins = [store_of(twin, MAX_STEP) for twin in (model.linear(), model.nonlinear())]
    for twin in twins:
        divided(twin)[0]["started"] = 1.0  # else the first sample only begins
    checks = new_checks()
    checks.view(estimate_kernel.CHECKS)["reads"] = 1.0
    return (*twins, checks)  # type: ignore[return-value]


def _row(model: Model) -> int:
    return ROW + 2 * MODAL * len(model.mode_constants())


estimate_kernel.step.check_with(_check_step)
estimate_kernel.steps.check_with(_check_steps)
