"""Prepares measured motions for an identification: every sample at its own time.

Motions with equal inputs are repetitions of one operating point; they are simulated once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.clock import first_offset
from slosh_discovery.discover.colour import Neighbours, neighbours_in
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.noise import estimate_noise
from slosh_discovery.discover.problem import MOST_AZIMUTHS, PreparedMotion
from slosh_discovery.discover.tuning import TUNING as DISCOVER
from slosh_discovery.discover_data.heights import sample_noise
from slosh_discovery.identify.tuning import TUNING
from slosh_model.interpolation import columns_at
from slosh_model.model import Model
from slosh_model.simulate import Inputs

ALIKE = 1e-9
"""Inputs that differ by less are the same motion."""
SPEED_DIGITS = 3
"""A motion's ends are told to a thousandth of its length."""


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A measured motion, prepared for an identification.

    Attributes:
        prepared: how it is compared with models.
        point: number of its operating point.
        clock_offset: measured minus inputs' clock, to start from [s].
        free: whether it is a free decay: its state at the first sample is fitted, too.
        neighbours: of each kept height.
    """

    prepared: PreparedMotion
    point: int
    clock_offset: float
    free: bool
    neighbours: Neighbours

    @property
    def name(self) -> str:
        """Name of the motion."""
        return self.prepared.motion.name

    @property
    def count(self) -> int:
        """Number of measured heights."""
        return len(self.neighbours.before)


@dataclass(frozen=True, slots=True)
class OperatingPoint:
    """An operating point: motions with the same inputs.

    Attributes:
        label: for people; the speed, or the first motion's name.
        speed: n [1/min]; NaN: it has none.
        motions: names.
    """

    label: str
    speed: float
    motions: tuple[str, ...]


def make_trials(
    motions: Sequence[MeasuredMotion], model: Model, ratio: float
) -> tuple[tuple[Trial, ...], tuple[OperatingPoint, ...]]:
    """Prepares measured motions for the fit, and groups them by operating point.

    Args:
        motions: the data.
        model: with which unknown clocks are laid over each other.
        ratio: b, the share of a cycle in which the container moves; for the speeds' names.
    """
    kinds: list[Inputs] = []
    firsts: list[Inputs] = []
    merged: dict[tuple[int, bytes], tuple[Inputs, Inputs]] = {}
    trials: list[Trial] = []
    for motion in motions:
        kind = _place(motion.inputs, kinds, _same)
        kinds += [motion.inputs] if kind == len(kinds) else []
        point = _place(motion.inputs, firsts, _repeated)
        firsts += [motion.inputs] if point == len(firsts) else []
        key = (kind, motion.t.tobytes() if motion.same_clock else b"")
        if key not in merged:
            merged[key] = _with_samples(kinds[kind], motion), _fine(kinds[kind])
        trials.append(_trial(motion, *merged[key], point, model))
    points = []
    for number, inputs in enumerate(firsts):
        group = [trial.name for trial in trials if trial.point == number]
        speed = operating_speed(inputs, ratio)
        label = group[0] if np.isnan(speed) else f"{speed:.4g} 1/min"
        points.append(OperatingPoint(label, speed, tuple(group)))
    return tuple(trials), _distinct(points)


def operating_speed(inputs: Inputs, ratio: float) -> float:
    """Returns the speed [1/min] of a machine's rise and dwell; NaN for other motions.

    A stroke is a machine's where its record ends with the cycle, or the next stroke follows then.
    One after which the liquid is watched for long is a motion of its own, such as a free decay.

    Of several cycles the first rise counts. The samples leave its length open by two of their
    intervals: where a whole number lies within, it is that, as machines are set by whole numbers.
    """
    moving = _rise_rows(inputs)
    if moving is None or not _is_stroke(inputs, *moving):
        return float("nan")
    start, end = rise_span(inputs)
    if not _is_cyclic(inputs, start, end, (end - start) / ratio):
        return float("nan")
    slowest = 60.0 * ratio / (end - start)
    fastest = 60.0 * ratio / float(inputs.t[moving[1]] - inputs.t[moving[0]])
    whole = round(0.5 * (slowest + fastest))
    if slowest - ALIKE <= whole <= fastest + ALIKE:
        return float(whole)
    return float(f"{0.5 * (slowest + fastest):.{SPEED_DIGITS}g}")


def _is_cyclic(inputs: Inputs, start: float, end: float, cycle: float) -> bool:
    """Returns whether a dwell follows the first rise and completes a machine cycle."""
    if inputs.t[-1] - end < TUNING.dwell_share * (start + cycle - end):
        return False
    if inputs.t[-1] - start <= TUNING.cycles * cycle:
        return True
    later = inputs.t >= start + (1.0 - TUNING.cycle_share) * cycle
    following = Inputs(inputs.t[later], inputs.acceleration[later])
    rows = _rise_rows(following)
    return rows is not None and bool(
        abs(following.t[rows[0]] - start - cycle) <= TUNING.cycle_share * cycle
    )


def rise_span(inputs: Inputs) -> tuple[float, float]:
    """Returns start and end of the container's motion in its first cycle [s].

    Unlike a live monitor, which bears a sensor's noise, it knows slow motions, too. One that never
    moves starts and ends at the inputs' end.
    """
    moving = _rise_rows(inputs)
    if moving is None:
        return float(inputs.t[-1]), float(inputs.t[-1])
    first, last = max(moving[0] - 1, 0), min(moving[1] + 1, len(inputs.t) - 1)
    return float(inputs.t[first]), float(inputs.t[last])


def _is_stroke(inputs: Inputs, first: int, last: int) -> bool:
    """Returns whether a motion goes along one line to another position and stops there."""
    rows = slice(max(first - 1, 0), last + 2)
    t, acceleration = inputs.t[rows], inputs.acceleration[rows]
    _, sizes, directions = np.linalg.svd(acceleration, full_matrices=False)
    if len(sizes) > 1 and sizes[1] > TUNING.across * sizes[0]:
        return False
    velocity = _integrated(acceleration @ directions[0], t)
    place = _integrated(velocity, t)
    return bool(
        abs(place[-1]) > (1.0 - TUNING.stopped) * np.abs(place).max()
        and abs(velocity[-1]) < TUNING.stopped * np.abs(velocity).max()
    )


def _integrated(rates: Array, t: Array) -> Array:
    """Returns the integral (N,) of a time series from its first sample on (trapezoidal rule)."""
    steps = 0.5 * (rates[1:] + rates[:-1]) * np.diff(t)
    return np.concatenate([np.zeros(1), np.cumsum(steps)])


def _rise_rows(inputs: Inputs) -> tuple[int, int] | None:
    """Returns the first and last sample of the first rise, or None if the container rests."""
    size = np.linalg.norm(inputs.acceleration, axis=1)
    peak = float(size.max(initial=0.0))
    moving = np.flatnonzero(size > max(TUNING.rest * peak, TUNING.clear * sample_noise(size)))
    if peak < TUNING.moves or len(moving) < 2:
        return None
    t = inputs.t[moving]
    # In the middle of its rise a law passes through zero, too, but that is soon over.
    shortest = max(
        TUNING.pause_samples * float(np.median(np.diff(inputs.t))), TUNING.pause * (t[-1] - t[0])
    )
    pauses = np.flatnonzero(np.diff(t) > shortest)
    return int(moving[0]), int(moving[pauses[0] if len(pauses) else -1])


def _distinct(points: Sequence[OperatingPoint]) -> tuple[OperatingPoint, ...]:
    """Returns the operating points; replaces equal labels by the first motion's name."""
    labels = [point.label for point in points]
    return tuple(
        OperatingPoint(
            point.label if labels.count(point.label) == 1 else point.motions[0],
            point.speed,
            point.motions,
        )
        for point in points
    )


def _place(
    inputs: Inputs, known: Sequence[Inputs], alike: Callable[[Inputs, Inputs], bool]
) -> int:
    """Returns the index of an equal input in `known`, or its length if no input is equal."""
    found = (number for number, other in enumerate(known) if alike(inputs, other))
    return next(found, len(known))


def _same(first: Inputs, second: Inputs) -> bool:
    return (
        len(first.t) == len(second.t)
        and first.poses.shape == second.poses.shape
        and np.allclose(first.t, second.t, rtol=0.0, atol=ALIKE)
        and np.allclose(first.acceleration, second.acceleration, rtol=0.0, atol=ALIKE)
        and np.allclose(first.poses, second.poses, rtol=0.0, atol=ALIKE)
    )


def _repeated(first: Inputs, second: Inputs) -> bool:
    """Returns whether two inputs are the same motion except for noise and start time."""
    if (len(first.poses) > 0) != (len(second.poses) > 0):
        return False
    size = max(float(np.sum(one.acceleration**2)) for one in (first, second))
    if size == 0.0:
        return True
    shift = _centre(second) - _centre(first)
    other = columns_at(first.t + shift, second.t, second.acceleration)
    apart = float(np.sum((first.acceleration - other) ** 2))
    noise = len(first.t) * sum(
        sample_noise(column) ** 2 for one in (first, second) for column in one.acceleration.T
    )
    return apart - noise < TUNING.repeated**2 * size


def _centre(inputs: Inputs) -> float:
    """Returns the centroid [s] of the squared acceleration over time."""
    power = np.sum(inputs.acceleration**2, axis=1)
    total = float(np.sum(power))
    return float(np.sum(power * inputs.t)) / total if total > 0.0 else float(inputs.t[0])


def _with_samples(inputs: Inputs, motion: MeasuredMotion) -> Inputs:
    """Returns the inputs with additional samples at the times of the measured heights."""
    if not motion.same_clock:
        return inputs
    t = np.union1d(inputs.t, motion.t[motion.t >= inputs.t[0]])
    return inputs if len(t) == len(inputs.t) else inputs.resampled(t)


def _fine(inputs: Inputs) -> Inputs:
    """Returns the inputs on a fine time grid, so that heights can be interpolated."""
    count = int(np.ceil((inputs.t[-1] - inputs.t[0]) / DISCOVER.fine_spacing))
    grid = np.linspace(inputs.t[0], inputs.t[-1], max(count, 1) + 1)
    dense = len(inputs.t) > count
    return inputs.resampled(inputs.t if dense else np.union1d(inputs.t, grid))


def _trial(
    motion: MeasuredMotion, inputs: Inputs, fine: Inputs, point: int, model: Model
) -> Trial:
    prepared = _prepared(motion, inputs, fine)
    neighbours = neighbours_in(prepared.t, prepared.kept)
    moving = (
        float(np.linalg.norm(motion.inputs.acceleration, axis=1).max(initial=0.0)) > TUNING.moves
    )
    turning = len(motion.inputs.poses) > 0
    offset = 0.0 if motion.same_clock else first_offset(prepared, model)
    return Trial(prepared, point, offset, not moving and not turning, neighbours)


def _prepared(motion: MeasuredMotion, inputs: Inputs, fine: Inputs) -> PreparedMotion:
    heights, azimuths = motion.heights, motion.eta_azimuth if motion.eta is not None else None
    if azimuths is not None and len(azimuths) > MOST_AZIMUTHS:
        columns = np.linspace(0, len(azimuths), MOST_AZIMUTHS, endpoint=False).astype(np.int64)
        azimuths, heights = azimuths[columns], heights[:, columns]
    used = np.isfinite(heights).any(axis=1)
    t, heights = motion.t[used], heights[used]
    rows = np.searchsorted(inputs.t, np.maximum(t, inputs.t[0])).clip(max=len(inputs.t) - 1)
    return PreparedMotion(
        motion=motion,
        noise=estimate_noise(motion).stddev,
        t=t,
        azimuths=azimuths,
        heights=heights,
        kept=np.isfinite(heights),
        coarse=inputs,
        rows=rows,
        fine=fine,
    )


def neighbours_of(trials: Sequence[Trial]) -> Neighbours:
    """Returns the preceding samples for the concatenated residuals of several trials."""
    starts = np.cumsum([0, *(trial.count for trial in trials)])
    frame_starts = np.cumsum([0, *(len(trial.prepared.t) for trial in trials)])
    own = [trial.neighbours for trial in trials]
    before = [
        np.where(one.before >= 0, one.before + start, -1)
        for one, start in zip(own, starts.tolist(), strict=False)
    ]
    frames = [one.frames + start for one, start in zip(own, frame_starts.tolist(), strict=False)]
    lags = [one.lags for one in own]
    return Neighbours(np.concatenate(before), np.concatenate(lags), np.concatenate(frames))
