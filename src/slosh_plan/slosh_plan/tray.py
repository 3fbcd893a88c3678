"""Motions of a tray: what each container's liquid does, and which limits all of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

from slosh_model.tray import Tray, TrayContainer
from slosh_plan.errors import SloshPlanError
from slosh_plan.limits import HeightLimits
from slosh_plan.prediction import ModelError, Prediction, predict
from slosh_plan.scaling import COUNT, SafeScales, safe_scales
from slosh_plan.start import LiquidState
from slosh_plan.trajectory import Trajectory

L = TypeVar("L", bound=HeightLimits)


class TrayPrediction(NamedTuple):
    """What is predicted of a motion of a tray.

    Attributes:
        containers: the prediction of each, by name.
        worst: name of the one that is nearest to its limit, or farthest above.
    """

    containers: Mapping[str, Prediction]
    worst: str

    @property
    def of_worst(self) -> Prediction:
        """The prediction of the worst container."""
        return self.containers[self.worst]


def limits_of(one: TrayContainer, limits: L) -> L:
    """The limits of a container: its own height where that is lower, and its residual likewise."""
    if not one.limit < limits.height:
        return limits
    share = one.limit / limits.height if math.isfinite(limits.height) else 1.0
    return replace(limits, height=one.limit, residual=limits.residual * share)


def predict_tray(
    tray: Tray,
    trajectories: Sequence[Trajectory],
    *,
    limits: HeightLimits | None = None,
    state: LiquidState | None = None,
    horizon: float | None = None,
    error: ModelError | None = None,
) -> list[TrayPrediction]:
    """Predicts motions of a tray; see `slosh_plan.predict`.

    Args:
        tray: the tray; each container is driven by the acceleration of its place.
        trajectories: candidates, of the tray's frame.
        limits: of all containers, beside their own limits and rims; None: nothing.
        state: at the start, of one container; None: at rest.
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
            state=state,
            horizon=horizon,
            error=error,
        )
        for one in tray.present
    }
    return [
        prediction_of({name: answers[place] for name, answers in by_name.items()})
        for place in range(len(trajectories))
    ]


def check_present(tray: Tray) -> None:
    """Raises SloshPlanError where no container is on the tray."""
    if not tray.present:
        raise SloshPlanError("the tray is empty: no liquid to predict")


def prediction_of(containers: Mapping[str, Prediction]) -> TrayPrediction:
    """The prediction of a motion of a tray, from those of its containers by name."""
    return TrayPrediction(containers, max(containers, key=lambda name: _use(containers[name])))


def _use(found: Prediction) -> float:
    """How much of its limits a container uses; without a limit its height in metres."""
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
    state: LiquidState | None = None,
    horizon: float | None = None,
    count: int = COUNT,
    most: float = math.inf,
) -> SafeScales:
    """The time scales at which every container keeps its limits; see `slosh_plan.safe_scales`.

    Args:
        tray, motion, limits, state, horizon: as above.
        found: the prediction of the motion, by whose margins the limits are kept.
        count: of the scales that are looked at.
        most: samples that may be simulated, of all containers together.
    """
    each = [
        safe_scales(
            one.placed, motion, limits_of(one, limits), state=state, horizon=horizon,
            margin=found.containers[one.name].margin, count=count,
            most=most / len(tray.present),
        )
        for one in tray.present
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
    """The safe intervals; one that reaches the slowest scale looked at goes on to a slower one."""
    return [(a, slowest if b == scales.slowest else b) for a, b in scales.intervals]


def _common(
    some: Sequence[tuple[float, float]], others: Sequence[tuple[float, float]]
) -> tuple[tuple[float, float], ...]:
    pairs = ((max(a, c), min(b, d)) for a, b in some for c, d in others)
    return tuple((low, high) for low, high in pairs if low < high)
