"""Tests how a planned motion tolerates an error of the natural frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace

from slosh_base.types import Array
from slosh_model.model import Model
from slosh_plan.planning.checked import checked
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.time_law import PlannedMotion

ERRORS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1)
"""Relative errors of the natural frequency that are tried, to either side."""
USUAL = 0.01
"""Error of a frequency that was computed from a container's measured dimensions."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Largest error of the natural frequency that a plan tolerates, and its effect on heights.

    Attributes:
        error: largest of ERRORS up to which every error keeps both limits of the height, as a
            fraction; 0: none of them does.
        peak, residual: largest heights with the frequency USUAL off, to either side [m].
    """

    error: float
    peak: float
    residual: float


def frequency_tolerance(
    model: Model, motion: PlannedMotion, limits: PlanLimits, attitude: Array | None = None
) -> Tolerance:
    """Simulates a planned motion with other natural frequencies, to find its tolerance.

    A motion that runs faster or slower by a share is, to the liquid's phase, the same as an error
    of the frequency by that share.

    Args:
        model: with which the motion was planned.
        motion: the plan.
        limits: that it keeps.
        attitude: (4,) quaternion that the container keeps; None: upright.
    """
    frequency = model.mode_frequency(1)
    borne, usual = 0.0, (0.0, 0.0)
    kept = True
    for error in ERRORS:
        twins = [
            replace(model, natural_frequency=frequency * (1.0 + sign * error), covariance=None)
            for sign in (-1.0, 1.0)
        ]
        found = [checked(twin, [motion], attitude)[0] for twin in twins]
        peak, residual = max(x.peak for x in found), max(x.residual for x in found)
        if error == USUAL:
            usual = peak, residual
        kept = kept and peak <= limits.height and residual <= limits.residual
        borne = error if kept else borne
        if not kept and error >= USUAL:
            break
    return Tolerance(borne, *usual)
