"""Plans that keep their limits for every likely value of the model's parameters.

The likely values are the ellipsoid that holds the true ones with a probability of 95 %, by the
covariance of their errors. Each motion is simulated with 1,000 models of it; see `RegionSearch`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from slosh_base.types import Array
from slosh_model.model import Model
from slosh_plan.limits import HeightLimits
from slosh_plan.planning.checked import LooseContainer
from slosh_plan.planning.final_check import Kept, broken
from slosh_plan.planning.known_laws import Scaled
from slosh_plan.planning.likely import likely_models
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Path
from slosh_plan.planning.plan import (
    TIME_LIMIT,
    NoSafeMotionError,
    Plan,
    demanded,
    distance_to_rim,
    fastest_law,
    model_for,
    plan,
)
from slosh_plan.planning.progress import Watch
from slosh_plan.planning.region_search import (
    Judged,
    RegionFound,
    RegionSearch,
    likely_standing,
    upper_heights,
)
from slosh_plan.planning.search import OptimalSearch
from slosh_plan.planning.time_law import PlannedMotion, TimeLaw
from slosh_plan.prediction import ModelError
from slosh_plan.tuning import TUNING


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
    """A plan that keeps the limits for all likely parameters of the model.

    Attributes:
        plan: the plan.
        likely: its heights.
    """

    plan: Plan
    likely: LikelyHeights


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
    loose: LooseContainer | None = None,
    laws: Mapping[str, TimeLaw] | None = None,
) -> RobustPlan:
    """Plans a motion that keeps its limits for all likely parameters of the model.

    Args:
        model: the model, with the covariance of its parameters.
        path, limits, attitude, margin, error, time_limit, watch, loose, laws: as of `plan`.

    Raises:
        NoSafeMotionError: no motion keeps the limits for all of them.
        SloshPlanError: the model has no covariance, and as of `plan`.
    """
    watch = watch or Watch()
    likely = likely_models(model_for(model, limits, path))
    bare, kept = replace(model, covariance=None), limits
    for one in (bare, *likely.models):
        # A fuller container has a nearer rim.
        kept = kept.under_rim(one)
    nominal = plan(
        bare, path, kept, attitude=attitude, margin=margin, error=error, watch=watch, loose=loose,
        time_limit=watch.elapsed + TUNING.nominal_share * time_limit, laws=laws,
    )  # fmt: skip
    watch.forget()
    check, own, reduced, yaw = demanded(bare, path, kept, attitude, margin, error, loose)
    search = OptimalSearch(
        check, path, own, reduced, yaw, nominal.scaled, TUNING.robust_share * time_limit, watch
    )
    region = RegionSearch(search, likely)
    found = RegionFound(None, 0, nominal.reason)
    if nominal.legs:
        found = region.run(nominal.found, nominal.legs)
    known, law = None, found.judged
    if law is None or found.words:
        known, law = _known_law(region, law, nominal.laws)
    best = law.motion
    if words := broken(best.motion, path, kept, attitude, [Kept(check.model, kept, loose)]):
        raise NoSafeMotionError(f"the planned motion failed its last check: {words}")
    answer = replace(
        nominal, found=best, method=nominal.method if known is None else known.law,
        reason=found.words, upper=(best.upper, best.residual_upper),
        scaled=known or nominal.scaled, seconds=watch.elapsed,
        distance_to_rim=distance_to_rim(bare, best), legs=law.legs,
    )  # fmt: skip
    peak, residual = law.heights.max(axis=0).tolist()
    heights = LikelyHeights(
        likely.parameters, len(likely.models), peak, residual, nominal.found.motion.duration,
        found.scenarios,
    )  # fmt: skip
    return RobustPlan(answer, heights)


def _known_law(
    region: RegionSearch, best: Judged | None, laws: Mapping[str, TimeLaw]
) -> tuple[Scaled | None, Judged]:
    """Returns the fastest safe law (None if slower than `best`), and the faster motion.

    Args:
        region: the search.
        best: the fastest motion so far; None: there is none.
        laws: the laws.

    Raises:
        NoSafeMotionError: there is neither.
    """
    search, chosen = region.search, list[int]()
    check, over = search.check, 0.0
    for _ in range(TUNING.robust_laws):
        scenarios = tuple(region.likely.models[place] for place in chosen)
        check = replace(check, scenarios=scenarios)
        scaled = fastest_law(check, laws, search.limits, search.watch)
        if best is not None and scaled.found.motion.duration >= best.motion.motion.duration:
            return None, best
        found = region.judged(scaled.found)
        if found.motion.keeps(search.limits):
            return scaled, found
        over = float(found.used.max()) - 1.0
        chosen += region.far(found.used, chosen, 0.0)
    if best is not None:
        return None, best
    raise NoSafeMotionError(
        f"none of {TUNING.robust_laws} plans keeps the limits for all likely parameters: the last "
        f"one exceeds a limit by {100.0 * over:.1f} %"
    )


def likely_use(
    model: Model,
    motion: PlannedMotion,
    limits: HeightLimits,
    attitude: Array | None,
    margin: float,
    error: ModelError | None,
    loose: LooseContainer | None = None,
) -> float:
    """Returns the largest fraction of its limits that a motion uses for likely models.

    Args:
        model: the model, with the covariance of its parameters.
        motion: the motion.
        limits: of the heights.
        attitude, margin, error, loose: as of `plan`; a loose container may use all that holds it.

    Raises:
        SloshPlanError: the model has no covariance.
    """
    likely = likely_models(model if motion.attitude is None else model.with_gravity_tilt())
    _, upper = upper_heights(likely.models, motion, attitude, error)
    used = float(((upper + margin) / [limits.height, limits.residual]).max())
    if loose is None:
        return used
    return max(used, float(likely_standing(likely.models, motion, attitude, loose).max()))
