"""Finds the fastest of several standard time laws that keeps all limits.

Whether a law is safe is not monotone in its duration: waves of its parts add up or cancel. So the
durations are gone through from the fastest that acceleration and jerk allow, and each is
simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, pairwise
from types import MappingProxyType
from typing import Literal, NamedTuple, Protocol

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from slosh_base.types import Array
from slosh_model.motion_profiles import quintic
from slosh_plan.planning.checked import CheckedMotion
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Leg, Path
from slosh_plan.planning.progress import Watch, never
from slosh_plan.planning.time_law import STEP, Law, PlannedMotion, TimeLaw, whole_rows
from slosh_plan.planning.unit_laws import UNIT_LAWS, UnitLaw
from slosh_plan.tuning import TUNING

Make = Callable[[float, float], PlannedMotion]
"""Duration and step between rows [s] to a motion."""
LONGEST = TUNING.longest_law
_TOGETHER = 16


@dataclass(frozen=True, slots=True)
class KnownLaw(TimeLaw):
    """A standard time law on every leg of a path.

    Attributes:
        unit: the law, from 0 to 1.
        legs: of the path, by the pace at which the law runs along them.
        shares: of the duration for each leg; empty: by the root of their lengths.
    """

    unit: UnitLaw
    legs: tuple[PacedLeg, ...]
    shares: tuple[float, ...] = ()

    def durations(self, duration: float) -> tuple[float, ...]:
        """Returns the durations of the legs for a total duration [s]."""
        if not self.shares:
            return leg_durations(self.path, duration)
        return tuple(duration * share for share in self.shares)

    def laws(self, duration: float) -> list[Law]:
        """Returns the time laws of the legs for a total duration [s]."""
        durations = self.durations(duration)
        return [self._law(leg, time) for leg, time in zip(self.legs, durations, strict=True)]

    def _law(self, leg: PacedLeg, duration: float) -> Law:
        def law(t: Array) -> tuple[Array, Array, Array]:
            place, rate, change = self.unit(t / duration)
            return leg.along(place, rate / duration, change / duration**2)

        return law


@dataclass(frozen=True, slots=True)
class Scaled:
    """A time law, slowed until its motion exceeds no limit.

    Attributes:
        law: its name.
        known: the law.
        found: the motion.
    """

    law: str
    known: TimeLaw
    found: CheckedMotion


class Check(Protocol):
    """Tells what motions do; see `Checker`."""

    def __call__(self, motions: Sequence[PlannedMotion]) -> list[CheckedMotion]:
        """Returns motions with what they reach."""
        ...

    def glance(self, motions: Sequence[PlannedMotion]) -> list[CheckedMotion]:
        """Returns lower bounds of it."""
        ...


def known_laws(path: Path, limits: PlanLimits | None = None) -> dict[str, KnownLaw]:
    """Returns the standard time laws along a path (trapezoid, polynomials and others), by name.

    Args:
        path: the path.
        limits: by which legs share the duration, too; None: by their lengths alone.
    """
    paces = {name: pace for name, pace in PACES.items() if pace.suits(path)}
    found: dict[str, KnownLaw] = {}
    for words, pace in paces.items():
        legs = tuple(PacedLeg(leg, pace) for leg in path.legs)
        found |= {f"{name}{words}": KnownLaw(path, unit, legs) for name, unit in UNIT_LAWS.items()}
    if limits is None or len(path.legs) == 1:
        return found
    for words, pace in paces.items():
        legs = tuple(PacedLeg(leg, pace) for leg in path.legs)
        least = [shortest(_alone(path, leg).motion, limits) for leg in legs]
        shares = tuple(time / sum(least) for time in least)
        found |= {
            f"{name}{words}, legs by their limits": KnownLaw(path, unit, legs, shares)
            for name, unit in UNIT_LAWS.items()
        }
    return found


def _alone(path: Path, leg: PacedLeg) -> KnownLaw:
    """Returns the quintic law along one leg of a path."""
    return KnownLaw(replace(path, legs=(leg.leg,), reversals=()), quintic, (leg,))


def best_scaled(
    check: Check,
    limits: PlanLimits,
    laws: Mapping[str, TimeLaw],
    watch: Watch | None = None,
    longest: float = LONGEST,
) -> Scaled | None:
    """Returns the fastest of several time laws that keeps the limits; None if none does.

    All candidates of a plan go through it: standard laws, and searched laws that are slowed.

    Args:
        check: tells what a motion does.
        limits: to keep.
        laws: by their names.
        watch: where it is stopped, the answer is the fastest so far.
        longest: duration that is not reached [s].
    """
    watch = watch or Watch()
    best: Scaled | None = None
    for name, known in laws.items():
        longest = longest if best is None else best.found.motion.duration
        found = fastest(check, known.motion, limits, longest, watch.stopped)
        if found is not None:
            best = Scaled(name, known, found)
            watch.found(found.motion.duration)
    return best


def leg_durations(path: Path, duration: float) -> tuple[float, ...]:
    """Returns the durations of the legs for a total duration [s]."""
    roots = [math.sqrt(leg.length) for leg in path.legs]
    return tuple(duration * root / sum(roots) for root in roots)


def fastest(
    check: Check,
    make: Make,
    limits: PlanLimits,
    longest: float = LONGEST,
    stopped: Callable[[], bool] = never,
) -> CheckedMotion | None:
    """Returns the motion with the shortest duration that keeps the limits; None if none does.

    All durations are simulated with few rows, and those that may keep the limits with all. Where
    the waves of a motion's parts cancel, only a narrow range of durations may be safe: what lies
    between two is looked at more closely where the excess may fall so far, by its changes nearby.

    Args:
        check: tells what a motion does.
        make: the motion of a duration.
        limits: what to keep.
        longest: duration that is not reached [s].
        stopped: whether to end without an answer.
    """
    trials, done = _Trials(check, make, limits, stopped), 0
    durations, known = _durations(shortest(make, limits), longest), list[_Glance]()
    while not stopped():
        some = list(islice(durations, _TOGETHER))
        known += trials.glanced(some)
        last = len(known) - int(len(some) == _TOGETHER)
        each = (trials.first(known, at) for at in range(done, last))
        found = next((one for one in each if one is not None), None)
        if found is not None or len(some) < _TOGETHER:
            return found
        done = last
    return None


class _Glance(NamedTuple):
    """Duration of a motion [s], and a lower bound of what exceeds a limit most, as its share."""

    duration: float
    excess: float


class _Trials(NamedTuple):
    """Looks for the shortest safe motion of one law; the parts are those of `fastest`."""

    check: Check
    make: Make
    limits: PlanLimits
    stopped: Callable[[], bool]

    def glanced(self, durations: Sequence[float]) -> list[_Glance]:
        """Looks at motions with few rows, without uncertainty."""
        coarse = [self.make(one, one / math.ceil(one / TUNING.coarse)) for one in durations]
        found = self.check.glance(coarse) if coarse else []
        excess = (max(one.excess(self.limits).values()) for one in found)
        return [_Glance(*pair) for pair in zip(durations, excess, strict=True)]

    def first(
        self, known: Sequence[_Glance], at: int, *, closer: bool = True
    ) -> CheckedMotion | None:
        """Returns the first safe motion that is longer than a known one, to the next known one.

        Args:
            known: glances at rising durations.
            at: index of the second of the two.
            closer: whether to look at durations between them, too.
        """
        if self.stopped() or _lowest(known, at) > TUNING.nearly:
            return None
        near = known[max(at - 1, 0) : at + 1]
        inner = _between(near[0].duration, near[-1].duration) if closer else []
        if not inner:
            return self._kept(known[at])
        fine = [near[0], *self.glanced(inner), near[-1]]
        closer = min(one.excess for one in near) > TUNING.nearly
        each = (self.first(fine, n, closer=closer) for n in range(1, len(fine)))
        return next((one for one in each if one is not None), None)

    def _kept(self, glance: _Glance) -> CheckedMotion | None:
        """Returns a motion if it keeps the limits."""
        if glance.excess > TUNING.nearly:
            return None
        (found,) = self.check([self.make(glance.duration, STEP)])
        return found if found.keeps(self.limits) else None


def _lowest(known: Sequence[_Glance], at: int) -> float:
    """Returns the lowest excess that there may be between a known duration and the one before.

    It changes there at most as steeply as between it and the next ones, with a margin.
    """
    if at == 0 or not math.isfinite(max(one.excess for one in known[at - 1 : at + 1])):
        return min(one.excess for one in known[max(at - 1, 0) : at + 1])
    near = [one for one in known[max(at - 2, 0) : at + 2] if math.isfinite(one.excess)]
    slopes = (abs(b.excess - a.excess) / (b.duration - a.duration) for a, b in pairwise(near))
    before, after = known[at - 1], known[at]
    fall = TUNING.valley * max(slopes) * (after.duration - before.duration)
    return 0.5 * (before.excess + after.excess - fall)


def _durations(least: float, longest: float) -> Iterator[float]:
    """Yields rising durations [s], the last one just below the longest."""
    duration, last = whole_rows(least), STEP * round(longest / STEP - 1.0)
    while duration < last:
        yield duration
        ratio = TUNING.law_ratio if duration < TUNING.long else TUNING.long_ratio
        duration = whole_rows(max(ratio * duration, duration + STEP))
    if whole_rows(least) <= last < longest:
        yield last


def _between(shorter: float, longer: float) -> list[float]:
    """Returns durations between two [s], whole rows each."""
    rows = np.arange(math.floor(shorter / STEP + 1e-6) + 1, round(longer / STEP))
    found: list[float] = (STEP * rows[:: -(-len(rows) // _TOGETHER) or 1]).tolist()
    return found


def shortest(make: Make, limits: PlanLimits) -> float:
    """Returns the shortest duration [s] that the limits of speed, acceleration and jerk allow."""
    return max(shortest_by_limit(make, limits).values())


def shortest_by_limit(make: Make, limits: PlanLimits) -> dict[str, float]:
    """Returns the shortest duration [s] that each limit but those of the liquid allows."""
    trial = 2.0
    motion = make(trial, STEP)
    acceleration = float(np.linalg.norm(motion.acceleration, axis=1).max())
    steps = np.linalg.norm(np.diff(motion.acceleration, axis=0), axis=1)
    jerk = float(steps.max()) / motion.step
    joints = {} if motion.joints is None else motion.joints.shares(motion.step)
    share = {name: used / float(getattr(limits, name)) for name, used in joints.items()}
    times = {
        "acceleration": math.sqrt(acceleration / limits.acceleration),
        "jerk": math.cbrt(jerk / limits.jerk),
        "velocity of the joints": share.get("joint_velocity", 0.0),
        "acceleration of the joints": math.sqrt(share.get("joint_acceleration", 0.0)),
        "jerk of the joints": math.cbrt(share.get("joint_jerk", 0.0)),
    }
    return {name: trial * time for name, time in times.items()}


@dataclass(frozen=True, slots=True)
class Pace:
    """Rule that lowers the speed along parts of a path.

    Attributes:
        power: of the curvature; 0: an even speed; 1/3: the two-thirds power law, at which an
            ellipse is gone through harmonically; 1/2: an even lateral acceleration.
        floor: below which curvature, or what else there is, hardly counts.
        of: 'path': its curvature; 'container': its speed where joints move it; 'joints': their
            limits of velocity and acceleration.
    """

    power: float
    floor: float
    of: Literal["path", "container", "joints"] = "path"

    def suits(self, path: Path) -> bool:
        """Returns whether the rule is of use along a path."""
        if self.of != "path":
            return all(leg.demands is not None for leg in path.legs)
        return self.power == 0.0 or any(curved(leg) for leg in path.legs)

    def slowness(self, leg: Leg, s: Array) -> Array:
        """Returns by what the time of each part of a leg is in proportion, (N,) at places s."""
        if self.of == "path":
            squared = (leg.at(s)[2] ** 2).sum(axis=1)
            least = (self.floor**2) * squared.mean() + (TUNING.straight / leg.length) ** 2
            return np.asarray((squared + least) ** (0.5 * self.power))
        if self.of == "container":
            slow = np.linalg.norm(leg.at(s)[1], axis=1)
        else:
            slow = leg.joint_slowness(s)
        least = self.floor * float(slow.mean()) or 1.0
        return np.asarray(np.hypot(slow, least))


PACES: Mapping[str, Pace] = MappingProxyType(
    {
        "": Pace(0.0, 1.0),
        ", slower in curves": Pace(1.0 / 3.0, 0.3),
        ", evenly in curves": Pace(0.5, 1.0),
        ", even for the container": Pace(1.0, 0.2, "container"),
        ", even for the joints": Pace(1.0, 0.3, "joints"),
    }
)
"""By what their names add to a law's."""


@dataclass(frozen=True)
class PacedLeg:
    """A leg of a path that is run more slowly where the path is strongly curved.

    Attributes:
        leg: the leg.
        pace: the pace.
    """

    leg: Leg
    pace: Pace

    @cached_property
    def splines(self) -> tuple[BSpline, ...]:
        """Splines of path length s [m] over the parameter, and of its first two derivatives."""
        s = np.linspace(0.0, self.leg.length, TUNING.leg_points + 1)
        slow = self.pace.slowness(self.leg, s)
        at = np.concatenate([[0.0], np.cumsum(0.5 * (slow[1:] + slow[:-1]))])
        spline = make_interp_spline(at / at[-1], s, k=5)
        return (spline, spline.derivative(), spline.derivative(2))

    def along(self, place: Array, rate: Array, change: Array) -> tuple[Array, Array, Array]:
        """Converts a curve parameter and its time derivatives to s [m], ds/dt and d²s/dt²."""
        s, slope, bend = (np.asarray(spline(np.clip(place, 0.0, 1.0))) for spline in self.splines)
        return s, slope * rate, bend * rate**2 + slope * change


def curved(leg: Leg) -> bool:
    """Returns whether a leg's curvature varies, so that the speed rule `Pace` has an effect."""
    bends = np.linalg.norm(leg.at(np.linspace(0.0, leg.length, TUNING.leg_points + 1))[2], axis=1)
    return bool(np.ptp(bends) * leg.length > TUNING.straight)
