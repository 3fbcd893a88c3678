"""Plans that keep their limits for every likely value of the model's parameters.

The likely values are the ellipsoid that holds the true ones with a probability of 95 %, by the
covariance of their errors. Each motion is simulated with 1,000 models of it. The models with the
highest waves become scenarios of the next search, which plans for all of them at once, until none
of the 1,000 exceeds a limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincinv

from slosh_base.types import Array
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.parameters import parameter_value, with_parameters
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.checked import heights_after
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Path
from slosh_plan.planning.plan import TIME_LIMIT, NoSafeMotionError, Plan, plan, tilting
from slosh_plan.planning.progress import Watch
from slosh_plan.planning.time_law import PlannedMotion
from slosh_plan.prediction import ModelError
from slosh_plan.tuning import TUNING

COVERAGE = 0.95
"""Probability that the true parameters are among the likely ones."""
SAMPLES = 1000
"""Models with which a motion is simulated."""
SEED = 39
NEEDED = (
    "a robust plan needs the covariance of the model's parameters, which model.yaml lacks: "
    "slosh identify writes it there"
)


@dataclass(frozen=True, slots=True)
class LikelyHeights:
    """Heights that a motion reaches for all likely parameters of the model.

    Attributes:
        parameters: whose likely values were tried.
        count: number of models that were simulated.
        peak: greatest height of all [m].
        residual: greatest height after the end of all [m].
        nominal_duration: of the plan for the model's own parameters alone [s].
        scenarios: number of models of these that the search planned for, beside the model itself.
    """

    parameters: tuple[str, ...]
    count: int
    peak: float
    residual: float
    nominal_duration: float
    scenarios: int


class RobustPlan(NamedTuple):
    """A plan for all likely parameters of the model.

    Attributes:
        plan: the plan.
        likely: its heights.
    """

    plan: Plan
    likely: LikelyHeights


class LikelyModels(NamedTuple):
    """Models with parameters from the 95 % confidence region.

    Attributes:
        models: the models.
        places: (models, P) of their parameters in the region, which is the unit ball there.
    """

    models: list[Model]
    places: Array


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
    try:
        centre = np.array([parameter_value(model, name) for name in covariance.parameters])
    except SloshModelError as error:
        raise SloshPlanError(f"the model's covariance cannot be used: {error}") from None
    size = len(centre)
    rng = np.random.default_rng(seed)
    places = rng.standard_normal((count, size))
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    places[1::2] *= rng.random((count // 2, 1)) ** (1.0 / size)
    # The χ² quantile; scipy.stats has it, too, but takes long to load.
    radius = math.sqrt(2.0 * gammaincinv(0.5 * size, COVERAGE))
    steps = radius * places @ covariance.principal_steps.T
    models = [_possible(bare, covariance.parameters, centre, step) for step in steps]
    return LikelyModels(models, places)


def _possible(model: Model, names: tuple[str, ...], centre: Array, step: Array) -> Model:
    """Returns a model with parameters changed by a step, or by the largest possible part of it."""
    for share in np.linspace(1.0, 0.0, 21):
        try:
            values = dict(zip(names, (centre + share * step).tolist(), strict=True))
            moved = with_parameters(model, values)
            moved.mode_constants()
        except SloshModelError:
            continue
        return moved
    return model


def plan_robust(
    model: Model,
    path: Path,
    limits: PlanLimits,
    *,
    attitude: Array | None = None,
    margin: float = 0.0,
    error: ModelError | None = None,
    time_limit: float = TIME_LIMIT,
    watch: Watch | None = None,
) -> RobustPlan:
    """Plans a motion that keeps its limits for all likely parameters of the model.

    Args:
        model: the model, with the covariance of its parameters.
        path, limits, attitude, margin, error, time_limit, watch: as of `plan`.

    Raises:
        NoSafeMotionError: no motion keeps the limits for all of them.
        SloshPlanError: the model has no covariance, and as of `plan`.
    """
    watch = watch or Watch()
    likely = likely_models(tilting(model, limits, path))
    bare = replace(model, covariance=None)
    kept = limits
    for one in (bare, *likely.models):
        # A fuller container has a nearer rim.
        kept = kept.under_rim(one)
    nominal = answer = plan(
        bare, path, kept, attitude=attitude, margin=margin, error=error, watch=watch,
        time_limit=watch.elapsed + TUNING.nominal_share * time_limit,
    )  # fmt: skip
    chosen: list[int] = []
    for _ in range(TUNING.robust_rounds):
        heights = _heights(likely.models, answer.found.motion, attitude)
        used = _used(heights, kept, margin, error)
        if used.max() <= 1.0 + TUNING.slack:
            peak, residual = heights.max(axis=0).tolist()
            found = LikelyHeights(
                _parameters(model), len(likely.models), peak, residual,
                nominal.found.motion.duration, len(chosen),
            )  # fmt: skip
            return RobustPlan(replace(answer, upper=answer.upper or (peak, residual)), found)
        chosen += _worst(used, likely.places, chosen)
        answer = plan(
            bare, path, kept, attitude=attitude, margin=margin, error=error, watch=watch,
            scenarios=[likely.models[place] for place in chosen], start=answer,
            time_limit=0.5 * (watch.elapsed + max(watch.elapsed, time_limit)),
        )  # fmt: skip
    raise NoSafeMotionError(
        f"none of {TUNING.robust_rounds} plans keeps the limits for all likely parameters: the "
        f"last one exceeds a limit by {100.0 * (float(used.max()) - 1.0):.1f} %"
    )


def _parameters(model: Model) -> tuple[str, ...]:
    return () if model.covariance is None else model.covariance.parameters


def _heights(models: list[Model], motion: PlannedMotion, attitude: Array | None) -> Array:
    """Returns the maximum heights (models, 2) during a motion and after its end [m]."""
    return np.array(list(_extremes(models, motion, attitude)))


def _extremes(
    models: list[Model], motion: PlannedMotion, attitude: Array | None
) -> Iterator[tuple[float, float]]:
    for msh in heights_after(models, motion, attitude):
        yield float(msh.max()), float(msh[len(motion.t) - 1 :].max())


def _worst(used: Array, places: Array, chosen: list[int]) -> list[int]:
    """Returns the models that exceed each limit most and differ from those already chosen."""
    found: list[int] = []
    for column in used.T:
        over = np.flatnonzero(column > 1.0)
        for apart in TUNING.apart:
            others = places[[*chosen, *found]]
            gaps = np.linalg.norm(places[over][:, None] - others[None], axis=2)
            far = over[gaps.min(axis=1, initial=np.inf) > apart]
            if len(far):
                found.append(int(far[np.argmax(column[far])]))
                break
    return found


def _used(heights: Array, limits: PlanLimits, margin: float, error: ModelError | None) -> Array:
    """Returns the fractions (models, 2) of the peak and the residual limit that heights use."""
    known = error or ModelError()
    share = np.where(np.isfinite(heights), abs(known.epsilon) * heights, 0.0)
    upper = heights + np.hypot(known.half_width(0.0, 0.0), share)
    used: Array = (upper + margin) / np.array([limits.height, limits.residual])
    return used
