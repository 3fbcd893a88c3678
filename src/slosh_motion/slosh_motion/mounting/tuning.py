"""Tuning numbers for the comparison of a sensor with a motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class MountingTuning:
    """Assumptions about sensors and motions for the mounting check.

    Set on the mountings of even seeds of `validation/studies/mountings.py`. "se" is the standard
    error.
    """

    # columns.py
    step: float = number(0.01, "s", "step of the common time axis")
    boxes: tuple[float, ...] = number(
        (0.05, 0.11, 0.25), "s", "widths of the boxes that smooth both sides, by the noise"
    )
    gap: float = number(0.1, "s", "time between two samples across which nothing is known")
    farthest_lag: float = number(0.3, "s", "largest lag that is looked for")
    # hypotheses.py, refinement.py
    noise: float = number(
        0.03, "m/s²", "least error of a prediction, in the sensor's unit g = 9.81"
    )
    share: float = number(0.02, "1", "the same, of the motion's rms")
    turn_noise: float = number(0.02, "rad/s", "the same of an angular velocity")
    independent: float = number(0.1, "s", "time after which errors are independent")
    block: float = number(0.2, "s", "length of the blocks whose spread gives standard errors")
    bias: float = number(0.1, "m/s²", "standard deviation of a sensor's bias")
    drift: float = number(0.01, "rad/s", "standard deviation of a gyroscope's bias")
    doubt: float = number(1.0, "rad", "standard deviation of a mounting before a motion")
    arm: float = number(0.2, "m", "standard deviation of a lever arm before a motion")
    handed: float = number(8.0, "1", "logarithm of the odds of axes that are right-handed")
    reversed_gravity: float = number(6.0, "1", "the same of gravity with the motion's sign")
    least_turn: float = number(0.1, "rad/s", "rms of an angular velocity that is compared")
    # verdict.py
    sure: float = number(3.0, "se", "distance from what is said that is no chance")
    turned: float = number(math.radians(5.0), "rad", "least angle of a wrong mounting")
    unseen: float = number(math.radians(12.0), "rad", "standard error of a turn that is not seen")
    snapped: float = number(math.radians(4.0), "rad", "distance from an axis that is one")
    gain: float = number(0.1, "1", "least relative error of a wrong gain")
    unit: float = number(0.15, "1", "relative distance from a unit's gain that is that unit")
    gravity: float = number(0.15, "1", "part of gravity that is wrongly in or out")
    explained: float = number(0.6, "1", "least part of the motion that a fit explains")
    clear: float = number(0.9, "1", "least part of the motion that is no noise")
    enough: float = number(0.97, "1", "explained part with which no other smoothing is tried")
    late: float = number(0.03, "s", "least lag that is told")
    arm_off: float = number(0.03, "m", "least error of a lever arm that is told")
    # watch.py
    moving: float = number(0.3, "m/s²", "least acceleration of a motion")
    turning: float = number(0.1, "rad/s", "least angular velocity of a motion")
    rest_ns: int = number(400_000_000, "ns", "rest that ends a motion")
    longest_ns: int = number(8_000_000_000, "ns", "time after which a motion is compared as it is")
    least: float = number(0.3, "s", "shortest motion that is compared")
    kept: float = number(40.0, "s", "motion that is compared together")


TUNING = MountingTuning()
