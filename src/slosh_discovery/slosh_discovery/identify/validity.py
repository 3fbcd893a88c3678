"""Finds the speed up to which the surface is a straight line; limits a model's validity to it.

A model of the surface's slope holds while the surface is a line (TM20, §2.3). How far it is from
one is measured on profiles, speed by speed. A live estimator knows of no operating speed: what it
sees is an acceleration and a jerk. So the limits that are written are the greatest of both in the
fastest motion in which the surface still was a line, and beyond them its estimates are flagged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.identify.trials import operating_speed, rise_span
from slosh_estimator.estimator import Estimator
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs
from slosh_motion.inputs.sampling import Samples
from slosh_motion.signals.metrics import line_approximation_error

TOLERANCE = 0.0005
"""TM20's tolerable ε̄ [m]."""
_ANY = Model(Cylinder(0.05, 0.07))
"""Some model: what an estimator reads of a motion does not depend on it."""
NAN = float("nan")


@dataclass(frozen=True, slots=True)
class LineError:
    """Deviation of the surface from a straight line at one operating speed.

    Attributes:
        speed: n [1/min].
        repetitions: K, number of motions.
        mean: of their ε̄ [m] (TM20, eq. (14)).
        stddev: of their ε̄ [m] (15); NaN of a single one.
        acceleration, jerk: the greatest of the motions, as an estimator reads them [m/s², m/s³].
    """

    speed: float
    repetitions: int
    mean: float
    stddev: float
    acceleration: float
    jerk: float


@dataclass(frozen=True, slots=True)
class LineLimit:
    """Range of operating speeds in which the surface is a straight line.

    Attributes:
        tolerance: the greatest ε̄ of a line [m].
        errors: by rising speed.
        speed: n_max, the fastest up to which all means keep to the tolerance [1/min]; NaN: even
            the slowest does not.
        exceeded: whether a faster speed was measured; otherwise n_max is only what was tried.
    """

    tolerance: float
    errors: tuple[LineError, ...]
    speed: float
    exceeded: bool


def line_limit(
    motions: Sequence[MeasuredMotion], ratio: float, tolerance: float = TOLERANCE
) -> LineLimit | None:
    """Finds the speeds at which the surface is a straight line; None without surface profiles.

    Args:
        motions: those with a profile and an operating speed count.
        ratio: b, the share of a cycle in which the container moves.
        tolerance: the greatest ε̄ of a line [m].

    Returns:
        None: no motion has a profile and a speed.
    """
    groups: dict[float, list[MeasuredMotion]] = {}
    for motion in motions:
        speed = operating_speed(motion.inputs, ratio)
        if motion.profile is not None and math.isfinite(speed):
            groups.setdefault(speed, []).append(motion)
    found = [error_at(speed, groups[speed]) for speed in sorted(groups)]
    errors = tuple(error for error in found if error is not None)
    if not errors:
        return None
    kept = count_within([error.mean for error in errors], tolerance)
    speed = errors[kept - 1].speed if kept else NAN
    return LineLimit(tolerance, errors, speed, kept < len(errors))


def count_within(errors: Sequence[float], tolerance: float) -> int:
    """Returns how many speeds, from the slowest on, have an error within the tolerance."""
    return next(
        (place for place, error in enumerate(errors) if not error <= tolerance), len(errors)
    )


def error_at(speed: float, motions: Sequence[MeasuredMotion]) -> LineError | None:
    """Returns the surface's deviation from a line [m] at a speed (TM20, §2.3); None if unknown."""
    found = []
    for motion in motions:
        start, end = rise_span(motion.inputs)
        moving = (motion.t >= start) & (motion.t <= end)
        if moving.any() and motion.profile is not None and motion.profile_x is not None:
            found.append(line_approximation_error(motion.profile_x, motion.profile[moving]))
    if not found:
        return None
    seen = [seen_by_estimator(motion.inputs) for motion in motions]
    return LineError(
        speed,
        len(found),
        float(np.mean(found)),
        float(np.std(found, ddof=1)) if len(found) > 1 else NAN,
        max(acceleration for acceleration, _ in seen),
        max(jerk for _, jerk in seen),
    )


def seen_by_estimator(inputs: Inputs) -> tuple[float, float]:
    """Returns the greatest acceleration [m/s²] and jerk [m/s³] as the estimator computes them."""
    count = len(inputs.t)
    stamps = np.round((inputs.t - inputs.t[0]) * SECOND).astype(np.int64)
    samples = Samples(
        stamps, inputs.acceleration, np.zeros(count), np.zeros(count, dtype=np.bool_)
    )
    estimates = Estimator(_ANY).update_many(samples)
    size = np.linalg.norm(inputs.acceleration, axis=1)
    return float(size.max()), float(np.max(estimates.jerk))


def limited(model: Model, limit: LineLimit | None) -> Model:
    """Adds limits of validity to a model if the surface was not straight in faster motions."""
    if limit is None or not limit.exceeded or not math.isfinite(limit.speed):
        return model
    last = next(error for error in limit.errors if error.speed == limit.speed)
    limits = replace(model.limits, planar_acceleration=last.acceleration, planar_jerk=last.jerk)
    return replace(model, limits=limits)
