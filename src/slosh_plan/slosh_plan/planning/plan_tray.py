"""Plans the fastest motion of a tray that keeps every container below its limit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

from slosh_base.types import Array
from slosh_model.tray import Tray, TrayContainer
from slosh_plan.errors import SloshPlanError
from slosh_plan.limits import HeightLimits
from slosh_plan.planning.checked import (
    AllContainers,
    Checker,
    LooseContainer,
    attitudes,
    error_of,
    horizon,
)
from slosh_plan.planning.final_check import Kept, broken
from slosh_plan.planning.given_law import all_laws
from slosh_plan.planning.known_laws import LONGEST, best_scaled
from slosh_plan.planning.likely import NEEDED
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Path
from slosh_plan.planning.plan import (
    TIME_LIMIT,
    NoSafeMotionError,
    Plan,
    distance_to_rim,
    model_for,
    plan,
    plan_remarks,
)
from slosh_plan.planning.progress import Watch
from slosh_plan.planning.robust import LikelyHeights, likely_use, plan_robust
from slosh_plan.planning.searched_law import SEARCHED
from slosh_plan.planning.time_law import PlannedMotion, TimeLaw
from slosh_plan.prediction import ModelError, Prediction, check_start
from slosh_plan.start import LiquidStates, state_of
from slosh_plan.trajectory import Trajectory
from slosh_plan.tray import TrayPrediction, check_present, limits_of, predict_tray
from slosh_plan.validity import validity_words

MOST = 8
"""Plans that are tried."""
LOWERED = 0.98
"""A limit that did not do is lowered by what was exceeded, and to this share."""


class TrayPlan(NamedTuple):
    """A plan that keeps the limits of every container on a tray.

    Attributes:
        plan: for the container that determines it.
        one: that container; its name is empty where a model stands for a tray of one.
        found: what the motion does to each, by its own limits; None: there is no tray.
        likely: heights for all likely parameters of its model; None: these were not asked for.
    """

    plan: Plan
    one: TrayContainer
    found: TrayPrediction | None = None
    likely: LikelyHeights | None = None


def no_error(model: str) -> ModelError | None:
    """Returns None for every model, since no model error is known."""
    return None


def plan_tray(
    tray: Tray,
    limits: PlanLimits,
    make: Callable[[TrayContainer, PlanLimits], TrayPlan],
    *,
    attitude: Array | None = None,
    margin: float = 0.0,
    error: ModelError | None = None,
    robust: bool = False,
) -> TrayPlan:
    """Plans for the container with the lowest limit, then again if another exceeds its limit.

    A plan counts where its simulation keeps the limits of all. Where it exceeds that of another
    container the next plan is made for that one, each time with a limit that is lower by as much
    as its last plan was above any.

    Args:
        tray: the tray.
        limits: of all, beside the containers' own limits and rims.
        make: plans for one container by its limits; its heights are those of the placed model.
        attitude: (4,) that the tray keeps; None: not turned.
        margin: by which the heights stay below their limits [m].
        error: the models' measured error; None: the heights themselves keep the limits.
        robust: whether the limits hold for all likely parameters of every container's model.

    Raises:
        NoSafeMotionError: none of the plans keeps all limits.
        SloshPlanError: no container is there.
    """
    check_present(tray)
    judge = _Judge(tray, limits, attitude, margin, error, robust)
    by_name = {each.name: each for each in tray.present}
    lowered = dict.fromkeys(by_name, 1.0)
    one = min(by_name, key=lambda name: _height(by_name[name], limits))
    tried, best = list[TrayPlan](), None
    for _ in range(MOST):
        own, share = limits_of(by_name[one], limits), lowered[one]
        asked = replace(
            own, height=own.height * share, residual=own.residual * share,
            friction=own.friction * share, tipping=own.tipping * share,
        )  # fmt: skip
        try:
            answer = make(by_name[one], asked)
        except NoSafeMotionError:
            break
        tried.append(answer)
        found, use = judge(answer.plan.found.motion)
        worst = max(use, key=lambda name: use[name])
        if use[worst] <= 1.0:
            best = answer._replace(found=found)
            break
        lowered[one] *= LOWERED / use[worst]
        one = worst
    else:
        failed = f"{worst} exceeds its own by {100.0 * (use[worst] - 1.0):.0f} %"
    best = _faster(judge, tried, best)
    if best is not None:
        if words := _broken(judge, best.plan):
            raise NoSafeMotionError(f"the planned motion failed its last check: {words}")
        return best
    if len(tried) < MOST:
        raise NoSafeMotionError(f"no motion keeps the limits of container {one}")
    raise NoSafeMotionError(f"none of {MOST} plans keeps the limits of all containers: {failed}")


class _Judge(NamedTuple):
    """Tells what a motion of a tray does to all containers.

    Attributes:
        tray, limits, attitude, margin, error, robust: as of `plan_tray`.
    """

    tray: Tray
    limits: PlanLimits
    attitude: Array | None
    margin: float
    error: ModelError | None
    robust: bool

    def __call__(self, motion: PlannedMotion) -> tuple[TrayPrediction, dict[str, float]]:
        """Returns the prediction, and which share of its limits each container uses."""
        attitude, margin, error = self.attitude, self.margin, self.error
        found = _predicted(self.tray, motion, self.limits, attitude, error)
        by_name = {each.name: each for each in self.tray.present}
        use = {
            name: max(
                _likely(by_name[name], motion, each, attitude, margin, error)
                if self.robust
                else _use(each, margin),
                *found.standing.get(name, (0.0,)),
            )
            for name, each in found.containers.items()
        }
        return found, use

    def checkers(self, model: TrayContainer, path: Path) -> AllContainers:
        """Returns the check of all containers along a path, as shares of one's limits."""
        others = [each for each in self.tray.present if each.name != model.name]
        return AllContainers(
            tuple(
                (
                    Checker(
                        model_for(each.placed, self.limits, path),
                        self.attitude,
                        error_of(each.model, self.error),
                        loose=LooseContainer.of(each),
                    ),
                    limits_of(each, self.limits).under_rim(each.placed).lowered(self.margin),
                )
                for each in (model, *others)
            )
        )


def _broken(judge: _Judge, answer: Plan) -> str:
    """Describes what an answer does not keep, of all containers; see `broken`."""
    limits = judge.limits
    containers = [
        Kept(
            model_for(each.placed, limits, answer.path),
            limits_of(each, limits).under_rim(each.placed),
            LooseContainer.of(each),
        )
        for each in judge.tray.present
    ]
    return broken(answer.found.motion, answer.path, limits, judge.attitude, containers)


def _faster(judge: _Judge, tried: list[TrayPlan], best: TrayPlan | None) -> TrayPlan | None:
    """Returns the fastest of all laws that the plans tried, where it is faster than `best`.

    Args:
        judge: of all containers.
        tried: plans for one container each, which others need not keep.
        best: the fastest that all keep; None: there is none.
    """
    if not tried:
        return best
    first = tried[0]
    path, one = first.plan.path, first.one
    laws, names = {**_standard(first.plan)}, [each.one.name for each in tried]
    for name in dict.fromkeys(names):
        plans = [each.plan for each in tried if each.one.name == name]
        searched = [law for one in plans for key, law in one.laws.items() if _is_searched(key)]
        laws |= {
            f"{SEARCHED} {n} of the search for {name}, slowed": law
            for n, law in enumerate(searched, start=1)
        }
    check = judge.checkers(one, path)
    longest = LONGEST if best is None else best.plan.found.motion.duration
    _, kept = check.each[0]
    for _ in range(MOST):
        law = best_scaled(check, kept, laws, longest=longest)
        if law is None:
            return best
        found, use = judge(law.found.motion)
        worst = max(use.values())
        if worst <= 1.0:
            own = check.each[0][0]([law.found.motion])[0]
            standard = law.law in _standard(first.plan)
            known = replace(law, found=own) if standard else first.plan.scaled
            plan_ = replace(
                first.plan, found=own, limits=limits_of(one, judge.limits).under_rim(one.placed),
                method=law.law, scaled=known, reason="it keeps all containers, and is faster",
                upper=(own.upper, own.residual_upper) if first.plan.error else None, legs=(),
                distance_to_rim=distance_to_rim(one.placed, own),
            )  # fmt: skip
            return TrayPlan(plan_, one, found)
        kept = replace(kept, height=kept.height / worst, residual=kept.residual / worst)
    return best


def _standard(answer: Plan) -> dict[str, TimeLaw]:
    """Returns the laws that a plan tried and that do not stem from its search."""
    return {name: law for name, law in answer.laws.items() if not _is_searched(name)}


def _is_searched(law: str) -> bool:
    return law.startswith(f"{SEARCHED} ")


def plan_container(
    tray: Tray,
    path: Path,
    limits: PlanLimits,
    *,
    attitude: Array | None = None,
    margin: float = 0.0,
    errors: Callable[[str], ModelError | None] = no_error,
    time_limit: float = TIME_LIMIT,
    watch: Watch | None = None,
    robust: bool = False,
) -> TrayPlan:
    """Plans a motion of a tray or a single container within a limited computing time.

    Args:
        tray: a tray, or a model as a tray of one.
        path, limits, attitude, margin: as of `plan`.
        errors: the measured error of a model by its name.
        time_limit: of all searches together [s]; each of a tray's has half of what is left.
        watch: ends the searches; None: nobody does.
        robust: whether the limits hold for all likely parameters of the models; see `plan_robust`.

    Raises:
        SloshPlanError: as of `plan` and `plan_robust`.
    """
    watch = watch or Watch()
    for one in tray.present if robust else ():
        if one.model.covariance is None:
            raise SloshPlanError(f"container {one.name}: {NEEDED}" if one.name else NEEDED)

    laws: Mapping[str, TimeLaw] | None = None
    if tray.is_tray:
        laws = all_laws(path, limits, time_limit - watch.elapsed, watch.stopped)

    def make(one: TrayContainer, kept: PlanLimits) -> TrayPlan:
        watch.forget()
        left = time_limit
        if tray.is_tray:
            left = 0.5 * max(time_limit - watch.elapsed, 0.0)
        planner = plan_robust if robust else plan
        found = planner(
            one.placed, path, kept, attitude=attitude, margin=margin,
            error=errors(one.model.name), time_limit=left, watch=watch,
            loose=LooseContainer.of(one), laws=laws,
        )  # fmt: skip
        if isinstance(found, Plan):
            return TrayPlan(found, one)
        return TrayPlan(found.plan, one, likely=found.likely)

    if not tray.is_tray:
        return make(tray.first, limits)
    return plan_tray(
        tray, limits, make, attitude=attitude, margin=margin,
        error=errors(tray.first.model.name), robust=robust,
    )  # fmt: skip


def remarks_of(planned: TrayPlan, limits: PlanLimits) -> list[str]:
    """Returns what `predict` remarks on the motion of a plan, of a tray with containers' names.

    Args:
        planned: the plan.
        limits: that it was made with.
    """
    if planned.found is None:
        model = model_for(planned.one.placed, limits, planned.plan.path)
        return plan_remarks(model, planned.plan)
    each = planned.found.containers.items()
    return [f"{name}: {w}" for name, one in each for w in validity_words(one.flags, one.growth)]


def check_states(tray: Tray, limits: PlanLimits, states: LiquidStates) -> None:
    """Raises SloshPlanError if a container's liquid exceeds its limit even before any motion."""
    for one in tray.present:
        with _named(one.name):
            check_start(one.placed, state_of(states, one.name), limits_of(one, limits))


def check_plan_from(
    tray: Tray, answer: Plan, limits: PlanLimits, attitude: Array | None, states: LiquidStates
) -> None:
    """Raises SloshPlanError if a plan exceeds a limit from the present state of the liquid.

    Args:
        tray: a tray, or a model as a tray of one.
        answer: the plan.
        limits: that it was made with.
        attitude: (4,) that the tray keeps; None: not turned.
        states: the liquid when the motion begins.
    """
    found = _predicted(tray, answer.found.motion, limits, attitude, None, states)
    for name, one in found.containers.items():
        peak, residual = one.nonlinear.peak, one.nonlinear.residual
        if peak > one.limits.height or residual > one.limits.residual:
            with _named(name):
                raise SloshPlanError(
                    f"the liquid moves: from its state now the plan reaches {1e3 * peak:.1f} mm "
                    f"and leaves {1e3 * residual:.1f} mm; wait until it has settled"
                )
    if found.falling:
        raise SloshPlanError(f"the liquid moves: {found.falling}; wait until it has settled")


@contextmanager
def _named(container: str) -> Iterator[None]:
    """Adds the container's name to a SloshPlanError that the enclosed block raises."""
    try:
        yield
    except SloshPlanError as error:
        if not container:
            raise
        raise SloshPlanError(f"container {container}: {error}") from None


def _height(one: TrayContainer, limits: PlanLimits) -> float:
    return limits_of(one, limits).under_rim(one.model).height


def _use(found: Prediction, margin: float) -> float:
    """Returns the largest fraction of its limits that a container uses."""
    height, residual = found.limits.height, found.limits.residual
    return max((found.upper + margin) / height, (found.residual_upper + margin) / residual)


def _likely(
    one: TrayContainer,
    motion: PlannedMotion,
    found: Prediction,
    attitude: Array | None,
    margin: float,
    error: ModelError | None,
) -> float:
    """Returns the largest fraction of its limits that a container uses with likely parameters."""
    loose = LooseContainer.of(one)
    return likely_use(one.placed, motion, found.limits, attitude, margin, error, loose)


def _predicted(
    tray: Tray,
    motion: PlannedMotion,
    limits: PlanLimits,
    attitude: Array | None,
    error: ModelError | None,
    states: LiquidStates | None = None,
) -> TrayPrediction:
    """Predicts the response of each container on the tray to a planned motion."""
    turned = attitudes(motion, attitude, len(motion.t))
    trajectory = Trajectory(motion.t, motion.acceleration, turned, name="the plan")
    asked = HeightLimits(limits.height, limits.residual, rim_distance=limits.rim_distance)
    longest = max(horizon(one.model) for one in tray.present)
    return predict_tray(
        tray, [trajectory], limits=asked, state=states, horizon=longest, error=error
    )[0]
