"""Data types of the observer's inputs and outputs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from typing import Final, NamedTuple

from slosh_base.types import Array
from slosh_estimator.tuning import TUNING

SAME_FIELDS: Final = (
    "msh", "msh_stddev", "azimuth", "sh_x", "sh_x_stddev", "sh_y", "sh_y_stddev",
    "frequency_factor", "frequency_stddev", "damping_factor", "damping_stddev", "level",
    "clock_offset",
)  # fmt: skip
"""Fields of FusedEstimate.msg that are attributes of FusedState."""


class WallHeights(NamedTuple):
    """Measured heights of the liquid on the container's wall at one time.

    Attributes:
        stamp_ns: the moment [ns].
        points: (M, 3) azimuth about the container's axis [rad], or NaN: the highest place,
            wherever it is; height above the still level [m]; its standard deviation [m]. Without
            points nothing is measured.
    """

    stamp_ns: int
    points: Array


class Outcome(Enum):
    """How a measurement was treated: used, rejected, too late, or without a height."""

    USED = "used"
    REJECTED = "rejected"
    LATE = "late"
    EMPTY = "empty"


class FusedState(NamedTuple):
    """State of the liquid that the observer fuses from the model and the measurements.

    Attributes:
        stamp_ns: the moment [ns].
        corrected_ns: stamp of the last measurement that is used [ns]; None: none.
        msh, azimuth: maximum sloshing height [m] and where it is [rad].
        sh_x, sh_y: signed height at the container's +x and +y side [m].
        msh_stddev, sh_x_stddev, sh_y_stddev: standard deviations of these heights [m].
        modal: x, y, vx, vy of each mode, one after the other [m, m/s].
        frequency_factor, damping_factor: natural frequency and damping ratio over the model's.
        frequency_stddev, damping_stddev: standard deviations of their logarithms.
        envelope, envelope_stddev: largest height that the wave still reaches if nothing moves from
            now on, and its standard deviation [m].
        decay: of that [1/s].
        moved_ns: when the container moved last [ns]; None: it has not.
        level: still level above the measurement's zero [m].
        clock_offset: by how much stamps of measurements are late [s].
        bound, sure_bound: upper bound of the envelope, of 95 % and sure [m]; see EnvelopeBounds.
        slowest: least plausible decay [1/s].
    """

    stamp_ns: int
    corrected_ns: int | None
    msh: float
    azimuth: float
    sh_x: float
    sh_y: float
    sh_x_stddev: float
    sh_y_stddev: float
    msh_stddev: float
    modal: list[float]
    frequency_factor: float
    damping_factor: float
    frequency_stddev: float
    damping_stddev: float
    envelope: float
    envelope_stddev: float
    decay: float
    moved_ns: int | None
    level: float
    clock_offset: float
    bound: float
    sure_bound: float
    slowest: float

    @property
    def uncorrected(self) -> float:
        """Time since the last measurement that was used [s]; infinite before the first one."""
        if self.corrected_ns is None:
            return math.inf
        return max(self.stamp_ns - self.corrected_ns, 0) / 1e9

    @property
    def trusted(self) -> bool:
        """Whether measurements were used and the height is certain enough to rely on."""
        return self.corrected_ns is not None and self.msh_stddev <= TUNING.trusted_stddev


def fused_fields(
    state: FusedState, counts: Mapping[Outcome, int], sensed: int = 0
) -> dict[str, float]:
    """Returns the values for FusedEstimate.msg by field name, without the modal state.

    Args:
        state: to tell.
        counts: of the measurements before it, by outcome.
        sensed: how many of them are of sensors beside the camera.
    """
    return {
        **{name: getattr(state, name) for name in SAME_FIELDS},
        "uncorrected": math.nan if state.corrected_ns is None else state.uncorrected,
        "heights_taken": sum(counts.values()),
        "heights_used": counts[Outcome.USED],
        "heights_rejected": counts[Outcome.REJECTED],
        "sensed_taken": sensed,
    }


class ObserverState(NamedTuple):
    """State of an observer; restoring it gives the same results; see ObserverState.msg."""

    stamp_ns: int
    first_ns: int
    corrected_ns: int | None
    judged_ns: int | None
    counts: tuple[int, ...]
    rejected: int
    anchored_at: float
    model: Array
    parameters: Array
    covariance: Array
    changes: Array
    past: Array
    sensed: int = 0
    sensed_ns: int | None = None
