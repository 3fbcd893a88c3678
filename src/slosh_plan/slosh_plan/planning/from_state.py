"""Whether a plan, made for a liquid at rest, is safe from the state in which the liquid is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_model import Model
from slosh_plan.errors import SloshPlanError
from slosh_plan.limits import HeightLimits
from slosh_plan.planning.checked import horizon
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.plan import Plan
from slosh_plan.prediction import check_start, predict
from slosh_plan.start import LiquidState
from slosh_plan.trajectory import Trajectory

Array = NDArray[np.float64]


def check_state(model: Model, limits: PlanLimits, state: LiquidState) -> None:
    """Raises SloshPlanError where the liquid stands above the limit before any motion."""
    check_start(model, state, HeightLimits(limits.height))


def check_plan_from(
    model: Model, answer: Plan, attitude: Array | None, state: LiquidState
) -> None:
    """Raises SloshPlanError where a plan exceeds its limits if it begins in a state.

    Args:
        model: as it was planned with.
        answer: the plan.
        attitude: (4,) that the container keeps; None: not turned.
        state: the liquid when the motion begins.
    """
    motion, limits = answer.found.motion, answer.limits
    turned = None if attitude is None else np.tile(attitude, (len(motion.t), 1))
    trajectory = Trajectory(motion.t, motion.acceleration, turned, name="the plan")
    heights = HeightLimits(limits.height, limits.residual)
    (found,) = predict(
        model, trajectory, limits=heights, state=state, horizon=horizon(model)
    )  # fmt: skip
    peak, residual = found.nonlinear.peak, found.nonlinear.residual
    if peak > limits.height or residual > limits.residual:
        raise SloshPlanError(
            f"the liquid moves: from its state now the plan reaches {1e3 * peak:.1f} mm and "
            f"leaves {1e3 * residual:.1f} mm; wait until it has settled"
        )
