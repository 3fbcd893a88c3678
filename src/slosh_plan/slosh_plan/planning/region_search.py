"""Searches the fastest motion that keeps its limits for all likely parameters of the model.

The search starts from a motion that keeps them for the model's own parameters. Each motion that it
finds is simulated with all likely models. Where some of them are far above a limit they become
scenarios, whose liquids the next optimisation takes along; where the excess is small the limit is
lowered by it. An optimisation that does not converge is tried again from the motion slowed down,
and by way of scenarios half as far from the model. What is left of the excess at the end is
removed by slowing the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_model.model import Model
from slosh_plan.planning.checked import (
    CheckedMotion,
    LooseContainer,
    heights_after,
    standing_uses,
)
from slosh_plan.planning.likely import LikelyModels
from slosh_plan.planning.limits import STANDING_LIMITS, PlanLimits
from slosh_plan.planning.optimise import PathSearch
from slosh_plan.planning.search import OptimalSearch, lowered, resumed, waves_of
from slosh_plan.planning.searched_law import Legs
from slosh_plan.planning.time_law import PlannedMotion
from slosh_plan.prediction import ModelError
from slosh_plan.tuning import TUNING

JUDGED = ("height", "residual", *STANDING_LIMITS)
"""Limits of which a motion uses another share with each model."""
STANDING_PARTS = 10
"""Parts into which models are divided: the first with one that slides or tips is the last."""


class Judged(NamedTuple):
    """A motion, with the heights that each of the likely models gives for it.

    Attributes:
        motion: its upper heights are those of all models, with the model's measured error, and
            its shares of friction and base are the largest of all models.
        heights: (models, 2) greatest heights in the motion and after its end [m].
        used: (models, 4) shares of the limits JUDGED that are used, with the model's error; 0 of
            the last two for models that were not looked at, or where the container is held.
        legs: where another search may start; empty: the motion is not of a search.
    """

    motion: CheckedMotion
    heights: Array
    used: Array
    legs: Legs = ()


def upper_heights(
    models: Sequence[Model],
    motion: PlannedMotion,
    attitude: Array | None,
    error: ModelError | None,
) -> tuple[Array, Array]:
    """Returns the heights of a motion with many models, and the upper ends of their intervals.

    Args:
        models: the models.
        motion: the motion.
        attitude: (4,) quaternion that the container keeps; None: upright.
        error: the models' measured error; None: none was asked for.

    Returns:
        (models, 2) greatest heights in the motion and after its end, and the upper ends of their
        intervals [m].
    """
    rows, known = len(motion.t) - 1, error or ModelError()
    each = heights_after(models, motion, attitude)
    heights = np.array([(float(msh.max()), float(msh[rows:].max())) for msh in each])
    share = np.where(np.isfinite(heights), abs(known.epsilon) * heights, 0.0)
    upper: Array = heights + np.hypot(known.half_width(0.0, 0.0), share)
    return heights, upper


def likely_standing(
    models: Sequence[Model],
    motion: PlannedMotion,
    attitude: Array | None,
    loose: LooseContainer,
    limits: tuple[float, float] = (1.0, 1.0),
) -> Array:
    """Returns the used fractions (models, 2) of friction and support base for many models.

    Where some models exceed a limit not all others are looked at; their shares are 0.

    Args:
        models, motion, attitude: as of `upper_heights`.
        loose: how the container stands.
        limits: of these shares.
    """
    found = np.zeros((len(models), len(STANDING_LIMITS)))
    for begin in range(STANDING_PARTS):
        part = models[begin::STANDING_PARTS]
        if part:
            found[begin::STANDING_PARTS] = list(standing_uses(part, motion, attitude, loose))
        if (found > limits).any():
            break
    return found


class RegionFound(NamedTuple):
    """Result of the search for the fastest motion that is safe with all likely models.

    Attributes:
        judged: the motion; None: none keeps the limits.
        scenarios: number of models that the search planned for, beside the model itself.
        words: why the motion is slower than an optimal one; empty: it is not.
    """

    judged: Judged | None
    scenarios: int
    words: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class RegionSearch:
    """Searches the fastest motion that keeps the limits in all likely models.

    Attributes:
        search: of the model's own motion, with the limits and the time.
        likely: the models.
    """

    search: OptimalSearch
    likely: LikelyModels

    def judged(
        self, motion: CheckedMotion, legs: Legs = (), models: Sequence[Model] | None = None
    ) -> Judged:
        """Simulates a motion with chosen models, or with all likely models by default."""
        check, limits = self.search.check, self.search.limits
        models = models or self.likely.models
        heights, upper = upper_heights(models, motion.motion, check.attitude, check.error)
        shares, allowed = np.zeros_like(upper), (limits.friction, limits.tipping)
        if check.loose is not None:
            shares = likely_standing(
                models, motion.motion, check.attitude, check.loose, allowed
            )  # fmt: skip
        peak, residual = upper.max(axis=0).tolist()
        largest = dict(zip(STANDING_LIMITS, shares.max(axis=0).tolist(), strict=True))
        raised = replace(
            motion, upper=max(motion.upper, peak),
            residual_upper=max(motion.residual_upper, residual),
            standing={name: max(used, largest[name]) for name, used in motion.standing.items()},
        )  # fmt: skip
        used = np.hstack([upper / [limits.height, limits.residual], shares / allowed])
        return Judged(raised, heights, used, legs)

    def run(self, motion: CheckedMotion, legs: Legs) -> RegionFound:
        """Searches the motion, starting from the motion for the model's own parameters.

        Args:
            motion: that one.
            legs: of the search that found it.
        """
        search, chosen, adding, words = self.search, list[int](), True, ""
        fresh = search.nominal.reduced(TUNING.ahead)
        now, asked, times = self.judged(motion, legs), fresh, 0
        for _ in range(TUNING.robust_rounds):
            if now.motion.keeps(search.limits):
                return RegionFound(now, len(chosen))
            adding &= search.watch.elapsed < TUNING.robust_adding * search.time_limit
            new = self.far(now.used, chosen, TUNING.robust_near) if adding else []
            excess = now.motion.excess(search.limits)
            if new:
                asked = replace(asked, **{name: getattr(fresh, name) for name in JUDGED})
                excess |= dict.fromkeys(JUDGED, 0.0)
            # What a lower limit did not mend needs larger steps.
            times = 0 if new else times + 1
            step = 2.0 ** max(times - 1, 0)
            asked = lowered(asked, {name: step * share + TUNING.robust_ahead * (share > 0.0)
                                    for name, share in excess.items()})  # fmt: skip
            search.watch.enter(f"search for {1 + len(chosen) + len(new)} models")
            found = self._solved(now, chosen, new, asked)
            if found is not None:
                now, chosen = found, [*chosen, *new]
            elif new and not search.over():
                # Without these scenarios the limits can still be lowered.
                adding = False
            else:
                words = search.why_over() if search.over() else "the search failed"
                break
        else:
            words = f"the search kept exceeding a limit after {TUNING.robust_rounds} rounds"
        if now.motion.keeps(search.limits):
            return RegionFound(now, len(chosen))
        return RegionFound(self.slowed(now), len(chosen), words)

    def slowed(self, start: Judged) -> Judged | None:
        """Returns a motion, slowed until no limit is exceeded; None if that would be too slow.

        Args:
            start: the motion as fast as a search found it.
        """
        limits, factor = self.search.limits, 1.0
        order = np.argsort(-start.used.max(axis=1))
        few = [
            self.likely.models[place] for place in {*order[:20].tolist(), *order[::25].tolist()}
        ]
        while factor < TUNING.robust_slowest and not self.search.watch.stopped():
            factor *= TUNING.robust_ratio
            legs = tuple(leg.slowed(factor) for leg in start.legs)
            motion = self.search.checked(legs)
            if motion is None or not self.judged(motion, legs, few).motion.keeps(limits):
                continue
            every = self.judged(motion, legs)
            if every.motion.keeps(limits):
                return every
        return None

    def _solved(
        self, start: Judged, chosen: list[int], new: list[int], asked: PlanLimits
    ) -> Judged | None:
        """Optimises a motion for chosen likely models; None if every initial guess fails."""
        order = sorted([*chosen, *new], key=lambda place: -float(start.used[place].max()))
        places = order[: TUNING.robust_liquids]
        others = [self.likely.models[place] for place in places]
        # With other models than before a slower start converges faster.
        factors = TUNING.robust_starts[:: -1 if new else 1]
        for problem, guess in self._starts(start, places, others, asked, factors):
            if self.search.over():
                return None
            found = self._solution(problem, guess, asked)
            if found is not None:
                return found
        return None

    def _starts(
        self,
        start: Judged,
        places: list[int],
        others: list[Model],
        asked: PlanLimits,
        factors: Sequence[float],
    ) -> Iterator[tuple[PathSearch, Legs]]:
        """Yields the optimisations to try one after the other, each with an initial guess."""
        problem = self._problem(start.legs, others)
        for factor in factors:
            legs = tuple(leg.slowed(factor) for leg in start.legs)
            motion = self.search.checked(legs)
            if motion is not None:
                yield problem, resumed(legs, problem, self._waves(others, motion.motion))
        half = [self.likely.nearer(place, 0.5) for place in places]
        near = self._problem(start.legs, half)
        guess = resumed(start.legs, near, self._waves(half, start.motion.motion))
        found = self._solution(near, guess, asked)
        if found is not None:
            yield problem, resumed(
                found.legs, problem, self._waves(others, found.motion.motion)
            )  # fmt: skip

    def _solution(self, problem: PathSearch, guess: Legs, asked: PlanLimits) -> Judged | None:
        """Solves an optimisation and simulates its motion; None if it did not converge."""
        search = self.search
        left = search.time_limit - search.watch.elapsed
        solution = problem.solve(asked, guess, left, search.over)
        motion = search.checked(solution.legs) if solution.converged else None
        return None if motion is None else self.judged(motion, solution.legs)

    def _problem(self, legs: Legs, others: list[Model]) -> PathSearch:
        durations = [leg.duration for leg in legs]
        return self.search.problem(durations, tilting=legs[0].tilts, others=others)

    def _waves(self, others: list[Model], motion: PlannedMotion) -> Callable[[Array], Array]:
        return waves_of([self.search.check.model, *others], motion)

    def far(self, used: Array, chosen: list[int], near: float) -> list[int]:
        """Returns models that exceed a limit the most and differ from those already chosen.

        Args:
            used: (models, limits) shares of the limits.
            chosen: models.
            near: excess that is not far, as a share of the limit.
        """
        found: list[int] = []
        for column in used.T:
            over = np.flatnonzero(column > 1.0 + near)
            for apart in TUNING.apart:
                others = self.likely.places[[*chosen, *found]]
                gaps = np.linalg.norm(self.likely.places[over][:, None] - others[None], axis=2)
                far = over[gaps.min(axis=1, initial=np.inf) > apart]
                if len(far):
                    found.append(int(far[np.argmax(column[far])]))
                    break
        return found
