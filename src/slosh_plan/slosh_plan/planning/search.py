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
from slosh_plan.planning.path import Leg, Path
from slosh_plan.planning.progress import Watch
from slosh_plan.planning.time_law import (
    STEP,
    JerkLaw,
    PlannedMotion,
    Tilt,
    motion_along,
    whole_rows,
)
from slosh_plan.tuning import TUNING

Legs = tuple[LegGuess, ...]


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
class SearchedLaw:
    """The time law of a search's result, slowed evenly to any duration.

    Attributes:
        path: the path.
        yaw: of the container [rad].
        legs: the result; it need not keep any limit.
    """

    path: Path
    yaw: float
    legs: Legs

    @property
    def duration(self) -> float:
        """Duration of the result [s]; it may be any number."""
        return sum(leg.duration for leg in self.legs)

    @property
    def whole(self) -> bool:
        """Whether it runs forwards from rest to rest, as an ended search's result may not."""
        for law, leg in zip(self.laws(self.duration), self.path.legs, strict=True):
            nodes = law.nodes()
            ended = abs(nodes[-1, 1]) * law.duration < TUNING.ended * leg.length
            if not (ended and np.isfinite(nodes).all() and np.diff(nodes[:, 0]).min() > -1e-6):
                return False
        return True

    def durations(self, duration: float) -> tuple[float, ...]:
        """Returns the durations of the legs for a total duration [s]."""
        return tuple(leg.duration * duration / self.duration for leg in self.legs)

    def laws(self, duration: float) -> list[JerkLaw]:
        """Returns the time laws of the legs for a total duration [s]."""
        factor = duration / self.duration
        return [
            _law_of(found, leg).stretched(factor)
            for found, leg in zip(self.legs, self.path.legs, strict=True)
        ]

    def motion(self, duration: float, step: float = STEP) -> PlannedMotion:
        """Creates the motion with a total duration and a sample interval [s]."""
        laws = self.laws(duration)
        motion = motion_along(self.path, laws, [law.duration for law in laws], step)
        if self.legs[0].tilts:
            factor = duration / self.duration
            motion = replace(motion, tilt=_tilt_of(self.legs, factor, motion.t, self.yaw))
        return motion


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

    def _slowed(self, best: Found) -> Found:
        """Returns the fastest of the searched laws that keeps the limits when slowed evenly."""
        laws = {
            f"searched law {n}, slowed": SearchedLaw(self.path, self.yaw, legs)
            for n, legs in enumerate(self.tried, start=1)
        }
        faster = {name: law for name, law in laws.items()
                  if 0.0 < law.duration < best.duration and law.whole}  # fmt: skip
        found = best_scaled(self.check, self.limits, faster, self.watch, best.duration)
        if found is None:
            return best
        words = best.words or "the search exceeded a limit"
        return Found(found.found, words=words, law=found.law)

    def _starts(self) -> Iterator[tuple[PathSearch, Legs]]:
        """Yields optimisations with constant attitude, each with an initial guess."""
        duration = self.scaled.found.motion.duration
        problem = self.problem(self.scaled.known.durations(duration), tilting=False)
        for n, factor in enumerate(TUNING.starts, start=1):
            self.watch.enter(f"search {n} of {len(TUNING.starts)}")
            yield problem, guess_of(self.check.model, self.path, self.scaled, problem, factor)

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
        """Simulates the motion of an optimisation's result; None if its duration is invalid."""
        duration = sum(leg.duration for leg in legs)
        if not (math.isfinite(duration) and 0.0 < duration < LONGEST):
            return None
        return self.check([SearchedLaw(self.path, self.yaw, legs).motion(whole_rows(duration))])[0]


def _law_of(found: LegGuess, leg: Leg) -> JerkLaw:
    """Returns the time law of an optimised leg, scaled to end exactly at the leg's end."""
    law = JerkLaw(found.duration, found.controls[:, 0], (0.0, 0.0, float(found.states[0, 2])))
    share = leg.length / max(float(law.nodes()[-1, 0]), 1e-9)
    return JerkLaw(law.duration, share * law.jerk, (0.0, 0.0, share * law.start[2]))


def _tilt_of(legs: Legs, factor: float, t: np.ndarray, yaw: float) -> Tilt:
    """Returns the tilt of an optimised motion that is slowed by a factor.

    The last row is upright; what the search's tolerance leaves there is taken away evenly.
    """
    found = np.zeros((3, len(t), 2))
    ends = factor * np.cumsum([leg.duration for leg in legs])
    which = np.minimum(np.searchsorted(ends, t), len(legs) - 1)
    for axis in range(2):
        start = (0.0, 0.0, 0.0)
        for n, leg in enumerate(legs):
            rows = which == n
            law = JerkLaw(leg.duration, leg.controls[:, 1 + axis], start).stretched(factor)
            columns = law(t[rows] - (ends[n] - law.duration))
            for order, column in enumerate(columns):
                found[order, rows, axis] = column
            place, rate, change = law.nodes()[-1]
            start = (float(place), float(rate * factor), float(change * factor**2))
    found[0] -= found[0, -1] * (t / t[-1])[:, None]
    return Tilt(yaw, *found)


def lowered(limits: PlanLimits, excess: dict[str, float]) -> PlanLimits:
    """Lowers each exceeded limit by its relative excess, for the next optimisation."""
    lower = {
        name: getattr(limits, name) / (1.0 + min(share, 1.0)) * (1.0 - TUNING.slack)
        for name, share in excess.items()
        if share > 0.0
    }
    return replace(limits, **lower)


def guess_of(model: Model, path: Path, start: Scaled, search: PathSearch, factor: float) -> Legs:
    """Creates the initial guess of an optimisation from a motion with a standard time law.

    Args:
        model: of the liquid.
        path: the path.
        start: the motion by the law.
        search: whose nodes the guess has.
        factor: by which the start is slower; the liquid's answer stays as it was.
    """
    motion, layout = start.found.motion, search.layout
    waves = waves_of([model], motion)
    durations = start.known.durations(motion.duration)
    legs, begin = [], 0.0
    laws = start.known.laws(motion.duration)
    for law, duration, count in zip(laws, durations, search.counts, strict=True):
        t = np.linspace(0.0, duration, count + 1)
        s, v, a = law(t)
        states = np.zeros((count + 1, layout.size))
        states[:, :CHAIN] = np.column_stack([s, v / factor, a / factor**2])
        states[:, layout.liquid] = waves(begin + t)
        controls = np.zeros((count, layout.driven))
        controls[:, 0] = np.diff(a) / (duration / count) / factor**3
        middles = waves(begin + t[:-1] + 0.5 * duration / count)
        legs.append(LegGuess(factor * duration, states, controls, middles))
        begin += duration
    return tuple(legs)


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
