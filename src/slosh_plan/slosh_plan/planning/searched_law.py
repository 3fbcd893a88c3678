"""Time laws that a search found, and the law of the fastest motion without a liquid."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from slosh_base.types import Array
from slosh_model.motion_profiles import quintic
from slosh_plan.planning.interval import CHAIN
from slosh_plan.planning.known_laws import KnownLaw, shortest
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.optimise import LegGuess, PathSearch
from slosh_plan.planning.path import Leg, Path
from slosh_plan.planning.progress import never
from slosh_plan.planning.time_law import STEP, JerkLaw, PlannedMotion, Tilt, TimeLaw
from slosh_plan.tuning import TUNING

Legs = tuple[LegGuess, ...]
SEARCHED = "result"
"""How the names of searched laws begin, as in 'result 2 of the search for cup 1, slowed'."""
Waves = Callable[[Array], Array]
"""State of liquids, one column per number, at times [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class SearchedLaw(TimeLaw):
    """The time law of a search's result, slowed evenly to any duration.

    Attributes:
        yaw: of the container [rad].
        legs: the result; it need not keep any limit.
    """

    yaw: float
    legs: Legs

    @property
    def duration(self) -> float:
        """Duration of the result [s]; it may be any number."""
        return sum(leg.duration for leg in self.legs)

    @property
    def whole(self) -> bool:
        """Whether it runs forwards from rest to rest, as an ended search's result may not."""
        if not all(math.isfinite(leg.duration) and leg.duration > 0.0 for leg in self.legs):
            return False
        for law, leg in zip(self.laws(self.duration), self.path.legs, strict=True):
            nodes = law.nodes()
            ended = abs(nodes[-1, 1]) * law.duration < TUNING.ended * leg.length
            if not (ended and np.isfinite(nodes).all() and np.diff(nodes[:, 0]).min() > -1e-6):
                return False
        return True

    def durations(self, duration: float) -> tuple[float, ...]:
        """Returns the durations of the legs for a total duration [s]."""
        factor = duration / self.duration
        return tuple(factor * leg.duration for leg in self.legs)

    def laws(self, duration: float) -> list[JerkLaw]:
        """Returns the time laws of the legs for a total duration [s]."""
        factor = duration / self.duration
        return [
            _law_of(found, leg).stretched(factor)
            for found, leg in zip(self.legs, self.path.legs, strict=True)
        ]

    def motion(self, duration: float, step: float = STEP) -> PlannedMotion:
        """Creates the motion with a total duration and a sample interval [s]."""
        motion = TimeLaw.motion(self, duration, step)
        if self.legs[0].tilts:
            factor = duration / self.duration
            motion = replace(motion, tilt=_tilt_of(self.legs, factor, motion.t, self.yaw))
        return motion


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


def guess_of(
    law: TimeLaw, duration: float, search: PathSearch, factor: float, waves: Waves
) -> Legs:
    """Creates the initial guess of an optimisation from a motion by a time law.

    Args:
        law: the law.
        duration: of the motion [s].
        search: whose nodes the guess has.
        factor: by which the guess is slower; the liquid's answer stays as it was.
        waves: state of the liquids in the motion.
    """
    layout = search.layout
    legs, begin = [], 0.0
    each = zip(law.laws(duration), law.durations(duration), search.counts, strict=True)
    for one, time, count in each:
        t = np.linspace(0.0, time, count + 1)
        s, v, a = one(t)
        states = np.zeros((count + 1, layout.size))
        states[:, :CHAIN] = np.column_stack([s, v / factor, a / factor**2])
        states[:, layout.liquid] = waves(begin + t)
        controls = np.zeros((count, layout.driven))
        controls[:, 0] = np.diff(a) / (time / count) / factor**3
        middles = waves(begin + t[:-1] + 0.5 * time / count)
        legs.append(LegGuess(factor * time, states, controls, middles))
        begin += time
    return tuple(legs)


def kinematic_law(
    path: Path,
    known: Mapping[str, KnownLaw],
    limits: PlanLimits,
    seconds: float,
    stopped: Callable[[], bool] = never,
) -> SearchedLaw | None:
    """Searches the fastest motion along a path without a liquid; None where none is found.

    Args:
        path: the path.
        known: standard laws; the search starts from the fastest quintic one.
        limits: of acceleration, jerk and joints.
        seconds: after which it ends.
        stopped: whether to end it.
    """
    quintics = {name: law for name, law in known.items() if law.unit is quintic}
    least = {name: shortest(law.motion, limits) for name, law in quintics.items()}
    start = known[min(least, key=lambda name: least[name])]
    duration = min(least.values())
    search = PathSearch((), path, 0.0, start.durations(duration))
    guess = guess_of(start, duration, search, 1.0, lambda t: np.zeros((len(t), 0)))
    solution = search.solve(limits, guess, seconds, stopped)
    law = SearchedLaw(path, 0.0, solution.legs)
    return law if law.whole else None
