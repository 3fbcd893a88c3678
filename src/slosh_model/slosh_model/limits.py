"""Range of motion in which measurements validated a model."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_model.checks import within


@dataclass(frozen=True, slots=True)
class ValidityLimits:
    """Range of motion in which a model was validated; outside it, the estimator sets flags.

    The defaults are those of a cylinder (DL22, §4.2).

    >>> from slosh_model import ValidityLimits
    >>> ValidityLimits().acceleration  # m/s²
    9.5

    Attributes:
        acceleration: ‖a‖ [m/s²] up to which NL follows the liquid.
        jerk: [m/s³] likewise.
        planar_acceleration: ‖a‖ [m/s²] up to which the surface stays a plane (L).
        planar_jerk: [m/s³] likewise.
    """

    acceleration: float = 9.5
    jerk: float = 74.0
    planar_acceleration: float = 8.0
    planar_jerk: float = 60.0

    def __post_init__(self) -> None:
        for name in ("acceleration", "planar_acceleration"):
            within(f"limits.{name}", getattr(self, name), "m/s²", 1e-3, 1e3)
        for name in ("jerk", "planar_jerk"):
            within(f"limits.{name}", getattr(self, name), "m/s³", 1e-3, 1e5)
