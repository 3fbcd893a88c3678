"""Finds the uniform time scales of a motion with which a loose container stands on its tray.

As for heights the whole range is looked at and the edges are refined. It ends where a bound of
the linear model proves that all slower scales are safe: an undamped mode answers an acceleration
of the total variation V by displacements of at most 2 V/ω² and by accelerations of at most 2 V and
the acceleration itself; all of that goes with 1/scale².
"""

from __future__ import annotations

import math

import numpy as np

from slosh_base.types import Array, BoolArray
from slosh_model.constants import GRAVITY
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.model import Model
from slosh_model.standing import Standing
from slosh_model.standing_use import StandingMasses, standing_use
from slosh_model.tilt import attitude_of, with_tilt
from slosh_model.tray import TrayContainer
from slosh_plan.heights import usual_horizon
from slosh_plan.scaling import Budget, SafeScales, fastest_scale, refined, slowest_scale
from slosh_plan.start import LiquidState, begun
from slosh_plan.trajectory import PEAK_SPACING, Trajectory
from slosh_plan.tuning import TUNING


def standing_scales(
    one: TrayContainer,
    standing: Standing,
    trajectory: Trajectory,
    *,
    state: LiquidState | None = None,
    most: float = math.inf,
) -> SafeScales:
    """Finds the time scales with which a container neither slides nor tips nor lifts off.

    Args:
        one: the container.
        standing: how it stands.
        trajectory: motion of the tray's frame.
        state: of the liquid when it begins; None: at rest.
        most: samples that may be simulated, of all scales together.

    Raises:
        SloshPlanError: more samples than that.
    """
    model, budget = with_tilt(one.placed, attitude_of(trajectory)), Budget(most)
    horizon = usual_horizon(one.model)
    modal = None if state is None else state.nonlinear
    start = begun(model, modal, float(trajectory.t[0]))

    def stands(scales: Array) -> BoolArray:
        budget.take(
            np.maximum(trajectory.duration * scales / PEAK_SPACING, len(trajectory.t))
            + horizon / PEAK_SPACING
        )
        inputs = (trajectory.scaled(float(scale)).inputs(horizon) for scale in scales)
        place = np.array(one.place)
        return np.array(
            [standing_use(model, standing, each, place, start).stands for each in inputs]
        )

    fastest = fastest_scale(model.nonlinear(), trajectory)
    turning = trajectory.turns or model.uses("drive")
    # The bound is that of a liquid at rest.
    bound = None if turning or state is not None else _bound(model, standing, trajectory)
    slowest = slowest_scale(trajectory, fastest, bound)
    scales = np.geomspace(fastest, slowest, TUNING.standing_scales)
    return SafeScales(
        trajectory.name, trajectory.duration, refined(stands, scales, stands(scales)),
        float(scales[0]), float(scales[-1]), bool(bound and bound < slowest),
    )  # fmt: skip


def _bound(model: Model, standing: Standing, trajectory: Trajectory) -> float:
    """Returns the time scale above which the linear model proves that the container stands."""
    masses = StandingMasses.of(model, standing)
    share, heights = masses.modal.max(axis=1) / masses.total, masses.heights.max(axis=1)
    modes = model.mode_constants()
    frequency = np.array([min(mode.along(axis).natural_frequency for axis in (X_AXIS, Y_AXIS))
                          for mode in modes])  # fmt: skip
    damping = np.array([mode.damping_ratio for mode in modes])
    lateral = trajectory.acceleration[:, :2]
    size = float(np.linalg.norm(lateral, axis=1).max())
    lift = float(np.abs(trajectory.acceleration[:, 2]).max())
    ends = np.zeros((1, 2))
    steps = np.diff(lateral, axis=0, prepend=ends, append=ends)
    variation = float(np.linalg.norm(steps, axis=1).sum())
    answer = 2.0 * variation * (1.0 + 2.0 * damping) + size
    slip = size + float(share @ answer)
    # Slower than the lift's own bound the normal force is at most twice the weight.
    tip = masses.centre_height * size + float((share * heights) @ answer)
    tip += 2.0 * GRAVITY * float(share @ (2.0 * variation / frequency**2))
    return math.sqrt(
        max(slip / standing.friction + lift, tip / standing.base_radius + lift, lift) / GRAVITY
    )
