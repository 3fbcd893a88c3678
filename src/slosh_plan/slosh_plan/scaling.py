"""Finds the uniform time scales of a motion that keep the limits.

Which do is not monotone: a motion whose residual is limited may be safe, unsafe and safe again as
it slows down, as its spectrum's zeros pass the liquid's frequency. So the whole range is looked
at, and only the edges that are found are refined.

The slow end of the range needs no guess. The response of an undamped linear mode to an
acceleration is that to its changes, each of which the mode answers with at most twice its static
displacement: height ≤ 2 G V/ω², and G V/ω² after the motion, with the acceleration's total
variation V, which goes with 1/scale². Slower than where this meets the limits every scale is safe.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.interpolation import columns_at
from slosh_model.model import Model
from slosh_model.tilt import attitude_of, with_tilt
from slosh_plan.errors import SloshPlanError
from slosh_plan.heights import Extremes, all_extremes
from slosh_plan.limits import HeightLimits
from slosh_plan.prediction import check_start, checked_horizon
from slosh_plan.start import LiquidState
from slosh_plan.trajectory import LONGEST, PEAK_SPACING, Trajectory
from slosh_plan.tuning import TUNING
from slosh_plan.validity import greatest

Bools = NDArray[np.bool_]

COUNT = TUNING.scales


@dataclass(frozen=True, slots=True)
class SafeScales:
    """Factors by which a motion may be slowed so that the limits are kept.

    >>> import numpy as np
    >>> from slosh_model import read_model
    >>> from slosh_plan import HeightLimits, Trajectory, safe_scales
    >>> t = np.arange(1001) / 1000.0  # s
    >>> move = Trajectory(t, np.outer(np.sin(2.0 * np.pi * t), [3.0, 0.0, 0.0]))  # m/s²
    >>> found = safe_scales(read_model("cup/model.yaml"), move, HeightLimits(0.01))
    >>> [(round(a, 2), round(b, 2)) for a, b in found.intervals]
    [(1.14, 3.0)]

    Attributes:
        name: the motion's.
        duration: of the motion as given [s].
        intervals: (from, to) of all that are safe, rising; a scale of 2 takes twice as long.
        fastest, slowest: what was looked at; at the fastest the motion reaches the acceleration
            or jerk for which the model was validated. NaN: nothing.
        proven: whether a bound, and not the scan alone, says that all slower ones are safe.
    """

    name: str
    duration: float
    intervals: tuple[tuple[float, float], ...]
    fastest: float
    slowest: float
    proven: bool

    @property
    def safe_from(self) -> float:
        """Smallest time scale from which on all slower motions are safe; NaN if there is none."""
        if self.intervals and self.intervals[-1][1] == self.slowest:
            return self.intervals[-1][0]
        return math.nan

    @property
    def islands(self) -> tuple[tuple[float, float], ...]:
        """Safe intervals of time scales that an unsafe interval separates from slower scales."""
        end = len(self.intervals) - (not math.isnan(self.safe_from))
        return self.intervals[:end]


def safe_scales(
    model: Model,
    trajectory: Trajectory,
    limits: HeightLimits,
    *,
    state: LiquidState | None = None,
    horizon: float | None = None,
    margin: float = 0.0,
    count: int = COUNT,
    most: float = math.inf,
) -> SafeScales:
    """Finds the time scales with which a motion keeps the limits, by the nonlinear model.

    >>> import numpy as np
    >>> from slosh_model import read_model
    >>> from slosh_plan import HeightLimits, Trajectory, safe_scales
    >>> t = np.arange(1001) / 1000.0  # s
    >>> move = Trajectory(t, np.outer(np.sin(2.0 * np.pi * t), [3.0, 0.0, 0.0]))  # m/s²
    >>> found = safe_scales(read_model("cup/model.yaml"), move, HeightLimits(0.01))
    >>> found.proven
    True

    Args:
        model: the model.
        trajectory: the motion.
        limits: at least one of them; the container's rim is one, too.
        state: the liquid when the motion begins; None: at rest.
        horizon: how long the container is watched at rest after it [s]; None: three periods.
        margin: kept from the limits [m]; where it leaves nothing of one, no scale is safe.
        count: scales that are looked at, at geometric distances.
        most: samples that may be simulated, of all scales together.

    Raises:
        SloshPlanError: no limit, or one exceeded before the motion begins; more samples than that.
    """
    model = with_tilt(model, attitude_of(trajectory))
    asked, limits = limits, limits.under_rim(model)
    if not limits.given:
        raise SloshPlanError("no limit given: every time scale would be safe")
    check_start(model, state, asked)
    if min(limits.height, limits.residual) <= margin:
        return SafeScales(trajectory.name, trajectory.duration, (), math.nan, math.nan, False)
    kept = HeightLimits(limits.height - margin, limits.residual - margin)
    horizon = checked_horizon(model, horizon)
    nonlinear = model.nonlinear()
    bound = None if state is not None else _bound(nonlinear, trajectory, kept)
    fastest = fastest_scale(nonlinear, trajectory)
    slowest = slowest_scale(trajectory, fastest, bound)
    modal = state.nonlinear if state else None
    scan = _Scan(nonlinear, trajectory, kept, modal, horizon, Budget(most))
    scales = np.geomspace(fastest, slowest, max(count, 2))
    safe = scan.looked_at(scales)
    intervals = refined(scan.exact, scales, safe)
    proven = bool(bound and bound < slowest)
    return SafeScales(
        trajectory.name,
        trajectory.duration,
        intervals,
        float(scales[0]),
        float(scales[-1]),
        proven,
    )


@dataclass(slots=True, eq=False)
class Budget:
    """Maximum number of simulated samples, and how many were used."""

    most: float
    used: int = 0

    def take(self, samples: Array) -> None:
        """Counts simulated samples; raises SloshPlanError if they exceed the maximum."""
        self.used += int(samples.sum())
        if self.used > self.most:
            raise SloshPlanError(
                f"the time scales of the motion need {1e-6 * self.used:.3g} million samples or "
                f"more, above the bound of {1e-6 * self.most:.3g} million: leave the time scales "
                "out, shorten the motion or look at fewer scales"
            )


@dataclass(frozen=True, slots=True, eq=False)
class _Scan:
    """Motion, model and limits for the scan over time scales."""

    model: Model
    trajectory: Trajectory
    limits: HeightLimits
    modal: Array | None
    horizon: float
    budget: Budget

    def looked_at(self, scales: Array) -> Bools:
        """Returns a mask of safe time scales; simulates doubtful scales in full."""
        found = self._coarse(scales)
        safe = np.array([self._keeps(one) for one in found])
        doubtful = np.flatnonzero([self._doubtful(one) for one in found])
        if len(doubtful):
            safe[doubtful] = self.exact(scales[doubtful])
        return safe

    def exact(self, scales: Array) -> Bools:
        """Returns whether each time scale is safe, by a simulation of every sample."""
        found: list[Extremes] = []
        for batch in self._batches(scales, PEAK_SPACING, len(self.trajectory.t)):
            motions = [self.trajectory.scaled(float(scale)) for scale in batch]
            inputs = [one.inputs(self.horizon) for one in motions]
            ends = [float(one.t[-1]) for one in motions]
            found += all_extremes(self.model, inputs, ends, self.modal)
        return np.array([self._keeps(one) for one in found])

    def _coarse(self, scales: Array) -> list[Extremes]:
        averaged = Averaged(self.trajectory)
        # Of a container that turns all samples are taken.
        fewest = len(self.trajectory.t) if self.trajectory.turns else 0
        found: list[Extremes] = []
        for batch in self._batches(scales, TUNING.scan_step, fewest):
            inputs, ends = [], []
            for scale in batch:
                motion = averaged.scaled(float(scale), TUNING.scan_step)
                inputs.append(motion.inputs(self.horizon, TUNING.scan_step))
                ends.append(float(motion.t[-1]))
            found += all_extremes(
                self.model, inputs, ends, self.modal, max_step=2.0 * TUNING.scan_step
            )
        return found

    def _batches(self, scales: Array, spacing: float, fewest: int) -> list[Array]:
        """Divides the scales into batches of at most TUNING.batch samples.

        Args:
            scales: the scales.
            spacing: of the samples [s].
            fewest: samples of a motion that is run as fast as one likes.

        Raises:
            SloshPlanError: these would be more samples than may be simulated.
        """
        moving = np.maximum(self.trajectory.duration * scales / spacing, fewest)
        samples = moving + self.horizon / spacing
        self.budget.take(samples)
        parts = np.cumsum(samples) // TUNING.batch
        return np.split(scales, np.flatnonzero(np.diff(parts)) + 1)

    def _keeps(self, one: Extremes) -> bool:
        return one.peak <= self.limits.height and one.residual <= self.limits.residual

    def _doubtful(self, one: Extremes) -> bool:
        height, residual = self.limits.height, self.limits.residual
        if not math.isfinite(one.peak):
            return False
        near = abs(one.peak - height) < TUNING.doubt * height if math.isfinite(height) else False
        slack = TUNING.doubt * (residual + 0.25 * one.peak)
        return near or (math.isfinite(residual) and abs(one.residual - residual) < slack)


def refined(
    exact: Callable[[Array], Bools], scales: Array, safe: Bools
) -> tuple[tuple[float, float], ...]:
    """Returns the intervals of safe time scales, with interval ends refined by more tests."""
    edges = np.flatnonzero(safe[1:] != safe[:-1])
    low, high = scales[edges], scales[edges + 1]
    rising = safe[edges + 1]
    for _ in range(TUNING.scale_rounds if len(edges) else 0):
        share = np.arange(1, TUNING.scale_parts) / TUNING.scale_parts
        inner = low[:, np.newaxis] + (high - low)[:, np.newaxis] * share
        ok = exact(inner.ravel()).reshape(inner.shape)
        for edge in range(len(edges)):
            points = np.concatenate(([low[edge]], inner[edge], [high[edge]]))
            flags = np.concatenate(([not rising[edge]], ok[edge], [rising[edge]]))
            # The unsafe point next to the safe side.
            unsafe = np.flatnonzero(~flags)
            at = int(unsafe[-1]) if rising[edge] else int(unsafe[0]) - 1
            low[edge], high[edge] = points[at], points[at + 1]
    starts = [float(scales[0])] if safe[0] else []
    starts += [float(value) for value in high[rising]]
    ends = [float(value) for value in low[~rising]]
    ends += [float(scales[-1])] if safe[-1] else []
    return tuple(zip(starts, ends, strict=True))


def fastest_scale(model: Model, trajectory: Trajectory) -> float:
    """Returns the time scale at which the motion reaches the model's limits of validity."""
    acceleration, jerk = greatest(trajectory)
    reached = max(
        math.sqrt(acceleration / model.limits.acceleration), (jerk / model.limits.jerk) ** (1 / 3)
    )
    return float(max(reached, 0.01))


def slowest_scale(trajectory: Trajectory, fastest: float, bound: float | None) -> float:
    """Returns the largest time scale to scan, just above the bound proven safe if there is one.

    Args:
        trajectory: the motion.
        fastest: the scale at which the scan begins.
        bound: scale above which all are safe; None: none is known.
    """
    ceiling = max(min(TUNING.slowest, LONGEST / trajectory.duration), 1.01 * fastest)
    return min(max(1.05 * bound, 1.01 * fastest), ceiling) if bound else ceiling


def _bound(model: Model, trajectory: Trajectory, limits: HeightLimits) -> float | None:
    """Returns the time scale above which a linear bound proves safety; None if it cannot.

    It does not where gravity or the container's turning drives the liquid: those do not fade with
    1/scale².
    """
    if trajectory.turns or model.uses("drive"):
        return None
    modes = model.mode_constants()
    reach = []
    for axis in (X_AXIS, Y_AXIS):
        gains = model.height_gains(modes, axis)
        pairs = zip(gains, (mode.along(axis) for mode in modes), strict=True)
        moved = sum(abs(gain) / mode.natural_frequency**2 for gain, mode in pairs)
        # What follows at once follows the acceleration, which is at most half its variation.
        reach.append(moved + abs(model.static_height(modes, axis)))
    ends = np.zeros((1, 2))
    change = np.abs(np.diff(trajectory.acceleration[:, :2], axis=0, prepend=ends, append=ends))
    variation = change.sum(axis=0)
    if not model.container.cornered:
        variation = np.array([np.hypot(change[:, 0], change[:, 1]).sum(), 0.0])
    height = float(variation @ np.array(reach))
    return math.sqrt(max(2.0 * height / limits.height, height / limits.residual))


class Averaged:
    """A motion whose accelerations can be averaged to fewer samples.

    The averages keep what moves the liquid, the acceleration's integral, also of noise and jumps.

    Args:
        trajectory: the motion.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        t, acceleration = trajectory.t, trajectory.acceleration
        parts = 0.5 * (acceleration[1:] + acceleration[:-1]) * np.diff(t)[:, np.newaxis]
        self._speed = np.concatenate((np.zeros((1, 3)), np.cumsum(parts, axis=0)))
        self._made: dict[int, Trajectory] = {}

    def scaled(self, factor: float, spacing: float) -> Trajectory:
        """Returns the motion slowed by `factor`, with samples at most `spacing` apart [s].

        As it is where it has no more samples than that. Those between two powers of two are of one
        grid.
        """
        octave = 2.0 ** math.ceil(math.log2(factor))
        count = math.ceil(self._trajectory.duration * octave / spacing)
        if self._trajectory.turns or count >= len(self._trajectory.t) - 1:
            return self._trajectory.scaled(factor)
        if count not in self._made:
            self._made[count] = self._averaged(max(count, 2))
        return self._made[count].scaled(factor)

    def _averaged(self, count: int) -> Trajectory:
        t = self._trajectory.t
        moments = np.linspace(t[0], t[-1], count + 1)
        half = 0.5 * (moments[1] - moments[0])
        change = self._speed_at(moments + half) - self._speed_at(moments - half)
        return Trajectory(moments, change / (2.0 * half), name=self._trajectory.name)

    def _speed_at(self, moments: Array) -> Array:
        """Integrates linearly interpolated accelerations to speeds at given times."""
        t, acceleration = self._trajectory.t, self._trajectory.acceleration
        inside = np.clip(moments, t[0], t[-1])
        left = np.clip(np.searchsorted(t, inside, side="right") - 1, 0, len(t) - 2)
        rest = (inside - t[left])[:, np.newaxis]
        middle = 0.5 * (acceleration[left] + columns_at(inside, t, acceleration))
        return np.asarray(self._speed[left] + rest * middle)
