"""The time law that was given with a path, and all laws that plans try beside their search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from slosh_base.types import Array
from slosh_plan.planning import optimise
from slosh_plan.planning.known_laws import known_laws
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import Path
from slosh_plan.planning.progress import never
from slosh_plan.planning.searched_law import kinematic_law
from slosh_plan.planning.time_law import Law, TimeLaw
from slosh_plan.planning.unit_laws import UNIT_LAWS

GIVEN, KINEMATIC = "the waypoints' own times", "the fastest motion without a liquid"
"""Names of laws."""


@dataclass(frozen=True, slots=True)
class GivenLaw(TimeLaw):
    """The time law by the times that were given with a path's points."""

    def durations(self, duration: float) -> tuple[float, ...]:
        """Returns the durations of the legs for a total duration [s]."""
        own = [float(spline.t[-1]) for spline in self.path.given]
        return tuple(duration * one / sum(own) for one in own)

    def laws(self, duration: float) -> list[Law]:
        """Returns the time laws of the legs for a total duration [s]."""
        each = zip(self.path.given, self.durations(duration), strict=True)
        return [_slowed(spline, float(spline.t[-1]) / time) for spline, time in each]


def _slowed(spline: BSpline, pace: float) -> Law:
    """Returns the law of a leg at another pace, as a share of the given one."""
    derivatives = (spline, spline.derivative(), spline.derivative(2))
    end = float(spline.t[-1])

    def law(t: Array) -> tuple[Array, Array, Array]:
        s, v, a = (np.asarray(one(np.clip(pace * t, 0.0, end))) for one in derivatives)
        return s, pace * v, pace**2 * a

    return law


def in_words(law: str) -> str:
    """Returns a law by its name, as a sentence names it.

    >>> in_words("quintic, slower in curves"), in_words(GIVEN)
    ('the quintic law, slower in curves', "the waypoints' own times")
    """
    unit = next((name for name in UNIT_LAWS if law.startswith(name)), "")
    return f"the {unit} law{law.removeprefix(unit)}" if unit else law


def all_laws(
    path: Path, limits: PlanLimits, seconds: float, stopped: Callable[[], bool] = never
) -> dict[str, TimeLaw]:
    """Returns the laws that every plan tries: standard ones, the given and the kinematic one.

    Args:
        path: the path.
        limits: of acceleration, jerk and joints.
        seconds: that the search of the kinematic law may take; it is left out where that is up.
        stopped: whether to end it.
    """
    known = known_laws(path, limits)
    found: dict[str, TimeLaw] = {**known}
    if path.given:
        found[GIVEN] = GivenLaw(path)
    if seconds > 0.0 and optimise.available():
        law = kinematic_law(path, known, limits, seconds, stopped)
        if law is not None:
            found[KINEMATIC] = law
    return found
