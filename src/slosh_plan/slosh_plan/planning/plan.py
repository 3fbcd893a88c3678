"""Plans the fastest motion along a path that keeps every limit.

First the fastest of some known laws, slowed until it is safe: something safe is there whatever
follows. Then the search of the optimal law, from several starts. What a search finds is simulated
with the whole model at 1 kHz; where it exceeds a limit, that limit is lowered by the excess and
the search goes on, until the simulation keeps all of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from slosh_base.types import Array
from slosh_model import Model
from slosh_model.for_notebooks import Shown, height_axes, table
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning import optimise
from slosh_plan.planning.checked import (
    CheckedMotion,
    Checker,
    LooseContainer,
    attitudes,
    error_of,
    horizon,
)
from slosh_plan.planning.final_check import Kept, broken
from slosh_plan.planning.given_law import all_laws, in_words
from slosh_plan.planning.known_laws import LONGEST, Check, Scaled, best_scaled, shortest_by_limit
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Path
from slosh_plan.planning.progress import StoppedError, Watch
from slosh_plan.planning.search import Found, OptimalSearch
from slosh_plan.planning.searched_law import Legs
from slosh_plan.planning.time_law import TimeLaw
from slosh_plan.prediction import ModelError, predict
from slosh_plan.trajectory import Trajectory
from slosh_plan.validity import validity_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


TIME_LIMIT = 30.0
"""Of a search [s]."""
UPRIGHT = 1e-3
"""Tilt of a container that counts as upright [rad]."""
HOW_TO_GET = "CasADi is not installed (pip install -r requirements/plan.txt)"


class NoSafeMotionError(SloshPlanError):
    """Error that no motion along the path keeps the limits."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Plan(Shown):
    """A planned motion of the container that keeps every limit.

    Attributes:
        found: the motion and what it reaches, by simulation at 1 kHz.
        limits: as asked for, and the container's rim where it is lower.
        margin: by which the heights were to stay below [m].
        error: of the model, for which more was kept: the upper ends of the heights' intervals keep
            the limits; None: nothing is known of it.
        method: 'optimal', or the name of the known or searched law that was slowed.
        reason: why there is no optimal law; empty: there is one.
        upper: upper ends of the intervals (95 %) of the peak and of the height after the end [m],
            from the error and the covariance of the model's parameters; None: there is neither.
        scaled: the fastest known law.
        path: along which.
        seconds: that the planning took [s].
        attitude: (4,) that the container keeps; None: not turned.
        distance_to_rim: vertical, left by the highest place of the surface [m]; NaN: unknown.
        legs: the search's result, from which another search may start; empty: there is none.
        laws: that were tried, and what searches found, which need not keep the limits.
    """

    found: CheckedMotion
    limits: PlanLimits
    margin: float
    error: ModelError | None
    method: str
    reason: str
    upper: tuple[float, float] | None
    scaled: Scaled
    path: Path
    seconds: float
    attitude: Array | None = None
    distance_to_rim: float = math.nan
    legs: Legs = ()
    laws: Mapping[str, TimeLaw] = field(default_factory=dict)

    @property
    def law(self) -> str:
        """The law that the motion follows, in words."""
        return "optimal time law" if self.method == "optimal" else in_words(self.method)

    def __repr__(self) -> str:
        found = self.found
        return (
            f"Plan({found.motion.duration:.3f} s, {self.law}, "
            f"height {1e3 * found.peak:.2f} of {1e3 * self.limits.height:g} mm, "
            f"afterwards {1e3 * found.residual:.2f} of {1e3 * self.limits.residual:g} mm)"
        )

    def to_pandas(self) -> DataFrame:
        """Returns a pandas table of the motion by time: position, attitude and acceleration.

        Raises:
            ImportError: pandas is not installed.
        """
        motion = self.found.motion
        columns = dict(zip(("x", "y", "z"), motion.position.T, strict=True))
        turned = attitudes(motion, self.attitude, len(motion.t))
        turns = (
            {} if turned is None else dict(zip(("qx", "qy", "qz", "qw"), turned.T, strict=True))
        )
        acceleration = dict(zip(("ax", "ay", "az"), motion.acceleration.T, strict=True))
        units = {**dict.fromkeys(turns, "1"), **dict.fromkeys(acceleration, "m/s²")}
        return table(np.round(motion.t, 6), {**columns, **turns, **acceleration}, units=units)

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draws the height over time until the liquid is at rest.

        Args:
            axes: matplotlib's; None: of a new figure.
        """
        axes = height_axes(axes)
        heights = self.found.msh
        axes.plot(self.found.motion.step * np.arange(len(heights)), 1e3 * heights)
        return axes


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
    loose: LooseContainer | None = None,
    laws: Mapping[str, TimeLaw] | None = None,
) -> Plan:
    """Plans the fastest rest-to-rest motion along a path within limits, for liquid at rest.

    Args:
        model: the model, whose NL twin is planned for; the search knows its first mode, the check
            all of it. Where the container may tilt, `gravity_tilt` is added if it is missing.
        path: the path.
        limits: to keep; the container's rim is a limit of the height, too.
        attitude: (4,) quaternion x, y, z, w that the container keeps: upright; None: not turned.
        margin: by which the heights stay below their limits [m].
        error: the model's measured error; with it, or with a covariance of the model's
            parameters, the upper ends of the heights' intervals keep the limits, as `predict`
            tells them. None: it is not known.
        time_limit: after which the search ends with what it has [s].
        watch: is told how far the plan has come, and ends it with what it has; None: nobody does.
        loose: how the container stands on a tray; None: it is held.
        laws: that are tried beside the search, as `all_laws` gives them; None: these.

    Raises:
        NoSafeMotionError: no known law keeps the limits, however slow.
        StoppedError: the watch ended it before there was any safe motion.
        SloshPlanError: a container that is not upright, or a margin that leaves nothing.
    """
    watch = watch or Watch()
    limits = limits.under_rim(model)
    error = error_of(model, error)
    check, kept, nominal, yaw = demanded(model, path, limits, attitude, margin, error, loose)
    watch.enter("known laws")
    if laws is None:
        laws = all_laws(path, kept, time_limit - watch.elapsed, watch.stopped)
    scaled = fastest_law(check, laws, kept, watch)
    found = Found(scaled.found, words=HOW_TO_GET)
    if optimise.available():
        search = OptimalSearch(check, path, kept, nominal, yaw, scaled, time_limit, watch)
        found, laws = search.run(), {**laws, **search.laws}
    kept_by = [Kept(check.model, limits, loose)]
    if words := _broken(found.motion, path, limits, attitude, kept_by):
        found = Found(scaled.found, words=f"the searched motion was refused: {words}")
        if words := _broken(found.motion, path, limits, attitude, kept_by):
            raise NoSafeMotionError(f"the planned motion failed its last check: {words}")
    best = found.motion
    assert best is not None
    method = "optimal" if found.legs else found.law or scaled.law
    upper = (best.upper, best.residual_upper) if error else None
    return Plan(
        best, limits, margin, error, method, found.words, upper, scaled, path, watch.elapsed,
        attitude, distance_to_rim(model, best), found.legs, laws,
    )  # fmt: skip


def _broken(
    found: CheckedMotion | None,
    path: Path,
    limits: PlanLimits,
    attitude: Array | None,
    containers: Sequence[Kept],
) -> str:
    """Describes what an answer does not keep; see `broken`."""
    assert found is not None
    return broken(found.motion, path, limits, attitude, containers)


def demanded(
    model: Model,
    path: Path,
    limits: PlanLimits,
    attitude: Array | None,
    margin: float,
    error: ModelError | None,
    loose: LooseContainer | None,
) -> tuple[Checker, PlanLimits, PlanLimits, float]:
    """Returns the motion checker, the limits with and without the model's error, the yaw [rad].

    Args:
        model, path, attitude, margin, error, loose: as of `plan`.
        limits: the rim is one of them.

    Raises:
        SloshPlanError: a container that is not upright, or a margin that leaves nothing.
    """
    kept = limits.lowered(margin)
    nominal = _nominal(kept, error)
    check = Checker(model_for(model, limits, path), attitude, error, (), loose)
    return check, kept, nominal, upright_yaw(attitude)


def distance_to_rim(model: Model, found: CheckedMotion) -> float:
    """Returns the vertical distance between a motion's highest liquid and the rim [m], or NaN."""
    return float(model.container.wall.place(found.peak).distance_to_rim)


def fastest_law(
    check: Check, laws: Mapping[str, TimeLaw], limits: PlanLimits, watch: Watch
) -> Scaled:
    """Returns the fastest of several time laws that keeps the limits.

    Raises:
        NoSafeMotionError: no known law keeps the limits, however slow.
        StoppedError: the watch ended the search before there was any.
    """
    scaled = best_scaled(check, limits, laws, watch)
    if scaled is not None:
        return scaled
    if watch.stopped():
        raise StoppedError("stopped before a safe motion was found")
    least = [shortest_by_limit(law.motion, limits) for law in laws.values()]
    quickest = min(least, key=lambda times: max(times.values()), default={})
    binding = max(quickest, key=lambda name: quickest[name], default="")
    if binding and quickest[binding] >= LONGEST:
        raise NoSafeMotionError(
            f"the limit of the {binding} asks for {quickest[binding]:.4g} s along the path, and "
            f"motions of {LONGEST:g} s or more are not planned: give a shorter path, or another "
            "limit"
        )
    raise NoSafeMotionError(
        f"no motion of up to {LONGEST:g} s along the path keeps "
        f"{1e3 * limits.height:.3g} mm, afterwards {1e3 * limits.residual:.3g} mm, "
        f"{limits.acceleration:g} m/s² and {limits.jerk:g} m/s³"
    )


def model_for(model: Model, limits: PlanLimits, path: Path) -> Model:
    """Returns the nonlinear model, as `predict` takes it, with gravity if the container may tilt.

    Raises:
        SloshPlanError: the joints determine the attitude, and yet the container may tilt.
    """
    if limits.tilt > 0.0 and path.legs[0].demands is not None:
        raise SloshPlanError(
            "the joints determine how the container tilts: plan their path without a limit of "
            "the tilt"
        )
    model = model.nonlinear()
    return model.with_gravity_tilt() if limits.tilt > 0.0 or path.tilts else model


def _nominal(limits: PlanLimits, error: ModelError | None) -> PlanLimits:
    """Returns the limits, lowered by the model's measured error."""
    if error is None:
        return limits
    return replace(
        limits, height=error.highest(limits.height), residual=error.highest(limits.residual)
    )


def plan_remarks(model: Model, answer: Plan) -> list[str]:
    """Returns what `predict` remarks on the motion of a plan.

    Args:
        model: for which it was planned.
        answer: the plan.
    """
    motion = answer.found.motion
    turned = attitudes(motion, answer.attitude, len(motion.t))
    trajectory = Trajectory(motion.t, motion.acceleration, turned, name="plan")
    bare = replace(model, covariance=None)
    (found,) = predict(bare, trajectory, horizon=horizon(model))
    return validity_words(found.flags, found.growth)


def upright_yaw(attitude: Array | None) -> float:
    """Returns the yaw of an upright container [rad], or raises an error if it is tilted.

    Raises:
        SloshPlanError: it is tilted.

    >>> round(upright_yaw(np.array([0.0, 0.0, math.sin(0.25), math.cos(0.25)])), 3)  # rad
    0.5
    """
    if attitude is None:
        return 0.0
    x, y, z, w = np.asarray(attitude) / np.linalg.norm(attitude)
    if 2.0 * math.hypot(x, y) > UPRIGHT:
        tilt = math.degrees(2.0 * math.asin(min(1.0, math.hypot(x, y))))
        raise SloshPlanError(
            f"the container is tilted by {tilt:.3g}°: only upright containers can be planned for"
        )
    return 2.0 * math.atan2(z, w)
