"""Predicts motions of a tray with several containers, and finds their limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple, TypeVar

import numpy as np

from slosh_base.types import Array, BoolArray
from slosh_model.constants import GRAVITY
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.model import Model
from slosh_model.standing import Standing
from slosh_model.standing_use import StandingMasses, StandingUse, standing_use
from slosh_model.tilt import attitude_of, with_tilt
from slosh_model.tray import Tray, TrayContainer
from slosh_plan.errors import SloshPlanError
from slosh_plan.heights import usual_horizon
from slosh_plan.limits import HeightLimits
from slosh_plan.prediction import ModelError, Prediction, predict
from slosh_plan.scaling import (
    COUNT,
    Budget,
    SafeScales,
    fastest_scale,
    refined,
    safe_scales,
    slowest_scale,
)
from slosh_plan.start import LiquidState, LiquidStates, begun, state_of
from slosh_plan.trajectory import PEAK_SPACING, Trajectory
from slosh_plan.tuning import TUNING

L = TypeVar("L", bound=HeightLimits)


class TrayPrediction(NamedTuple):
    """Predicted heights in all containers on a tray for one motion.

    Attributes:
        containers: the prediction of each, by name.
        worst: name of the one that is nearest to its limit, or farthest above.
        standing: how much of friction and base each uses that stands loosely, by name.
    """

    containers: Mapping[str, Prediction]
    worst: str
    standing: Mapping[str, StandingUse] = MappingProxyType({})

    @property
    def stands(self) -> bool:
        """Whether no container on the tray slides, tips or lifts off."""
        return all(use.stands for use in self.standing.values())

    @property
    def kept(self) -> bool:
        """Whether every container keeps its limits, and none slides, tips or lifts off."""
        return self.of_worst.kept and self.stands

    @property
    def falling(self) -> str:
        """Describes the containers that slide, tip or lift off; empty if there are none."""
        pairs = zip(self.standing.values(), self.loose_words, strict=True)
        return "; ".join(words for use, words in pairs if not use.stands)

    @property
    def loose_words(self) -> list[str]:
        """Sentences on loosely standing containers: used fraction of friction and support base."""
        return [
            f"{name} {use.words}: {100.0 * use.friction:.0f} % of the friction, centre of "
            f"pressure at {100.0 * use.tipping:.0f} % of the base's radius"
            for name, use in self.standing.items()
        ]

    @property
    def of_worst(self) -> Prediction:
        """Prediction for the container that is nearest to its limit, or farthest above it."""
        return self.containers[self.worst]


def limits_of(one: TrayContainer, limits: L) -> L:
    """Returns the motion's height limits, lowered to the container's own height limit."""
    if not one.limit < limits.height:
        return limits
    share = one.limit / limits.height if math.isfinite(limits.height) else 1.0
    return replace(limits, height=one.limit, residual=limits.residual * share)


def predict_tray(
    tray: Tray,
    trajectories: Sequence[Trajectory],
    *,
    limits: HeightLimits | None = None,
    state: LiquidStates | None = None,
    horizon: float | None = None,
    error: ModelError | None = None,
) -> list[TrayPrediction]:
    """Predicts the liquid in all containers for motions of a tray.

    Args:
        tray: the tray; each container is driven by the acceleration of its place.
        trajectories: candidates, of the tray's frame.
        limits: of all containers, beside their own limits and rims; None: nothing.
        state: of the liquid at the start, of each container by its name; None: at rest.
        horizon, error: as of `predict`.

    Raises:
        SloshPlanError: as of `predict`; no container is there.
    """
    check_present(tray)
    asked = limits or HeightLimits()
    by_name = {
        one.name: predict(
            one.placed,
            trajectories,
            limits=limits_of(one, asked),
            state=state_of(state, one.name),
            horizon=horizon,
            error=error,
        )
        for one in tray.present
    }
    found = []
    for place in range(len(trajectories)):
        containers = {name: answers[place] for name, answers in by_name.items()}
        worst = max(containers, key=lambda name: _use(containers[name]))
        standing = _standing(tray, trajectories[place], state)
        found.append(TrayPrediction(containers, worst, standing))
    return found


def check_present(tray: Tray) -> None:
    """Raises SloshPlanError if there is no container on the tray."""
    if not tray.present:
        raise SloshPlanError("the tray is empty: no liquid to predict")


def _standing(
    tray: Tray, motion: Trajectory, states: LiquidStates | None
) -> Mapping[str, StandingUse]:
    """Returns the fractions of friction and support base that each loose container uses."""
    found = {}
    for one in tray.present:
        if one.standing is None:
            continue
        own, inputs = state_of(states, one.name), motion.inputs(usual_horizon(one.model))
        model = with_tilt(one.placed, attitude_of(motion))
        modal = None if own is None else own.nonlinear
        found[one.name] = standing_use(
            model, one.standing, inputs, np.array(one.place),
            begun(model, modal, float(inputs.t[0])),
        )  # fmt: skip
    return found


def _use(found: Prediction) -> float:
    """Returns what fraction of its limits a container uses, or its height [m] without limits."""
    height, residual = found.limits.height, found.limits.residual
    if math.isinf(height) and math.isinf(residual):
        return found.upper
    return max(found.upper / height, found.residual_upper / residual)


def tray_scales(
    tray: Tray,
    motion: Trajectory,
    limits: HeightLimits,
    found: TrayPrediction,
    *,
    state: LiquidStates | None = None,
    horizon: float | None = None,
    count: int = COUNT,
    most: float = math.inf,
) -> SafeScales:
    """Returns the time scales with which each container keeps its limits and stays in place.

    Args:
        tray, motion, limits, state, horizon: as above.
        found: the prediction of the motion, by whose margins the limits are kept.
        count: of the scales that are looked at.
        most: samples that may be simulated, of all containers together.
    """
    each = [
        safe_scales(
            one.placed, motion, limits_of(one, limits), state=state_of(state, one.name),
            horizon=horizon,
            margin=found.containers[one.name].margin, count=count,
            most=most / len(tray.present),
        )
        for one in tray.present
    ]  # fmt: skip
    each += [
        standing_scales(
            one, one.standing, motion, state=state_of(state, one.name),
            most=most / len(tray.present),
        )
        for one in tray.present if one.standing is not None
    ]  # fmt: skip
    shared = each[0]
    for other in each[1:]:
        # Beyond what was looked at for one, its slowest scale says what holds.
        slowest = max(shared.slowest, other.slowest)
        shared = replace(
            shared,
            intervals=_common(_open(shared, slowest), _open(other, slowest)),
            fastest=max(shared.fastest, other.fastest),
            slowest=slowest,
            proven=shared.proven and other.proven,
        )
    return shared


def _open(scales: SafeScales, slowest: float) -> list[tuple[float, float]]:
    """Returns the safe intervals of time scales, the last one extended to `slowest` if open."""
    return [(a, slowest if b == scales.slowest else b) for a, b in scales.intervals]


def _common(
    some: Sequence[tuple[float, float]], others: Sequence[tuple[float, float]]
) -> tuple[tuple[float, float], ...]:
    pairs = ((max(a, c), min(b, d)) for a, b in some for c, d in others)
    return tuple((low, high) for low, high in pairs if low < high)


# Finds the uniform time scales of a motion with which a loose container stands on its tray.
#
# As for heights the whole range is looked at and the edges are refined. It ends where a bound of
# the linear model proves that all slower scales are safe: an undamped mode answers an
# acceleration of the total variation V by displacements of at most 2 V/ω² and by accelerations
# of at most 2 V and the acceleration itself; all of that goes with 1/scale².


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
