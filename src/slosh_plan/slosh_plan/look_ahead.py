"""Predicts the liquid's response to a motion that is about to begin."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

from slosh_model.tray import Tray
from slosh_plan import HeightLimits, ModelError, Prediction, Trajectory
from slosh_plan.start import LiquidStates
from slosh_plan.tray import TrayPrediction, predict_tray

FORGOTTEN = 60.0
"""A motion that begins later than in so long [s] finds the liquid at rest."""
LEAST = 3
"""Outcomes after which the cell's own record counts."""


class Record(NamedTuple):
    """Accuracy of earlier predictions in this robot cell: count, MAE [m] and relative error ε."""

    count: int  # type: ignore[assignment]  # the message's name, over tuple.count
    sigma: float
    epsilon: float

    @property
    def possible(self) -> bool:
        """Whether the record is valid: finite, without a negative count or size."""
        return self.count >= 0 and 0.0 <= self.sigma < math.inf and math.isfinite(self.epsilon)


def error_of(record: Record | None) -> ModelError:
    """Returns the model's error in past predictions, or zero error if these are too few."""
    if record is None or not record.possible or record.count < LEAST:
        return ModelError()
    return ModelError(min(record.sigma, 1.0), min(max(record.epsilon, -1.0), 10.0))


def look_ahead(
    tray: Tray,
    motion: Trajectory,
    delay: float,
    *,
    limits: HeightLimits,
    state: LiquidStates | None = None,
    error: ModelError | None = None,
) -> TrayPrediction:
    """Predicts the liquid's response to a motion that begins after a short delay.

    Args:
        tray: what is carried: a tray, or a model as a tray of one.
        motion: the motion.
        delay: until it begins [s]; the container rests meanwhile.
        limits: to be kept.
        state: the liquid now, of each container by its name; None: at rest.
        error: the model's measured error.

    Returns:
        the prediction, on the motion's own clock.

    Raises:
        SloshPlanError: the liquid stands above the limit already, or in another model's state.
    """
    state = state if delay <= FORGOTTEN else None
    if state is None or delay <= 0.0:
        (found,) = predict_tray(tray, [motion], limits=limits, state=state, error=error)
        return found
    later = motion.after_rest(delay)
    (found,) = predict_tray(tray, [later], limits=limits, state=state, error=error)
    containers = {
        name: replace(one, duration=motion.duration) for name, one in found.containers.items()
    }
    return found._replace(containers=containers)


def warning(prediction: Prediction) -> str:
    """Returns by how much a motion's liquid exceeds its height limits, as text; else empty."""
    limits, peak = prediction.limits, prediction.nonlinear
    parts = []
    if prediction.excess > 0.0:
        parts.append(
            f"the liquid will rise to {1e3 * prediction.upper:.1f} mm, "
            f"{1e3 * prediction.excess:.1f} mm above the {limits.height_name} of "
            f"{1e3 * limits.height:g} mm, "
            f"{peak.peak_time:.2f} s after the start"
        )
    if prediction.residual_excess > 0.0:
        parts.append(
            f"{1e3 * prediction.residual_upper:.1f} mm will be left after the end, "
            f"{1e3 * prediction.residual_excess:.1f} mm above the limit"
        )
    return "; ".join(parts)
