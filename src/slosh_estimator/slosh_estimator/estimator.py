"""Computes sloshing heights of the linear and the nonlinear model from input samples."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_estimator import estimate_kernel
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.estimate_kernel import (
    ANSWERS,
    CHECKS,
    FLAGS,
    JERK,
    LEFT_RANGE,
    MODAL,
    MOVING_CHECKS,
    READINGS,
    ROW,
    new_checks,
)
from slosh_estimator.self_test import check_model
from slosh_estimator.state import EstimatorState
from slosh_estimator.tuning import TUNING
from slosh_estimator.validity import EstimateFlag, settling_seconds, validity_limits
from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError
from slosh_model.indices import POSE_COUNT
from slosh_model.layout import back_to_rest, divided, moving_part, set_moving_part
from slosh_model.measure import reading_clock
from slosh_model.model import Model
from slosh_model.simulate import Simulator
from slosh_motion.inputs.sampling import Sample, Samples

_SETTLING = int(EstimateFlag.SETTLING)
_AFTER_GAP = int(EstimateFlag.AFTER_GAP)
_DIVERGED = int(EstimateFlag.DIVERGED)
_DOUBTFUL = int(EstimateFlag.INPUT_DOUBTFUL)
_TOO_SLOW = int(EstimateFlag.INPUT_TOO_SLOW)
_LONG_AGO = -(2**62)
_NO_CONTAINER = int(EstimateFlag.NO_CONTAINER)
_OF_THE_INPUT = int(
    EstimateFlag.INPUT_DOUBTFUL | EstimateFlag.INPUT_CONTESTED | EstimateFlag.INPUT_TOO_SLOW
)
_UPRIGHT = np.empty((0, POSE_COUNT))


class ModelState(NamedTuple):
    """State and heights of one sloshing model for one sample [m, rad, m/s].

    Attributes:
        msh, azimuth: maximum sloshing height and where it is.
        sh_x, sh_y: signed height at the container's +x and +y side.
        modal: x, y, vx, vy of each mode's mass, one mode after the other, in the sample's axes.
        reading: what a sensor reads of the msh; the msh where the model has no effect on the
            measurement.
    """

    msh: float
    azimuth: float
    sh_x: float
    sh_y: float
    modal: list[float]
    reading: float


class Estimate(NamedTuple):
    """Results of the linear and the nonlinear model for one sample.

    Attributes:
        sample: the input.
        linear, nonlinear: the answers.
        jerk: of the input, low-passed [m/s³].
        flags: bits of EstimateFlag.
    """

    sample: Sample
    linear: ModelState
    nonlinear: ModelState
    jerk: float
    flags: int


class Estimates(NamedTuple):
    """Results of the linear and the nonlinear model for N samples, as columns.

    Attributes:
        stamps: (N,) [ns].
        heights: (N, 2, 4) MSH [m], azimuth [rad], SH at +x and at +y [m] of L and of NL.
        modal: (N, 2, modes, 4) x, y, vx, vy of each mode [m, m/s].
        jerk: (N,) [m/s³].
        flags: (N,) bits of EstimateFlag.
        accelerations: (N, 3) the input [m/s²].
        yaws: (N,) the input [rad].
        readings: (N, 2) what a sensor reads of the MSH of L and of NL [m]; None: the MSH.
    """

    stamps: Integers
    heights: Array
    modal: Array
    jerk: Array
    flags: Integers
    accelerations: Array
    yaws: Array
    readings: Array | None = None

    @property
    def as_read(self) -> Array:
        """Heights (N, 2) [m] that a sensor would measure by linear and nonlinear model."""
        return self.heights[:, :, 0] if self.readings is None else self.readings


class Estimator:
    """Runs the linear and the nonlinear variant of a model in parallel.

    >>> from slosh_model import Model
    >>> estimator = Estimator(Model.from_cup(diameter=0.08, fill_height=0.06))
    >>> estimator.names
    ('3D-L', '3D-NL')
    >>> estimator.update(Sample(stamp_ns=0, ax=0.0, ay=0.0, az=0.0, restarted=True)).nonlinear.msh
    0.0

    The container counts as at rest, with still liquid, when the first sample comes, unless the
    input shows that it moved. Then, after a gap, and after a reset or another model in the middle
    of a motion, the liquid's state is unknown: the models restart from rest, and the estimates
    carry a flag until the unknown part has died out. What the container has lost of its liquid in
    a gap stays lost.

    Args:
        model: to run.
        at_rest: whether the liquid is still when the first sample comes.

    Attributes:
        model: that runs.
        divergences: how often a model left the physical range.
        empty: whether there is no container: the answers are NaN and carry NO_CONTAINER.
    """

    def __init__(self, model: Model, *, at_rest: bool = True) -> None:
        self.divergences = 0
        self.empty = False
        self._load(model)
        self._start(at_rest=at_rest)

    def load_model(self, model: Model, *, fresh: bool = False, empty: bool = False) -> None:
        """Replaces the model; the new one starts from rest with the next sample.

        Args:
            model: the new one.
            fresh: whether other liquid comes with it, which is still where the container does not
                accelerate, whatever the liquid before it did.
            empty: whether there is no container from now on.

        Raises:
            SloshModelError: the compiled code does not do what the model's equations say.
        """
        at_rest = self._is_unmoved() if fresh else self._is_still()
        self._load(model)
        self._start(at_rest=at_rest)
        self.empty = empty

    def _load(self, model: Model) -> None:
        check_model(model)
        max_step = estimate_kernel.MAX_STEP
        linear = Simulator(model.linear(), max_step=max_step)
        nonlinear = Simulator(model.nonlinear(), max_step=max_step)
        self.model, self._linear, self._nonlinear = model, linear, nonlinear
        self._reading_clock = reading_clock(model)
        self._checks = new_checks()
        checks = self._checks.view(CHECKS)
        for name, limit in validity_limits(model).items():
            checks[name] = limit
        checks["runaway"] = TUNING.runaway * max(model.container.reaches)
        checks["reads"] = float(bool(model.uses("reading")))
        self._modes = len(linear.modal)
        self._row = np.zeros(ROW + 2 * MODAL * self._modes)
        self._step_kernel = estimate_kernel.step.load()
        # Only what changes the input looks at the attitude.
        self._pose = np.zeros((1, POSE_COUNT)) if model.uses("drive") else None
        seconds = settling_seconds(model)
        self._settling_ns = round(seconds * 1e9) if seconds < math.inf else 2**62

    def reset(self) -> None:
        """Resets linear and nonlinear model to rest; the next sample counts as the first one.

        Where the liquid moves, or is not known to be still, it does not do so from now on because
        the model does: the estimates carry the flag SETTLING until it is known again.
        """
        self._start(at_rest=self._is_still())

    def _start(self, *, at_rest: bool) -> None:
        self._linear.reset()
        self._nonlinear.reset()
        self._last: Sample | None = None
        self._first_ns: int | None = None
        self._settled_ns = _LONG_AGO
        self._at_rest = at_rest

    def reading_delay(self, stamp_ns: int) -> float:
        """Returns the sensor delay [s] that the model predicts for a measurement's stamp [ns].

        A clock that drifts does so from the first sample on, and anew after a reset.
        """
        since = 0 if self._first_ns is None else max(stamp_ns - self._first_ns, 0)
        return self._reading_clock.delay(since / 1e9)

    def reading_delays(self, stamps: Integers) -> Array:
        """Returns the sensor delays (N,) [s] that the model predicts for stamps (N,) [ns]."""
        first = stamps if self._first_ns is None else self._first_ns
        return self._reading_clock.delay(np.maximum(stamps - first, 0) / 1e9)

    def state(self) -> EstimatorState | None:
        """Returns the complete state of both models, or None before the first sample."""
        if self._last is None or self._first_ns is None:
            return None
        return EstimatorState(
            self._last, self._first_ns, self._settled_ns, moving_part(self._linear.store),
            moving_part(self._nonlinear.store), self._checks[MOVING_CHECKS:].copy(),
        )  # fmt: skip

    def take_up(self, state: EstimatorState) -> None:
        """Restores a complete state that `state` of an estimator with the same model returned.

        Raises:
            SloshEstimatorError: the state is one of another model or version; nothing changes.
        """
        checks = self._checks[MOVING_CHECKS:]
        if len(state.checks) != len(checks):
            raise SloshEstimatorError(
                f"saved state with {len(state.checks)} check values, must have {len(checks)}"
            )
        before = moving_part(self._linear.store)
        try:
            set_moving_part(self._linear.store, state.linear)
            set_moving_part(self._nonlinear.store, state.nonlinear)
        except SloshModelError as error:
            set_moving_part(self._linear.store, before)
            raise SloshEstimatorError(str(error)) from None
        checks[:] = state.checks
        self._last, self._first_ns = state.sample, state.first_ns
        self._settled_ns = state.settled_ns

    def _is_unmoved(self) -> bool:
        """Returns whether the container's acceleration is too small to raise a visible wave."""
        last = self._last
        if last is None:
            return self._at_rest
        reach = max(self.model.container.reaches)
        return math.hypot(last.ax, last.ay) * reach / GRAVITY < TUNING.still

    def _is_still(self) -> bool:
        """Returns whether the liquid is known to be practically at rest."""
        last = self._last
        if last is None:
            return self._at_rest
        if last.stamp_ns < self._settled_ns:
            return False
        models = (self._linear, self._nonlinear)
        resting = [model.store.copy() for model in models]
        for store in resting:
            back_to_rest(store)
        self._step_kernel(
            *resting, self._checks.copy(), self._row.copy(), self._poses(last), 0.0,
            last.ax, last.ay, last.az, last.yaw, True,
        )  # fmt: skip
        return all(
            _distance(divided(model.store)[1], divided(rest)[1]) < TUNING.still
            for model, rest in zip(models, resting, strict=True)
        )

    @property
    def names(self) -> tuple[str, str]:
        """Names of the linear and the nonlinear model, such as ('3D-L', '3D-NL')."""
        return self._linear.model.name, self._nonlinear.model.name

    def update(self, sample: Sample) -> Estimate:
        """Processes one sample and returns the results of the linear and the nonlinear model."""
        flags = self._take(sample)
        if self.empty:
            flags = flags & _OF_THE_INPUT | _NO_CONTAINER
            self._row[:JERK] = self._row[READINGS:] = math.nan
        row: list[float] = self._row.tolist()
        middle = ROW + MODAL * self._modes
        msh, azimuth, sh_x, sh_y = row[:ANSWERS]
        linear = ModelState(msh, azimuth, sh_x, sh_y, row[ROW:middle], row[READINGS])
        msh, azimuth, sh_x, sh_y = row[ANSWERS:JERK]
        nonlinear = ModelState(msh, azimuth, sh_x, sh_y, row[middle:], row[READINGS + 1])
        return Estimate(sample, linear, nonlinear, row[JERK], flags)

    def update_many(self, samples: Samples) -> Estimates:
        """Processes N samples at once; gives the same results as `update`, but much faster."""
        count = len(samples.stamps)
        batch = _Batch(np.empty((count, len(self._row))), np.zeros(count, dtype=np.int64))
        apart = samples.restarted
        if samples.moving is not None:
            apart = apart | samples.moving
        breaks = np.flatnonzero(apart).tolist()
        at = 0
        while at < count:
            if self._last is None or apart[at]:
                self._note(batch, at, self._take(samples.one(at)))
                at += 1
            else:
                following = bisect_right(breaks, at)
                end = breaks[following] if following < len(breaks) else count
                at = self._take_unbroken(batch, samples, at, end)
        if self.empty:
            batch.flags[:] = batch.flags & _OF_THE_INPUT | _NO_CONTAINER
            batch.rows[:, :JERK] = batch.rows[:, READINGS:] = math.nan
        heights = batch.rows[:, :JERK].reshape(-1, 2, ANSWERS)
        modal = batch.rows[:, ROW:].reshape(count, 2, self._modes, MODAL)
        return Estimates(
            samples.stamps, heights, modal, batch.rows[:, JERK], batch.flags,
            samples.accelerations, samples.yaws, batch.rows[:, READINGS:ROW],
        )  # fmt: skip

    def _take(self, sample: Sample) -> int:
        """Advances the models by a sample, stores their results, returns the validity flags."""
        flags = 0
        last = self._last
        if sample.restarted and last is not None:
            flags = _AFTER_GAP
            self._restart(sample.stamp_ns)
            last = None
        elif sample.moving or (last is None and not self._at_rest):
            self._settled_ns = sample.stamp_ns + self._settling_ns
        self._last = sample
        if self._first_ns is None or sample.stamp_ns < self._first_ns:
            self._first_ns = sample.stamp_ns
        # A quotient, not a product with 1e-9: correctly rounded, thus the same bits offline.
        dt = 0.0 if last is None else (sample.stamp_ns - last.stamp_ns) / 1e9
        self._step(dt, sample, last is None)
        if self._row.item(FLAGS) == LEFT_RANGE:
            flags |= self._diverged(sample)
        return flags | self._limits(sample)

    def _take_unbroken(self, batch: _Batch, samples: Samples, start: int, end: int) -> int:
        """Processes consecutive samples without gaps; returns the index of the next sample."""
        part = slice(start, end)
        stamps = samples.stamps[part]
        last = stamps[0] if self._last is None else self._last.stamp_ns
        count: int = estimate_kernel.steps(
            self._linear.store,
            self._nonlinear.store,
            self._checks,
            batch.rows[part],
            _UPRIGHT if self._pose is None or samples.poses is None else samples.poses[part],
            (stamps - np.concatenate(([last], stamps[:-1]))) / 1e9,
            samples.accelerations[part],
            samples.yaws[part],
        )
        done = slice(start, start + count)
        batch.flags[done] = batch.rows[done, FLAGS].astype(np.int64)
        batch.flags[done][samples.stamps[done] < self._settled_ns] |= _SETTLING
        if samples.doubtful is not None:
            batch.flags[done][samples.doubtful[done]] |= _DOUBTFUL
        if samples.slow is not None:
            batch.flags[done][samples.slow[done]] |= _TOO_SLOW
        at = start + count
        self._last = samples.one(min(at, end - 1))
        if at < end:  # a model left the physical range with this sample
            flags = self._diverged(self._last)
            self._note(batch, at, flags | self._limits(self._last))
            at += 1
        return at

    def _note(self, batch: _Batch, index: int, flags: int) -> None:
        batch.rows[index], batch.flags[index] = self._row, flags

    def _step(self, dt: float, sample: Sample, first: bool) -> None:
        self._step_kernel(
            self._linear.store, self._nonlinear.store, self._checks, self._row,
            self._poses(sample), dt, sample.ax, sample.ay, sample.az, sample.yaw, first,
        )  # fmt: skip

    def _poses(self, sample: Sample) -> Array:
        if self._pose is None or sample.pose is None:
            return _UPRIGHT
        self._pose[0] = sample.pose
        return self._pose

    def _diverged(self, sample: Sample) -> int:
        """Restarts the models from rest after they diverged; returns the flag of a divergence."""
        self.divergences += 1
        self._restart(sample.stamp_ns)
        self._step(0.0, sample, True)
        if self._row[FLAGS] == LEFT_RANGE:  # with this input it rests out of the range, too
            self._row[:] = math.nan
            self._row[FLAGS] = 0.0
        return _DIVERGED

    def _limits(self, sample: Sample) -> int:
        """Returns the flags that limit the validity of the results."""
        flags = int(self._row.item(FLAGS))
        if sample.stamp_ns < self._settled_ns:
            flags |= _SETTLING
        if sample.slow:
            flags |= _TOO_SLOW
        return flags | _DOUBTFUL if sample.doubtful else flags

    def _restart(self, stamp_ns: int) -> None:
        self._linear.reset()
        self._nonlinear.reset()
        since = stamp_ns if self._first_ns is None else self._first_ns
        for model in (self._linear, self._nonlinear):
            divided(model.store)[0]["elapsed"] = max(stamp_ns - since, 0) / 1e9
        self._settled_ns = stamp_ns + self._settling_ns


def _distance(modes: NDArray[np.void], others: NDArray[np.void]) -> float:
    """Returns the greatest wave height [m] by which two modal states of the liquid may differ."""
    places = np.hypot(modes["x"] - others["x"], modes["y"] - others["y"])
    speeds = np.hypot(modes["vx"] - others["vx"], modes["vy"] - others["vy"])
    slower = modes["natural_frequency"] * np.minimum(modes["frequency_ratio"], 1.0)
    gains = np.maximum(modes["height_gain"], modes["height_gain_y"])
    return float((gains * np.hypot(places, speeds / slower)).sum())


class _Batch(NamedTuple):
    """Arrays for the N results that `Estimator.update_many` computes."""

    rows: Array
    flags: Integers
