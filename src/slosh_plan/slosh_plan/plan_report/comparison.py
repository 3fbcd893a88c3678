"""Other motions along a plan's path, and the band of its heights, for comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from slosh_base.types import Array
from slosh_model import Inputs, Model
from slosh_plan.errors import SloshPlanError
from slosh_plan.heights import highest_of_each, msh_of
from slosh_plan.plan_report.words import further_lines
from slosh_plan.planning.checked import CheckedMotion, attitudes, checked
from slosh_plan.planning.given_law import in_words
from slosh_plan.planning.plan import Plan
from slosh_plan.planning.plan_tray import TrayPlan
from slosh_plan.planning.time_law import STEP, PlannedMotion
from slosh_plan.planning.tolerance import Tolerance
from slosh_plan.planning.waypoints import Waypoints
from slosh_plan.prediction import COVERAGE, principal_variants
from slosh_plan.trajectory import Trajectory

PLANNED, PROPOSAL = "planned", "the waypoints’ own times"


@dataclass(frozen=True, slots=True, eq=False)
class ShownMotion:
    """A motion along the path, with its title.

    Attributes:
        title: for people.
        kind: of its lines in charts.
        found: the motion and what it reaches.
    """

    title: str
    kind: str
    found: CheckedMotion

    @property
    def times(self) -> Array:
        """Times (M,) [s] of the heights, which continue after the motion's end."""
        return STEP * np.arange(len(self.found.msh), dtype=np.float64)

    @property
    def acceleration(self) -> Array:
        """Magnitude (N,) of the container's acceleration [m/s²]."""
        return np.asarray(np.linalg.norm(self.found.motion.acceleration, axis=1))

    @property
    def jerk(self) -> Array:
        """Magnitude (N - 1,) of the jerk [m/s³], by finite differences."""
        steps = np.diff(self.found.motion.acceleration, axis=0)
        return np.asarray(np.linalg.norm(steps, axis=1) / STEP)


@dataclass(frozen=True, slots=True, eq=False)
class PlanReport:
    """A plan, with other motions along the same path for comparison.

    Attributes:
        plan: the plan.
        borne: which error of the frequency it bears.
        model: the model's name.
        motions: the waypoints' own times, if they tell a motion; the best of the known laws; last
            the planned motion, which may be that law's.
        waypoints: (N, 3) [m].
        band: (2, M) lower and upper end of the planned motion's heights (95 %) [m]; None: the
            model's error is not known.
        subtitle: where model and path come from; may be empty.
        remarks: what the reader must know, a sentence each.
    """

    plan: Plan
    borne: Tolerance
    model: str
    motions: tuple[ShownMotion, ...]
    waypoints: Array
    band: Array | None
    subtitle: str = ""
    remarks: tuple[str, ...] = ()

    @property
    def planned(self) -> ShownMotion:
        """The planned motion."""
        return self.motions[-1]

    @property
    def upper(self) -> tuple[float, float] | None:
        """Upper ends of the 95 % band [m] for peak and residual height; None without a band."""
        if self.band is None:
            return None
        end = len(self.planned.found.motion.t) - 1
        return float(self.band[1].max()), float(self.band[1][end:].max())


def make_report(
    model: Model,
    planned: TrayPlan,
    waypoints: Waypoints,
    borne: Tolerance,
    subtitle: str = "",
    remarks: Sequence[str] = (),
) -> PlanReport:
    """Simulates what a plan is compared with.

    Args:
        model: with which it was planned.
        planned: the plan.
        waypoints: the path as it was given.
        borne: which error of the frequency it bears.
        subtitle: where model and path come from.
        remarks: limits of validity that the motion exceeds.
    """
    plan = planned.plan
    told = [f"Remarks: {', '.join(remarks)}."] if remarks else []
    told += [f"{line[0].upper()}{line[1:]}." for line in further_lines(planned)]
    motions = []
    try:
        if plan.found.motion.joints is not None:
            raise SloshPlanError("the joints' own motion is not simulated here")
        motion = proposed_motion(waypoints)
        own = checked(model, [motion], waypoints.attitude)[0]
        motions.append(ShownMotion(PROPOSAL, "thin", own))
    except SloshPlanError as error:
        if len(waypoints.position) > 2:  # two points alone are a line, nobody's motion
            told.append(f"The waypoints’ own times are not shown: {error}.")
    scaled = plan.scaled
    if scaled.found is not plan.found:
        motions.append(ShownMotion(f"{in_words(scaled.law)}, scaled", "linear", scaled.found))
    motions.append(ShownMotion(PLANNED, "nonlinear", plan.found))
    band = height_band(model, plan.found, waypoints.attitude)
    return PlanReport(
        plan, borne, model.name, tuple(motions), waypoints.position, band, subtitle, tuple(told)
    )


def proposed_motion(waypoints: Waypoints) -> PlannedMotion:
    """Returns the rest-to-rest motion, at 1 kHz, that keeps the waypoints' given times.

    Raises:
        SloshPlanError: they make none: too few, gaps, accelerations of another unit.
    """
    given = Trajectory.from_poses(waypoints.t, waypoints.position, name="the waypoints")
    spline = CubicSpline(given.t, waypoints.position, bc_type="clamped")
    count = round(given.duration / STEP)
    if count < 2:
        raise SloshPlanError("they last less than two milliseconds")
    t = np.linspace(given.t[0], given.t[-1], count + 1)
    speed = np.linalg.norm(spline(t, 1), axis=1)
    return PlannedMotion(
        STEP * np.arange(count + 1, dtype=np.float64), spline(t), spline(t, 2), speed
    )


def height_band(model: Model, found: CheckedMotion, attitude: Array | None) -> Array | None:
    """Returns the 95 % band of heights by the parameters' covariance; None without covariance.

    Along each principal axis of the covariance the model is simulated two standard errors to
    either side, and what the heights rise and fall by adds up as squares. It is not linearised: a
    wave that the motion cancels grows whichever way the frequency errs.

    Args:
        model: the model.
        found: the motion and its heights.
        attitude: (4,) quaternion that the container keeps where it does not tilt; None: upright.

    Returns:
        (2, M) [m], about 95 %; None: the model has no covariance.
    """
    variants = principal_variants(model, COVERAGE)
    if not variants:
        return None
    acceleration = np.zeros((len(found.msh), 3))
    acceleration[: len(found.motion.t)] = found.motion.acceleration
    t = STEP * np.arange(len(found.msh), dtype=np.float64)
    turned = attitudes(found.motion, attitude, len(t))
    inputs = Inputs(t, acceleration, turned)
    below, above = np.zeros((2, len(t)))
    for pair in variants:
        both = highest_of_each(pair, inputs)
        change = np.stack([msh_of(model.container, heights) for heights in both]) - found.msh
        below += np.minimum(change.min(axis=0), 0.0) ** 2
        above += np.maximum(change.max(axis=0), 0.0) ** 2
    return np.stack([np.maximum(found.msh - np.sqrt(below), 0.0), found.msh + np.sqrt(above)])
