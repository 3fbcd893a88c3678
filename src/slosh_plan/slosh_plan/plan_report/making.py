"""Creates the content of a plan's page, with motions and heights for comparison."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from slosh_base.types import Array
from slosh_model import Inputs, Model
from slosh_plan.errors import SloshPlanError
from slosh_plan.heights import highest_of_each, msh_of
from slosh_plan.plan_report.data import PlanReport, ShownMotion
from slosh_plan.planning.checked import CheckedMotion, attitudes, checked
from slosh_plan.planning.given_law import in_words
from slosh_plan.planning.plan import Plan
from slosh_plan.planning.time_law import STEP, PlannedMotion
from slosh_plan.planning.waypoints import Waypoints
from slosh_plan.prediction import COVERAGE, principal_variants
from slosh_plan.trajectory import Trajectory

PLANNED, PROPOSAL = "planned", "the waypoints’ own times"


def make_report(
    model: Model,
    plan: Plan,
    waypoints: Waypoints,
    subtitle: str = "",
    remarks: Sequence[str] = (),
) -> PlanReport:
    """Creates the content of the HTML page about a plan.

    Args:
        model: with which it was planned.
        plan: the plan.
        waypoints: the path as it was given.
        subtitle: where model and path come from.
        remarks: limits of validity that the motion exceeds.
    """
    notes = [f"Remarks: {', '.join(remarks)}."] if remarks else []
    notes += [] if plan.method == "optimal" else [f"No optimal time law: {plan.reason}."]
    proposal = None
    try:
        if plan.found.motion.joints is not None:
            raise SloshPlanError("the joints' own motion is not simulated here")
        motion = proposed_motion(waypoints)
        proposal = ShownMotion(PROPOSAL, checked(model, [motion], waypoints.attitude)[0])
    except SloshPlanError as error:
        if len(waypoints.position) > 2:  # two points alone are a line, nobody's motion
            notes.append(f"The waypoints’ own times are not shown: {error}.")
    return PlanReport(
        plan=plan,
        model=model.name,
        planned=ShownMotion(PLANNED, plan.found),
        scaled=ShownMotion(f"{in_words(plan.scaled.law)}, scaled", plan.scaled.found),
        proposal=proposal,
        waypoints=waypoints.position,
        band=height_band(model, plan.found, waypoints.attitude),
        subtitle=subtitle,
        notes=tuple(notes),
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
