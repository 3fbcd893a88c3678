"""Tuning numbers of the governor."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class GovernorTuning:
    """Tuning constants of the governor's steps, stops and doubts.

    Checked by `validation/studies/governor.py`, `governed_loads.py` and `governor_streams.py`: no
    limit exceeded, and how much of the commands is followed.
    """

    # core/governor.py
    rate: float = number(100.0, "Hz", "steps a second, unless another rate is given")
    timeout: float = number(0.1, "s", "time for which a command holds")
    late: float = number(3.0, "period", "time between two steps that is late")
    missed: float = number(0.85, "period", "delay of a step for which one was left out")
    fastest: float = number(20.0, "m/s", "speed above which a command is an error")
    unlikely: float = number(2.0, "m/s", "speed above which a unit is doubted")
    phase: float = number(0.2, "rad", "phase of the fastest mode between two rows, ωh")
    tail: float = number(0.6, "period", "periods of the first mode after a stop")
    tilted_tail: float = number(1.1, "period", "the same where the container may tilt")
    modes_tail: float = number(2.0, "period", "the same for models with several modes")
    first: float = number(2.0, "period", "duration of the first stop, in its periods")
    least: float = number(
        16.0, "step", "duration of the shortest stop while a command is followed"
    )
    longest: float = number(1.2, "s", "longest stop")
    reserve: float = number(0.04, "1", "part by which heights are raised")
    spread: float = number(
        0.4, "1", "part of the difference of heights that is added for liquids between two"
    )
    ratio: float = number(1.06, "1", "ratio of two durations that are tried")
    early: float = number(0.5, "1", "step of the first bump of a stop")
    late_bump: float = number(1.0, "1", "step of the second one")
    enough: float = number(0.9, "1", "part of the limit below which stops are alike")
    haste: float = number(0.3, "1/s", "part of the limit that a second of a stop costs")
    past: int = number(256, "1", "steps that an observed state may be behind")
    # core/unknown.py and core/seen.py
    unknown: float = number(
        0.5, "1", "part of the limit that is left to an unknown wave; more of it is not safe"
    )
    grain: float = number(0.02, "1", "steps of an unknown wave, by the limit")
    still: float = number(1e-7, "m", "height below which an unknown wave is none")
    nudged: float = number(1e-3, "m", "way by which others have moved a container")
    memory: float = number(5.0, "period", "time over which an observer is proven")
    answered: float = number(
        2.0, "period", "time after which an observer has answered to a motion"
    )
    driven: float = number(0.1, "1", "driven wave that proves one, by the limit")
    unlike: float = number(0.35, "1", "part of it that may be missed")
    pull: float = number(4.0, "1/s", "speed towards a target by the distance")
    beyond: float = number(0.1, "rad", "joint target so far beyond its limits is taken as at them")
    slack: float = number(0.01, "1", "part of a joint's velocity limit that is left")
    moved: float = number(0.01, "rad", "joint that was moved so far by others begins anew")
    # core/inverse.py and core/carrier.py
    damping: float = number(1e-4, "m", "singular value at which joints hardly follow")
    stray: float = number(0.001, "m", "predicted joints miss the container by so much")
    unreached: float = number(0.01, "1", "part of a velocity that joints do not reach")
    carried: float = number(
        0.02, "1", "part of a carrying joint's velocity limit that is left between samples"
    )
    carried_change: float = number(0.05, "1", "the same of its acceleration and jerk limits")
    carried_place: float = number(1e-3, "rad", "the same of its range, at both ends")
    upright: float = number(0.02, "rad", "tilt up to which a container is upright")
    slowest: float = number(
        0.03, "m/s", "speed in each direction that joints allow where a container stops"
    )
    measured: float = number(
        1e-4, "rad", "measured joint that is so far from the computed one moved at rest"
    )
    unheard: float = number(
        0.5, "s", "time without joint states of a carrying robot that is a stop"
    )
    strayed: float = number(
        0.3, "rad", "distance of a moving robot's joint from the governor's that is a stop"
    )


TUNING = GovernorTuning()
