"""Limits of a planned motion: sloshing height, acceleration, jerk, tilt, joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from slosh_model.limits import ValidityLimits
from slosh_model.model import Model
from slosh_plan.errors import SloshPlanError
from slosh_plan.limits import HeightLimits

_VALID = ValidityLimits()
ACCELERATION, JERK = _VALID.acceleration, _VALID.jerk
"""Up to which DL22's models were validated [m/s², m/s³]."""
RESIDUAL = 0.5
"""Height after the end as a share of the limit, where it is not given: a wave as high as the limit
leaves nothing for the next motion."""
TILT_RATE, TILT_ACCELERATION = math.radians(120.0), math.radians(1200.0)
LARGEST_TILT = math.radians(45.0)
JOINT_LIMITS = ("joint_velocity", "joint_acceleration", "joint_jerk", "joint_torque")
"""Of a robot's joints, as shares of the limits that the robot has."""
STANDING_LIMITS = ("friction", "tipping")
"""Of a container that stands loosely, as shares of what holds it."""
LARGEST = 1e6
"""Of any limit: more is a unit mistaken for another."""


@dataclass(frozen=True, slots=True)
class PlanLimits(HeightLimits):
    """Limits of a motion, including the liquid's height; they apply at all times.

    >>> limits = PlanLimits(height=0.020, residual=0.010)  # m
    >>> round(limits.lowered(0.002).height, 3)
    0.018

    Attributes:
        acceleration: ‖a‖ of the container's origin [m/s²].
        jerk: ‖da/dt‖ of the same [m/s³].
        tilt: of the container from upright [rad]; 0: it stays upright.
        tilt_rate, tilt_acceleration: size of the first and the second derivative of the rotation
            vector that tilts it [rad/s, rad/s²]; its angular velocity is not larger.
        joint_velocity, joint_acceleration, joint_jerk, joint_torque: shares of the joints' own
            limits that a motion of joints may use.
        friction, tipping: share of the friction that a container that stands loosely may use, and
            how far the centre of pressure may move, as a share of its base's radius.

    Raises:
        SloshPlanError: a limit that is not positive and finite; heights may be infinite.
    """

    acceleration: float = ACCELERATION
    jerk: float = JERK
    tilt: float = 0.0
    tilt_rate: float = TILT_RATE
    tilt_acceleration: float = TILT_ACCELERATION
    joint_velocity: float = 1.0
    joint_acceleration: float = 1.0
    joint_jerk: float = 1.0
    joint_torque: float = 1.0
    friction: float = 1.0
    tipping: float = 1.0

    def __post_init__(self) -> None:
        HeightLimits.__post_init__(self)
        for name, unit in UNITS.items():
            value = getattr(self, name)
            most = 1.0 if name in (*JOINT_LIMITS, *STANDING_LIMITS) else LARGEST
            if not (math.isfinite(value) and 0.0 < value <= most):
                bounds = f"must lie above 0 and not above {most:g}"
                raise SloshPlanError(f"limit of {name} = {value:g} {unit} {bounds}")
        if not 0.0 <= self.tilt <= LARGEST_TILT:
            raise SloshPlanError(
                f"limit of tilt = {math.degrees(self.tilt):g}° must lie in 0 … "
                f"{math.degrees(LARGEST_TILT):g}°"
            )

    def under_rim(self, model: Model) -> Self:
        """Returns the limits, with heights during and after the motion at most up to the rim."""
        kept = HeightLimits.under_rim(self, model)
        return replace(kept, residual=min(kept.residual, kept.height))

    def with_shares(
        self, defaults: Mapping[str, float], velocity: float | None, acceleration: float | None
    ) -> Self:
        """Returns the limits with shares of the joints' velocity and acceleration limits.

        Args:
            defaults: shares by 'velocity' and 'acceleration', where none is asked for.
            velocity, acceleration: that are asked for; None: none is.
        """
        return replace(
            self,
            joint_velocity=defaults.get("velocity", 1.0) if velocity is None else velocity,
            joint_acceleration=(
                defaults.get("acceleration", 1.0) if acceleration is None else acceleration
            ),
        )

    def lowered(self, margin: float) -> PlanLimits:
        """Returns the limits with the heights during and after the motion lowered by a margin [m].

        Raises:
            SloshPlanError: a negative margin, or one that leaves no height.
        """
        if not (math.isfinite(margin) and margin >= 0.0):
            raise SloshPlanError(f"margin = {margin:g} m must not be negative")
        least = min(self.height, self.residual)
        if margin >= least:
            raise SloshPlanError(
                f"margin = {1e3 * margin:g} mm is not below the limit of {1e3 * least:g} mm"
            )
        return replace(self, height=self.height - margin, residual=self.residual - margin)

    def reduced(self, share: float) -> PlanLimits:
        """Returns the limits with the heights during and after the motion cut by a fraction."""
        return replace(
            self, height=self.height * (1.0 - share), residual=self.residual * (1.0 - share)
        )


UNITS = {
    "acceleration": "m/s²", "jerk": "m/s³", "tilt_rate": "rad/s", "tilt_acceleration": "rad/s²",
    **dict.fromkeys(JOINT_LIMITS, "of the robot's limit"),
    **dict.fromkeys(STANDING_LIMITS, "of what holds the container"),
}  # fmt: skip
"""The limits that must be above 0 and finite, with their units."""
