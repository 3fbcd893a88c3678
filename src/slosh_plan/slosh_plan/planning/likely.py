"""The models whose parameters are likely by the covariance of their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincinv

from slosh_base.types import Array
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.parameters import parameter_value, with_parameters
from slosh_plan.errors import SloshPlanError

COVERAGE = 0.95
"""Probability that the true parameters are among the likely ones."""
SAMPLES = 1000
"""Models with which a motion is simulated."""
SEED = 39
NEEDED = (
    "a robust plan needs the covariance of the model's parameters, which model.yaml lacks: "
    "slosh identify writes it there"
)


@dataclass(frozen=True, slots=True, eq=False)
class LikelyModels:
    """Models with parameters from the 95 % confidence region.

    Attributes:
        model: with the most likely parameters.
        parameters: names of the uncertain parameters.
        models: the models.
        places: (models, P) of their parameters in the region, which is the unit ball there.
        steps: (models, P) by which their parameters differ from the most likely ones.
    """

    model: Model
    parameters: tuple[str, ...]
    models: list[Model]
    places: Array
    steps: Array

    def nearer(self, index: int, share: float) -> Model:
        """Returns the model with a given fraction of a likely model's parameter errors.

        Args:
            index: of the other.
            share: of its step.
        """
        return _possible(self.model, self.parameters, share * self.steps[index])


def likely_models(model: Model, count: int = SAMPLES, seed: int = SEED) -> LikelyModels:
    """Samples models from the 95 % confidence region of the parameters.

    Half of them are on the region's surface, where the extremes are, the others inside. Values
    that are impossible, such as a negative damping ratio, are drawn towards the model's own.

    Args:
        model: the model, with the covariance of its parameters.
        count: number of models.
        seed: of the random numbers.

    Raises:
        SloshPlanError: the model has no covariance, or one that it cannot take.
    """
    covariance = model.covariance
    if covariance is None:
        raise SloshPlanError(NEEDED)
    bare = replace(model, covariance=None)
    names = covariance.parameters
    try:
        size = len([parameter_value(model, name) for name in names])
    except SloshModelError as error:
        raise SloshPlanError(f"the model's covariance cannot be used: {error}") from None
    rng = np.random.default_rng(seed)
    places = rng.standard_normal((count, size))
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    places[1::2] *= rng.random((count // 2, 1)) ** (1.0 / size)
    # The χ² quantile; scipy.stats has it, too, but takes long to load.
    radius = math.sqrt(2.0 * gammaincinv(0.5 * size, COVERAGE))
    steps = radius * places @ covariance.principal_steps.T
    models = [_possible(bare, names, step) for step in steps]
    return LikelyModels(bare, names, models, places, steps)


def _possible(model: Model, names: tuple[str, ...], step: Array) -> Model:
    """Returns a model with parameters moved by a step, or by as much of the step as is valid."""
    centre = np.array([parameter_value(model, name) for name in names])
    for share in np.linspace(1.0, 0.0, 21):
        try:
            values = dict(zip(names, (centre + share * step).tolist(), strict=True))
            moved = with_parameters(model, values)
            moved.mode_constants()
        except SloshModelError:
            continue
        return moved
    return model
