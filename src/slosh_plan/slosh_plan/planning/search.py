"""Searches the optimal time law until the simulation keeps every limit.

What a search finds is simulated with the whole model at 1 kHz; where it exceeds a limit, that
limit is lowered by the excess and the search goes on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from slosh_base.types import Array
from slosh_model import Inputs, Model, simulate
from slosh_plan.planning.checked import CheckedMotion, Checker, attitudes
from slosh_plan.planning.flow import first_mode, flow_of
from slosh_plan.planning.interval import CHAIN
from slosh_plan.planning.known_laws import LONGEST, Scaled, best_scaled
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.loose_terms import LooseTerms
from slosh_plan.planning.optimise import LegGuess, PathSearch, PathSolution
from slosh_plan.planning.path import Path
from slosh_plan.planning.progress import Watch
from slosh_plan.planning.searched_law import SEARCHED, Legs, SearchedLaw, guess_of
from slosh_plan.planning.time_law import PlannedMotion, whole_rows
from slosh_plan.tuning import TUNING

WORTH = 0.998
"""Part of the time of an optimal law from which on a slowed one takes its place."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Result of one search for a path's optimal time law.

    Attributes:
        motion: that keeps the limits; None: there is none.
        legs: where another search may start; empty: the motion is not of a search.
        words: why there is none, or no other than a known law.
        law: the name of the law, where it is not the search's own.
    """

    motion: CheckedMotion | None
    legs: Legs = ()
    words: str = ""
    law: str = ""

    @property
    def duration(self) -> float:
        """Duration of the motion [s], or infinity if none was found."""
        return math.inf if self.motion is None else self.motion.motion.duration


@dataclass(frozen=True, slots=True, eq=False)
class OptimalSearch:
    """Searches an optimal time law for a path from several initial guesses.

    Attributes:
        check: tells what a motion does.
        path: the path.
        limits: to keep.
        nominal: the same for heights without the model's error.
        yaw: of the container [rad].
        scaled: the fastest known law.
        time_limit: on the watch, after which the search ends [s].
        watch: is told.
        tried: results of all optimisations, also of those that were ended or exceed a limit.
    """

    check: Checker
    path: Path
    limits: PlanLimits
    nominal: PlanLimits
    yaw: float
    scaled: Scaled
    time_limit: float
    watch: Watch
    tried: list[Legs] = field(default_factory=list)

    def run(self) -> Found:
        """Returns the best motion, and why it follows only a standard time law, if it does."""
        best, last = Found(self.scaled.found), "the search found nothing faster"
        if self.over():
            return replace(best, words=self.why_over())
        for problem, guess in self._starts():
            found = self._tightened(problem, guess, best)
            if found.motion is not None:
                best = found
                self.watch.found(found.motion.motion.duration)
            last = found.words or last
            if self._enough(best):
                break
        if self.limits.tilt > 0.0 and best.legs and not self.over():
            best = self._tilted(best)
        best = best if best.legs else replace(best, words=last)
        return self._slowed(best)

    @property
    def laws(self) -> dict[str, SearchedLaw]:
        """All that was found and runs from rest to rest, by names."""
        laws = (SearchedLaw(self.path, self.yaw, legs) for legs in self.tried)
        whole = [law for law in laws if law.whole]
        return {f"{SEARCHED} {n} of the search": law for n, law in enumerate(whole, start=1)}

    def _slowed(self, best: Found) -> Found:
        """Returns the fastest of the searched laws that keeps the limits when slowed evenly."""
        longest = best.duration * (WORTH if best.legs else 1.0)
        faster = {f"{name}, slowed": law for name, law in self.laws.items()
                  if law.duration < longest}  # fmt: skip
        found = best_scaled(self.check, self.limits, faster, self.watch, longest)
        if found is None:
            return best
        words = best.words or "the search exceeded a limit"
        return Found(found.found, words=words, law=found.law)

    def _starts(self) -> Iterator[tuple[PathSearch, Legs]]:
        """Yields optimisations with constant attitude, each with an initial guess."""
        known, motion = self.scaled.known, self.scaled.found.motion
        problem = self.problem(known.durations(motion.duration), tilting=False)
        waves = waves_of([self.check.model], motion)
        for n, factor in enumerate(TUNING.starts, start=1):
            self.watch.enter(f"search {n} of {len(TUNING.starts)}")
            yield problem, guess_of(known, motion.duration, problem, factor, waves)

    def _tilted(self, upright: Found) -> Found:
        """Optimises the motion with tilt, starting from the upright motion."""
        self.watch.enter("search with tilt")
        problem = self.problem([leg.duration for leg in upright.legs], tilting=True)
        found = self._tightened(problem, resumed(upright.legs, problem), upright)
        if found.motion is None:
            return upright
        self.watch.found(found.motion.motion.duration)
        return found

    def problem(
        self, durations: Sequence[float], *, tilting: bool, others: Sequence[Model] = ()
    ) -> PathSearch:
        """Creates the optimisation of the motion along the path.

        Args:
            durations: of the legs, about [s].
            tilting: whether the container may tilt.
            others: models with other parameters, whose liquids keep the limits, too.
        """
        models, loose = (self.check.model, *others), self.check.loose
        terms = (
            () if loose is None else tuple(LooseTerms.of(one, loose.standing) for one in models)
        )
        flows = [flow_of(model) for model in models]
        return PathSearch(flows, self.path, self.yaw, durations, tilting=tilting, loose=terms)

    def _enough(self, best: Found) -> bool:
        """Returns whether enough time was spent, so that no further initial guess is tried."""
        share = TUNING.again if best.legs else 1.0
        return self.watch.elapsed >= share * self.time_limit or self.watch.stopped()

    def _tightened(self, problem: PathSearch, guess: Legs, best: Found) -> Found:
        """Repeats the optimisation with reduced limits until the simulation keeps the limits.

        What is not faster than the best so far is not gone on with.
        """
        factors: Sequence[float]
        asked, factors = self.nominal.reduced(TUNING.ahead), (1.0,)
        words = f"the search kept exceeding a limit after {TUNING.search_rounds} rounds"
        for _ in range(TUNING.search_rounds):
            solution = self._solved(problem, guess, asked, factors)
            if solution is not None:
                self.tried.append(solution.legs)
            if solution is None or (not solution.converged and self.over()):
                words = self.why_over()
                break
            found = self.checked(solution.legs)
            faster = found is not None and found.motion.duration < best.duration
            if found is not None and faster and found.keeps(self.limits):
                return Found(found, solution.legs)
            if found is None or not solution.converged:
                words = f"the search failed ({solution.status})"
                break
            if not faster:
                words = "the search found nothing faster"
                break
            guess, factors = solution.legs, TUNING.repeated
            asked = lowered(asked, found.excess(self.limits))
        return Found(None, words=words)

    def _solved(
        self, problem: PathSearch, guess: Legs, asked: PlanLimits, factors: Sequence[float]
    ) -> PathSolution | None:
        """Optimises from slowed guesses until one converges; None if the time limit is reached.

        From a motion at the very limits, which are now a little lower, the solver may not find
        back; a slower one is well within those of acceleration, jerk and joints.
        """
        solution = None
        for factor in factors:
            if self.over():
                break
            left = self.time_limit - self.watch.elapsed
            start = tuple(leg.slowed(factor) for leg in guess)
            solution = problem.solve(asked, start, left, self.over)
            if solution.converged:
                break
        return solution

    def over(self) -> bool:
        """Returns whether the search must end: time is used up or a stop is requested."""
        return self.watch.stopped() or self.watch.elapsed >= self.time_limit

    def why_over(self) -> str:
        """Describes why the search must end: time limit or stop request."""
        late = self.watch.elapsed >= self.time_limit
        return "the search's time was up" if late else "the search was stopped"

    def checked(self, legs: Legs) -> CheckedMotion | None:
        """Simulates the motion of an optimisation's result; None if it is none, from rest to rest.

        An optimisation that was ended early may be anything.
        """
        law = SearchedLaw(self.path, self.yaw, legs)
        if not (law.whole and law.duration < LONGEST):
            return None
        return self.check([law.motion(whole_rows(law.duration))])[0]


def lowered(limits: PlanLimits, excess: dict[str, float]) -> PlanLimits:
    """Lowers each exceeded limit by its relative excess, for the next optimisation."""
    lower = {
        name: getattr(limits, name) / (1.0 + min(share, 1.0)) * (1.0 - TUNING.slack)
        for name, share in excess.items()
        if share > 0.0
    }
    return replace(limits, **lower)


def waves_of(models: Sequence[Model], motion: PlannedMotion) -> Callable[[Array], Array]:
    """Simulates a motion; returns the first mode's state in each model as function of time."""
    turned = attitudes(motion, None, len(motion.t))
    inputs = Inputs(motion.t, motion.acceleration, turned)
    modal = np.hstack([first_mode(model, simulate(model, inputs)[0].modal) for model in models])
    return lambda t: _at(t, motion.t, modal)


def resumed(legs: Legs, search: PathSearch, waves: Callable[[Array], Array] | None = None) -> Legs:
    """Creates the initial guess of an optimisation from an earlier result.

    Args:
        legs: the result.
        search: whose nodes the start has.
        waves: the liquids at given times [s], where they are others; None: those of the result.
    """
    found, begin, layout = [], 0.0, search.layout
    for leg, count in zip(legs, search.counts, strict=True):
        old = np.linspace(0.0, 1.0, len(leg.states))
        t = np.linspace(0.0, 1.0, count + 1)
        middle = 0.5 * (t[1:] + t[:-1])
        driven = leg.controls.shape[1]
        rates, liquids = np.split(leg.states, [CHAIN * driven], axis=1)
        states, controls = np.zeros((count + 1, layout.size)), np.zeros((count, layout.driven))
        states[:, : CHAIN * driven] = _at(t, old, rates)
        which = np.minimum((middle * len(leg.controls)).astype(int), len(leg.controls) - 1)
        controls[:, :driven] = leg.controls[which]
        if waves is None:
            states[:, layout.liquid], middles = _at(t, old, liquids), _at(middle, old, liquids)
        else:
            states[:, layout.liquid] = waves(begin + leg.duration * t)
            middles = waves(begin + leg.duration * middle)
        found.append(LegGuess(leg.duration, states, controls, middles))
        begin += leg.duration
    return tuple(found)


def _at(t: Array, times: Array, columns: Array) -> Array:
    return np.column_stack([np.interp(t, times, column) for column in columns.T])
