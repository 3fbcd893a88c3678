"""The fastest motion along a path that keeps every limit.

First the fastest of some known laws, slowed until it is safe: something safe is there whatever
follows. Then the search of the optimal law, from several starts. What a search finds is simulated
with the whole model at 1 kHz; where it exceeds a limit, that limit is lowered by the excess and
the search goes on, until the simulation keeps all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_model import Model
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning import optimise
from slosh_plan.planning.checked import Checked, Checker, horizon
from slosh_plan.planning.flow import flow_of
from slosh_plan.planning.guess import guess_of
from slosh_plan.planning.known_laws import LONGEST, Scaled, best_scaled, leg_durations
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Leg, Path
from slosh_plan.planning.progress import StoppedError, Watch
from slosh_plan.planning.time_law import JerkLaw, Motion, motion_along, whole_rows
from slosh_plan.prediction import ModelError, predict
from slosh_plan.trajectory import Trajectory

Array = NDArray[np.float64]

TIME_LIMIT = 30.0
"""Of a search [s]."""
STARTS = (1.0, 0.7)
"""Where searches start: the fastest known law, slower by such factors."""
AGAIN = 0.2
"""Share of the time limit after which a motion that was found is not searched for again."""
ROUNDS = 8
"""How often a limit is lowered."""
AHEAD = 0.004
"""By so much of themselves the heights are lowered at once: the usual excess between nodes."""
SLACK = 2e-4
"""By how much more than its excess."""
UPRIGHT = 1e-3
"""Tilt of a container that counts as upright [rad]."""
HOW_TO_GET = "CasADi is not installed (pip install -r requirements/plan.txt)"


class NoSafeMotionError(SloshPlanError):
    """No motion along the path keeps the limits."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A motion that keeps every limit.

    Attributes:
        found: the motion and what it reaches, by simulation at 1 kHz.
        limits: as asked for.
        margin: by which the heights were to stay below [m].
        error: of the model, for which more was kept: the upper ends of the heights' intervals keep
            the limits; None: none was asked for.
        method: 'optimal', or the name of the known law that was scaled.
        reason: why there is no optimal law; empty: there is one.
        upper: upper ends of the intervals (95 %) of the peak and of the height after the end [m],
            from the error and the covariance of the model's parameters; None: there is neither.
        scaled: the fastest known law.
        path: along which.
        seconds: that the planning took [s].
    """

    found: Checked
    limits: PlanLimits
    margin: float
    error: ModelError | None
    method: str
    reason: str
    upper: tuple[float, float] | None
    scaled: Scaled
    path: Path
    seconds: float


def plan(
    model: Model,
    path: Path,
    limits: PlanLimits,
    *,
    attitude: Array | None = None,
    margin: float = 0.0,
    error: ModelError | None = None,
    time_limit: float = TIME_LIMIT,
    watch: Watch | None = None,
) -> Plan:
    """Plans a motion from rest to rest, of a liquid at rest.

    Args:
        model: the model; the search knows its first mode, the check all of it.
        path: the path.
        limits: to keep.
        attitude: (4,) quaternion x, y, z, w that the container keeps: upright; None: not turned.
        margin: by which the heights stay below their limits [m].
        error: the model's measured error; with it the upper ends of the heights' intervals, as
            `predict` tells them, keep the limits, also for the covariance of the model's
            parameters where there is one. None: the heights themselves keep them.
        time_limit: after which the search ends with what it has [s].
        watch: is told how far the plan has come, and ends it with what it has; None: nobody does.

    Raises:
        NoSafeMotionError: no known law keeps the limits, however slow.
        StoppedError: the watch ended it before there was any safe motion.
        SloshPlanError: a container that is not upright, or a margin that leaves nothing.
    """
    watch = watch or Watch()
    kept = limits.lowered(margin)
    nominal = _nominal(kept, error)
    yaw = upright_yaw(attitude)
    check = Checker(model, attitude, error)
    watch.enter("known laws")
    scaled = best_scaled(check, path, kept, watch)
    if scaled is None and watch.stopped():
        raise StoppedError("stopped before there was a safe motion")
    if scaled is None:
        raise NoSafeMotionError(
            f"no motion of up to {LONGEST:g} s along the path keeps "
            f"{1e3 * kept.height:.3g} mm, afterwards {1e3 * kept.residual:.3g} mm, "
            f"{kept.acceleration:g} m/s² and {kept.jerk:g} m/s³"
        )
    best, reason = scaled.found, HOW_TO_GET
    if optimise.available():
        search = _Search(check, path, kept, nominal, yaw, scaled, time_limit, watch)
        best, reason = search.run()
    method = scaled.law if best is scaled.found else "optimal"
    upper = (best.upper, best.residual_upper) if error else _upper(model, best.motion, attitude)
    return Plan(best, limits, margin, error, method, reason, upper, scaled, path, watch.elapsed)


def _nominal(limits: PlanLimits, error: ModelError | None) -> PlanLimits:
    """The limits for heights without the model's error."""
    if error is None:
        return limits
    return replace(
        limits, height=error.highest(limits.height), residual=error.highest(limits.residual)
    )


def _upper(model: Model, motion: Motion, attitude: Array | None) -> tuple[float, float] | None:
    """Upper ends of a motion's intervals, as `predict` tells them."""
    if model.covariance is None:
        return None
    turned = None if attitude is None else np.tile(attitude, (len(motion.t), 1))
    trajectory = Trajectory(motion.t, motion.acceleration, turned, name="plan")
    (found,) = predict(model, trajectory, horizon=horizon(model))
    return found.upper, found.residual_upper


def upright_yaw(attitude: Array | None) -> float:
    """Yaw of a container that stands upright [rad].

    Raises:
        SloshPlanError: it is tilted.
    """
    if attitude is None:
        return 0.0
    x, y, z, w = np.asarray(attitude) / np.linalg.norm(attitude)
    if 2.0 * math.hypot(x, y) > UPRIGHT:
        tilt = math.degrees(2.0 * math.asin(min(1.0, math.hypot(x, y))))
        raise SloshPlanError(
            f"the container is tilted by {tilt:.3g}°: planning is for upright ones"
        )
    return 2.0 * math.atan2(z, w)


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """The search of an optimal law, from several starts."""

    check: Checker
    path: Path
    limits: PlanLimits
    nominal: PlanLimits
    yaw: float
    scaled: Scaled
    time_limit: float
    watch: Watch

    def run(self) -> tuple[Checked, str]:
        """The best motion, and why it is the scaled one where it is."""
        durations = leg_durations(self.path, self.scaled.found.motion.duration)
        problem = optimise.Search(flow_of(self.check.model), self.path, self.yaw, durations)
        best, last = self.scaled.found, "the search found nothing faster"
        for n, factor in enumerate(STARTS, start=1):
            self.watch.enter(f"search {n} of {len(STARTS)}")
            guess = guess_of(self.check.model, self.path, self.scaled, problem, factor)
            found, words = self._tightened(problem, guess, best.motion.duration)
            if found is not None and found.motion.duration < best.motion.duration:
                best = found
                self.watch.found(found.motion.duration)
            elif words:
                last = words
            enough = AGAIN if best is not self.scaled.found else 1.0
            if self.watch.elapsed >= enough * self.time_limit or self.watch.stopped():
                break
        return best, last if best is self.scaled.found else ""

    def _tightened(
        self, problem: optimise.Search, guess: tuple[optimise.LegGuess, ...], fastest: float
    ) -> tuple[Checked | None, str]:
        """Searches until the simulation keeps the limits; None and the reason: it does not.

        What is not faster than the fastest so far is not gone on with.
        """
        asked = self.nominal.reduced(AHEAD)
        for _ in range(ROUNDS):
            if self._over():
                return None, self._why_over()
            solution = problem.solve(asked, guess, self._over)
            if not solution.converged and self._over():
                return None, self._why_over()
            found = self._checked(solution)
            if found is None:
                return None, f"the search failed ({solution.status})"
            if solution.converged and found.motion.duration >= fastest:
                return None, "the search found nothing faster"
            if found.keeps(self.limits):
                return found, ""
            if solution.converged:
                guess = solution.legs
            asked = _lowered(asked, found.excess(self.limits))
        return None, f"the search kept exceeding a limit after {ROUNDS} rounds"

    def _over(self) -> bool:
        return self.watch.stopped() or self.watch.elapsed >= self.time_limit

    def _why_over(self) -> str:
        late = self.watch.elapsed >= self.time_limit
        return "the search's time was up" if late else "the search was stopped"

    def _checked(self, solution: optimise.Solution) -> Checked | None:
        duration = sum(leg.duration for leg in solution.legs)
        if not (math.isfinite(duration) and 0.0 < duration < LONGEST):
            return None
        factor = whole_rows(duration) / duration
        laws = [
            _law_of(found, leg).stretched(factor)
            for found, leg in zip(solution.legs, self.path.legs, strict=True)
        ]
        motion = motion_along(self.path, laws, [law.duration for law in laws])
        return self.check([motion])[0]


def _law_of(found: optimise.LegGuess, leg: Leg) -> JerkLaw:
    """The time law that a search found, from the leg's start to its very end."""
    law = JerkLaw(found.duration, found.controls[:, 0], float(found.states[0, 2]))
    share = leg.length / max(float(law.nodes()[-1, 0]), 1e-9)
    return JerkLaw(law.duration, share * law.jerk, share * law.start)


def _lowered(limits: PlanLimits, excess: dict[str, float]) -> PlanLimits:
    """Limits that are exceeded, lowered by their excess."""
    lower = {
        name: getattr(limits, name) / (1.0 + min(share, 1.0)) * (1.0 - SLACK)
        for name, share in excess.items()
        if share > 0.0
    }
    return replace(limits, **lower)
