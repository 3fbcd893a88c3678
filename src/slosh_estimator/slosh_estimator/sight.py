"""Determines whether the monitor can compare heights, and if not, why.

Two sides that speak are not enough: a covered lens, a clock that is wrong, an estimate from an
unknown state give messages all the time, and nothing that could be believed. Sight is only what a
sound measurement and a sound estimate of one moment have given.
"""

from __future__ import annotations

import functools
import math
import operator
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_estimator.tuning import TUNING
from slosh_estimator.validity import EstimateFlag
from slosh_motion.inputs.sampling import SECONDS_PER_NS


class SurfaceFlag(IntFlag):
    """Limitations of a measured height; the values are those of FreeSurface.msg."""

    SATURATED = 1
    OCCLUDED = 16
    NOT_FOUND = 32
    FROZEN = 64
    BAD_IMAGE = 128
    CONTESTED = 256
    AMBIGUOUS = 512


# Plain numbers: they are compared with every sample's flags.
SATURATED = int(SurfaceFlag.SATURATED)
FROZEN = int(SurfaceFlag.FROZEN)
AMBIGUOUS = int(SurfaceFlag.AMBIGUOUS)
UNUSABLE = int(SurfaceFlag.NOT_FOUND | SurfaceFlag.BAD_IMAGE)
_MEASURED = {
    SurfaceFlag.CONTESTED: "several publishers send images (CONTESTED)",
    SurfaceFlag.BAD_IMAGE: (
        "the images cannot be decoded, or do not show the container (BAD_IMAGE)"
    ),
    SurfaceFlag.NOT_FOUND: "the camera detects no liquid (NOT_FOUND): is its lens covered?",
    SurfaceFlag.FROZEN: "the camera repeats the same image, or a few of them (FROZEN)",
}
_ESTIMATED = {
    EstimateFlag.NO_CONTAINER: "the gripper is empty (NO_CONTAINER)",
    EstimateFlag.INPUT_CONTESTED: "several publishers send the estimator's input",
    EstimateFlag.INPUT_DOUBTFUL: "the estimator's input is not plausible",
    EstimateFlag.INPUT_CONTRADICTED: "a second source contradicts the estimator's input",
    EstimateFlag.DIVERGED: "the model has left the physical range (DIVERGED)",
    EstimateFlag.AFTER_GAP: "the estimator's input had a gap (AFTER_GAP)",
    EstimateFlag.SETTLING: "the estimator has not converged to the liquid's state yet (SETTLING)",
}
_SHOWN_NOTHING = int(functools.reduce(operator.or_, _MEASURED))
UNSOUND = int(functools.reduce(operator.or_, _ESTIMATED))
"""Flags of an estimate that says nothing about the model: its state is not known, or its input is
not what it is said to be."""


def obstacle(measured: float, measured_flags: int, estimate: float, estimate_flags: int) -> str:
    """Returns why a measured and an estimated height cannot be compared; empty if they can.

    Args:
        measured, estimate: heights [m]; NaN: unknown.
        measured_flags: of FreeSurface.msg.
        estimate_flags: bits of EstimateFlag.
    """
    for flag, reason in _MEASURED.items():
        if measured_flags & int(flag):
            return reason
    if not math.isfinite(measured):
        return "the camera measures no height"
    return estimate_obstacle(estimate, estimate_flags)


def estimate_obstacle(estimate: float, estimate_flags: int) -> str:
    """Returns why the flags make an estimate [m] unusable; empty if it is usable."""
    for bit, reason in _ESTIMATED.items():
        if estimate_flags & int(bit):
            return reason
    return "" if math.isfinite(estimate) else "no estimate for the time of the image"


def judged(
    measured: Array, measured_flags: Integers, estimated: Array, sound: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Returns a mask of the pairs of heights that count in the accuracy (MAE, ε).

    The monitor's MAE and ε, the table of a run and a replay's all count these and no others. A
    saturated measurement is a lower bound: it counts only where it lies above the estimate.

    Args:
        measured, estimated: (N,) [m].
        measured_flags: (N,) of FreeSurface.msg.
        sound: (N,) whether the estimates' flags have nothing of UNSOUND.
    """
    shown = (measured_flags & _SHOWN_NOTHING) == 0
    bound = (measured_flags & SATURATED) != 0
    found: NDArray[np.bool_] = sound & shown & ~(bound & ~(measured > estimated))
    return found


def clocks_apart(measured_ns: int, estimated_ns: int) -> str:
    """Returns one line if two stamps [ns] come from different clocks, else an empty text."""
    apart = (measured_ns - estimated_ns) * SECONDS_PER_NS
    if abs(apart) <= TUNING.clocks_apart:
        return ""
    return (
        f"the stamps of the measurements are {abs(apart):.3f} s "
        f"{'ahead of' if apart > 0.0 else 'behind'} those of the estimates: nothing is "
        "compared; both must use the same clock"
    )


class ClockWatch:
    """Detects a simulated clock that has stopped, with which no timeout would occur."""

    def __init__(self) -> None:
        self._clock_ns: int | None = None
        self._moved_ns: int | None = None
        self._began_ns = 0

    def look(self, steady_ns: int, clock_ns: int) -> str:
        """Returns a warning line if the simulated clock stopped, else empty; call regularly.

        Args:
            steady_ns: elapsed time [ns].
            clock_ns: the simulated time [ns].
        """
        if self._clock_ns is None:
            self._clock_ns, self._began_ns = clock_ns, steady_ns
        if clock_ns != self._clock_ns:
            self._clock_ns, self._moved_ns = clock_ns, steady_ns
        since = self._began_ns if self._moved_ns is None else self._moved_ns
        seconds = (steady_ns - since) * SECONDS_PER_NS
        if self._moved_ns is not None and seconds < TUNING.clock_stands:
            return ""
        return (
            f"simulated time does not advance for {seconds:.1f} s: use_sim_time is set, but no "
            "advancing /clock is received"
        )


class Sight:
    """Stores when an estimated height was last compared with a measured one.

    Args:
        timeout: after so long without it the monitor is blind [s]; it may be changed.
    """

    def __init__(self, timeout: float) -> None:
        self.timeout = timeout
        self._since_ns: int | None = None
        self._reason = ""

    def look(self, now_ns: int, obstacle: str) -> None:
        """Records the time [ns] of a comparison, or the reason why heights were not comparable."""
        if not obstacle or self._since_ns is None:
            self._since_ns = now_ns
        self._reason = obstacle

    def blindness(self, now_ns: int) -> str:
        """Returns why no heights were compared for too long; empty if they were."""
        if self._since_ns is None:
            self._since_ns = now_ns
        seconds = (now_ns - self._since_ns) * SECONDS_PER_NS
        if seconds <= self.timeout:
            return ""
        return f"nothing compared for {seconds:.1f} s: {self._reason or 'nothing to compare'}"
