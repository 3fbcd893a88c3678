"""Commands to the governor, the observed state of the liquid, and the results of its steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from slosh_base.types import Array
from slosh_governor.core.layout import LIGHT
from slosh_plan.errors import SloshPlanError

MOST_FREQUENCY = 0.1
"""Largest error of a frequency. The models' frequencies are too far apart above: a liquid between
two of them resonates with a motion that both do without."""


class GovernorState(IntEnum):
    """Whether the governor follows, limits or stops the motion; values of GovernedMotion.msg."""

    FOLLOWING = 0
    LIMITED = 1
    STOPPING = 2
    RESTING = 3


class StopReason(IntEnum):
    """Reason why the governor stops; values are those of GovernedMotion.msg."""

    NONE = 0
    SILENT = 1
    INVALID = 2
    LATE = 3
    REQUESTED = 4
    JOINTS = 5
    TURN = 6
    FAST = 7
    FRAME = 8
    STAMP = 9


class Command(NamedTuple):
    """A commanded motion of the container, or of the joints that carry it.

    Attributes:
        stamp_ns: when it was sent [ns]; 0: unknown, taken as now.
        velocity: of each coordinate: x, y, z of the container's origin in the world's axes [m/s],
            or joints [rad/s or m/s]; empty: 0. With a target, that of the target.
        target: a place to go to [m], or joint positions [rad or m]; None: the velocity is
            commanded. At the first target of a run the container is there.
        refused: why it was refused where it was read; its numbers are NaN then.
    """

    stamp_ns: int
    velocity: tuple[float, ...] = ()
    target: tuple[float, ...] | None = None
    refused: StopReason = StopReason.NONE


class SeenLiquid(NamedTuple):
    """State of the liquid, estimated by an observer from measurements.

    Attributes:
        stamp_ns: the moment [ns].
        modal: (modes, 4) x, y, vx, vy of each mode's mass in the NL model [m, m/s].
        stddev: standard deviation of its height [m].
        frequency_factor: natural frequency over the model's, of which heights by displacement
            are the square.
        uncorrected: time since the last measurement that it uses [s]; NaN: unknown.
    """

    stamp_ns: int
    modal: Array
    stddev: float
    frequency_factor: float = 1.0
    uncorrected: float = math.nan


@dataclass(frozen=True, slots=True)
class ModelDoubt:
    """Model errors (frequency, damping) for which the governor still keeps the height limit.

    >>> from slosh_governor.core import ModelDoubt
    >>> ModelDoubt(frequency=0.03, damping=2.0).factors[0]
    (1.0, 1.0)

    Attributes:
        frequency: relative error of the natural frequencies, to either side.
        damping: factor by which the damping ratios may be larger or smaller.

    Raises:
        SloshPlanError: an impossible value.
    """

    frequency: float = 0.03
    damping: float = 2.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.frequency <= MOST_FREQUENCY:
            raise SloshPlanError(
                f"frequency error = {self.frequency!r} must lie in 0 … {MOST_FREQUENCY:g}"
            )
        if not 1.0 <= self.damping <= 10.0:
            raise SloshPlanError(f"damping factor = {self.damping!r} must lie in 1 … 10")

    @property
    def factors(self) -> tuple[tuple[float, float], ...]:
        """Factors (frequency, damping) of each simulated model, the unchanged model first."""
        e, d = self.frequency, self.damping
        count = LIGHT - 1
        light = [(1.0 + e * (2.0 * k / count - 1.0), 1.0 / d) for k in range(count + 1)]
        return ((1.0, 1.0), *light, (1.0, d))


class Governed(NamedTuple):
    """Result of one step of the governor: motion, governor state, stop reason and heights.

    Attributes:
        stamp_ns: of the step [ns]; the motion is that of one period later.
        velocity, acceleration: (3,) of the container's origin in the world's axes [m/s, m/s²].
        position: (3,) since the start; of joints in the axes of the robot's root [m].
        share: of the command that is followed, 0 … 1.
        state, reason: what the governor does, and why.
        safe: whether the stop that is held keeps the limits for all models and unknown waves.
        peak: highest height in the next step and the stop after it, over all models and with the
            unknown wave, of the container that is nearest to its limits [m].
        margin: by how much that exceeds the nominal model's [m].
        limit: of this container's height [m].
        rest: time until the container rests, if it stops now [s].
        age: of the command in force, or of one that its stamp made refused [s]; NaN: there is
            none, or it has no stamp.
        steps, commands: how many so far; no steps before the first command.
        liquid_ns: stamp of the last observed state of the liquid that was taken [ns]; 0: none.
        worst: name of the container that is nearest to its limits; empty: it is the only one.
        friction, tipping: largest shares of friction and base that a loosely standing container
            uses in the next step and the stop; NaN: none stands loosely.
        joints: (3, J) velocities, accelerations and positions of the robot's joints, that are
            commanded or carry the container; empty: not known.
        wanted: (2, D) velocities and targets of the last command; NaN: not given.
        refused_by: joint that carries the container and its limit, as "elbow: velocity", for which
            no more of the command is followed; empty: none.
        joint_start: (J,) measured positions of the carrying joints, from which they go on with
            this step; empty: from where they were.
        unknown: height of the wave that may be there beside the models', part of `peak` [m].
        unknown_cause: why; empty: there is none.
        unknown_since_ns: from when on the liquid's first, unknown wave decays [ns]; 0: it was at
            rest when the governor began.
    """

    stamp_ns: int
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    position: tuple[float, ...]
    share: float
    state: GovernorState
    reason: StopReason
    safe: bool
    peak: float
    margin: float
    limit: float
    rest: float
    age: float
    steps: int
    commands: int
    liquid_ns: int
    worst: str = ""
    friction: float = float("nan")
    tipping: float = float("nan")
    joints: tuple[tuple[float, ...], ...] = ()
    wanted: tuple[tuple[float, ...], ...] = ()
    refused_by: str = ""
    joint_start: tuple[float, ...] = ()
    unknown: float = 0.0
    unknown_cause: str = ""
    unknown_since_ns: int = 0
