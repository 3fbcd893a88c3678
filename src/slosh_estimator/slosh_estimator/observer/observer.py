"""Observer: a model whose state is corrected by measured heights.

See `observer_kernel` for the equations. The open-loop estimate stays as it is, so that its
comparison with the camera still shows a fault.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

import numpy as np

from slosh_base.types import Array
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.estimate_kernel import MAX_STEP
from slosh_estimator.observer import layout
from slosh_estimator.observer import observer_kernel as kernel
from slosh_estimator.observer import (
    self_test as self_test,
)  # its checks belong to the compiled functions
from slosh_estimator.observer.envelope_bounds import Envelope, EnvelopeBounds
from slosh_estimator.observer.states import FusedState, ObserverState, Outcome, WallHeights
from slosh_estimator.tuning import TUNING
from slosh_estimator.validity import EstimateFlag
from slosh_model.indices import POSE_COUNT
from slosh_model.layout import back_to_rest, divided
from slosh_model.model import Model
from slosh_model.simulate import store_of
from slosh_motion.inputs.sampling import Sample
from slosh_motion.signals.motion_spans import MotionFinder

_RESTARTS = int(EstimateFlag.AFTER_GAP | EstimateFlag.DIVERGED)
_SETTLING = int(EstimateFlag.SETTLING)
_LONG_AGO = -(2**62)
_NO_POINTS = np.empty((0, 3))
_UPRIGHT = np.empty((0, POSE_COUNT))
_MODEL_ERRORS = np.array(
    [-TUNING.calm_frequency, TUNING.calm_frequency,
     -math.log(TUNING.calm_damping), math.log(TUNING.calm_damping)]
)  # fmt: skip
"""Errors of a model that calm allows for, in the order of `layout`."""


class Observer:
    """Runs a nonlinear model and corrects its state by measured heights.

    Measurements wait for the next state that is given, at most each TUNING.fused_ns, and for an
    input that is not older than they are. One whose normalised innovation is too large is
    rejected. After some such in succession that show a wave the liquid's state counts as unknown,
    so that a push by hand is taken up.

    Args:
        model: container, liquid and effects.
        holds: whether sensors wait for images, which come later; a replay is given them in time.

    Attributes:
        counts: of measurements, by outcome.
        sensed: how many of them force or level sensors measured beside the camera.
        reaches: distance from the axis to the wall along x and y [m].
        innovation: normalised innovation of the last measurement over its limit.
    """

    def __init__(self, model: Model, *, holds: bool = True) -> None:
        self._holds = holds
        self.counts = dict.fromkeys(Outcome, 0)
        self.innovation = math.nan
        container = model.container
        self._cornered, self.reaches = container.cornered, container.reaches
        self._reaches = np.array(container.reaches)
        self._largest = TUNING.unknown_wave * max(container.reaches)
        self._bound = TUNING.runaway * max(container.reaches)
        self._store = store_of(model.nonlinear(), MAX_STEP)
        self._constants = divided(self._store)[1].copy()
        modes = len(self._constants)
        self._pose = np.zeros((1, POSE_COUNT)) if model.uses("drive") else None
        self._blocks = np.zeros((2 * modes, layout.BLOCK))
        self._theta = np.zeros(layout.PARAMETERS)
        self._averages = np.zeros(layout.AVERAGES)
        self._bounds, self._shown = EnvelopeBounds(), ShownWave()
        self._motions = MotionFinder()
        self._moved_ns: int | None = None
        self._noise = _noise()
        self._ring = np.zeros((TUNING.kept_inputs, layout.MODES + 4 * modes))
        self._out = np.zeros(layout.STATE + 4 * modes)
        self._covariance = np.zeros((4 * modes + layout.PARAMETERS,) * 2)
        self._slow_variance = np.square(
            [TUNING.frequency_spread, TUNING.damping_spread, TUNING.level_spread,
             TUNING.clock_spread]
        )  # fmt: skip
        self._begin, self._read = kernel.begin.load(), kernel.read.load()
        self._follow, self._correct = kernel.follow.load(), kernel.correct.load()
        self._cameras: deque[WallHeights] = deque()
        self._sensors: deque[WallHeights] = deque()
        self._epoch_ns: int | None = None
        self._given_ns = _LONG_AGO
        self._newest_ns = _LONG_AGO
        self._corrected_ns: int | None = None
        self._judged_ns: int | None = None
        self.sensed = 0
        self._sensed_ns: int | None = None
        # Inputs since the restart; the one before the anchor; rejected measurements in succession.
        self._count = self._first = self._rejected = 0
        self._anchored_at = 0.0

    @property
    def newest_ns(self) -> int:
        """Stamp of the last input [ns]; long ago: there was none."""
        return self._newest_ns

    @property
    def taken(self) -> int:
        """Number of measurements that were processed, whether they were used or rejected."""
        return sum(self.counts.values())

    def take(self, heights: WallHeights, *, sensed: bool = False) -> None:
        """Queues a measurement; measurements with earlier stamps are used first.

        Args:
            heights: to queue.
            sensed: whether a force or level sensor beside the camera measured them.
        """
        queue = self._sensors if sensed else self._cameras
        queue.append(heights)
        if len(queue) > TUNING.waiting_heights:
            self._take_next(sensed=sensed)
            self._note(Outcome.LATE)

    def follow(self, sample: Sample, flags: int = 0) -> FusedState | None:
        """Advances the model by one input and returns the fused state, or None if not due.

        Args:
            sample: the input.
            flags: of the estimate that belongs to it: bits of EstimateFlag.

        Returns:
            the fused state at its moment; None: none is due.
        """
        stamp_ns = sample.stamp_ns
        if self._epoch_ns is None or stamp_ns < self._epoch_ns:
            self._epoch_ns = stamp_ns
        if stamp_ns < self._newest_ns:  # time was set back: older motions lie ahead
            self._motions, self._moved_ns = MotionFinder(), None
        now = (stamp_ns - self._epoch_ns) / 1e9
        restarts = sample.restarted or sample.moving or bool(flags & _RESTARTS)
        restarts |= stamp_ns <= self._newest_ns
        if restarts or not self._count or not self._step(sample, now):
            unknown = bool(flags & (_RESTARTS | _SETTLING)) or self._count > 0
            self._restart(now, at_rest=not unknown)
            self._step(sample, now)
        self._newest_ns = stamp_ns
        self._follow_motion(sample)
        if 0 <= stamp_ns - self._given_ns < TUNING.fused_ns:
            return None
        self._given_ns = stamp_ns
        self._use_waiting()
        self._read(
            self._store, self._blocks, self._ring, self._count, self._covariance,
            self._averages, _MODEL_ERRORS - np.repeat(self._theta[:2], 2), self._out,
        )  # fmt: skip
        return self._state()

    def state(self) -> ObserverState:
        """Returns the complete state of the observer, which `take_up` restores."""
        kept = [self._ring[k % len(self._ring)] for k in range(self._first, self._count)]
        return ObserverState(
            self._newest_ns, self._epoch_ns or 0, self._corrected_ns, self._judged_ns,
            tuple(self.counts.values()), self._rejected, self._anchored_at, self._store.copy(),
            self._theta.copy(), self._covariance.ravel().copy(), self._blocks.ravel().copy(),
            np.concatenate(kept), self.sensed, self._sensed_ns,
        )  # fmt: skip

    def take_up(self, state: ObserverState) -> None:
        """Restores the state of another observer that has the same model.

        Raises:
            SloshEstimatorError: the state is one of another model or version; nothing changes.
        """
        pairs = (
            (self._store, state.model), (self._theta, state.parameters),
            (self._covariance.ravel(), state.covariance), (self._blocks.ravel(), state.changes),
        )  # fmt: skip
        rows, left = divmod(len(state.past), self._ring.shape[1])
        fits = all(own.shape == given.shape for own, given in pairs)
        if not fits or left or not 0 < rows <= len(self._ring):
            raise SloshEstimatorError("the saved state is one of an observer of another model")
        for own, given in pairs:
            own[:] = given
        self._ring[:rows] = state.past.reshape(rows, -1)
        self._first, self._count = 0, rows
        self.counts = dict(zip(Outcome, state.counts, strict=True))
        self._epoch_ns, self._newest_ns = state.first_ns, state.stamp_ns
        self._given_ns, self._corrected_ns = state.stamp_ns, state.corrected_ns
        self._judged_ns, self._rejected = state.judged_ns, state.rejected
        self._anchored_at = state.anchored_at
        self.sensed, self._sensed_ns = state.sensed, state.sensed_ns

    def _step(self, sample: Sample, now: float) -> bool:
        """Advances the model; returns False if it left the physical range."""
        dt = (sample.stamp_ns - self._newest_ns) / 1e9 if self._count else 0.0
        if self._count - self._first >= len(self._ring) - 1:
            self._move_anchor()
        pose = _UPRIGHT
        if self._pose is not None and sample.pose is not None:
            self._pose[0] = sample.pose
            pose = self._pose
        inside: bool = self._follow(
            self._store, pose, now, dt, sample.ax, sample.ay, sample.az, sample.yaw, self._ring,
            self._count, self._blocks, self._averages, self._noise, self._bound,
        )  # fmt: skip
        self._count += 1
        return inside

    def _follow_motion(self, sample: Sample) -> None:
        """Detects the container's motions; clears the mean acceleration at a motion's end."""
        self._motions.add_one(sample.stamp_ns, (sample.ax, sample.ay, sample.az))
        spans = self._motions.spans
        if not spans:
            return
        if len(spans) > 1:
            self._motions.forget_first()
        self._moved_ns = spans[-1].end_ns
        if sample.stamp_ns - self._moved_ns < TUNING.calm_after_ns:
            self._averages[layout.COUNT] = 0.0
            self._shown.clear()

    def _use_waiting(self) -> None:
        while self._cameras or self._sensors:
            image, sensor = (
                queue[0].stamp_ns if queue else None for queue in (self._cameras, self._sensors)
            )
            sensed = image is None or (sensor is not None and sensor < image)
            ahead_ns = ((sensor if sensed else image) or 0) - self._newest_ns
            if 0 < ahead_ns < TUNING.ahead_ns:
                return
            # A camera is later than a sensor, and what is before the last one used is too late.
            if sensed and self._holds and image is None and ahead_ns > -TUNING.sensed_wait_ns:
                return
            heights = self._take_next(sensed=sensed)
            self._note(self._use(heights) if ahead_ns <= 0 else Outcome.LATE)

    def _take_next(self, *, sensed: bool) -> WallHeights:
        """Removes and returns the next measurement of the camera or sensor queue."""
        if not sensed:
            heights = self._cameras.popleft()
            self._judged_ns = heights.stamp_ns
            return heights
        heights = self._sensors.popleft()
        self._sensed_ns = heights.stamp_ns
        self.sensed += 1
        return heights

    def _note(self, outcome: Outcome) -> None:
        self.counts[outcome] += 1

    def _use(self, heights: WallHeights) -> Outcome:
        if not len(heights.points):
            return Outcome.EMPTY
        if len(heights.points) < TUNING.shape_points:
            self._shown.add(heights.stamp_ns, float(heights.points[0, 1]))
        moment = (heights.stamp_ns - (self._epoch_ns or 0)) / 1e9
        if moment < self._anchored_at:
            return Outcome.LATE
        if not self._corrected(moment, heights.points):
            self._rejected += 1
            if not self._is_another_wave(moment, heights.points):
                return Outcome.REJECTED
        self._rejected = 0
        self._corrected_ns = heights.stamp_ns
        return Outcome.USED

    def _is_another_wave(self, moment: float, points: Array) -> bool:
        """After many rejections, fits a new wave to measured points; returns False if it fails."""
        shown = len(points) >= TUNING.shape_points
        if self._rejected < (TUNING.reopen if shown else TUNING.reopen_unseen):
            return False
        before = self._covariance.copy()
        self._forget()
        if self._corrected(moment, points):
            return True
        self._covariance[:] = before
        return False

    def _move_anchor(self) -> None:
        """Moves the filter's reference time to the middle of the stored inputs."""
        middle = self._ring[(self._first + len(self._ring) // 2) % len(self._ring)]
        self._corrected(float(middle[layout.TIME]), _NO_POINTS)

    def _corrected(self, moment: float, points: Array) -> bool:
        """Corrects the state by measured points; returns False if they are rejected."""
        last = self._count - 1
        ratio = self._correct(
            self._store, self._ring, self._first, last, self._blocks, self._theta,
            self._covariance, self._noise, self._anchored_at, moment, self._cornered,
            self._reaches, points,
        )  # fmt: skip
        if len(points):
            self.innovation = ratio
        if not ratio <= 1.0:
            return False
        self._anchored_at = moment
        times = self._ring[:, layout.TIME]
        while self._first < last and times[(self._first + 1) % len(times)] <= moment:
            self._first += 1
        return True

    def _restart(self, now: float, *, at_rest: bool) -> None:
        """Resets the model to rest; `at_rest` means that the liquid is known to be at rest."""
        run, modes = divided(self._store)
        elapsed = run["elapsed"].copy()
        modes[:] = self._constants
        back_to_rest(self._store)
        if self._count:
            run["elapsed"] = elapsed
        self._theta[:] = 0.0
        self._begin(self._store, self._blocks)
        self._count = self._first = self._rejected = 0
        self._anchored_at, self._corrected_ns = now, None
        self._bounds = EnvelopeBounds()
        self._shown.clear()
        self._forget()
        if at_rest:
            self._spread(TUNING.rest_wave)

    def _forget(self) -> None:
        """Resets the covariance to that of an unknown wave."""
        states = len(self._covariance) - layout.PARAMETERS
        self._covariance[states:, states:] = np.diag(self._slow_variance)
        self._spread(self._largest)

    def _spread(self, height: float) -> None:
        """Sets the covariance of all modes from a standard deviation of wave height [m]."""
        states = len(self._covariance) - layout.PARAMETERS
        self._covariance[:states], self._covariance[:, :states] = 0.0, 0.0
        place = height / self._blocks[:, layout.GAIN]
        rate = place * self._blocks[:, layout.OMEGA]
        variance = np.square(np.column_stack([place, rate])).ravel()
        np.fill_diagonal(self._covariance[:states, :states], variance)

    def _state(self) -> FusedState:
        out = self._out.tolist()
        variance = self._covariance.diagonal()[-layout.PARAMETERS :].tolist()
        theta = self._theta.tolist()
        # The damping is known by the filter, or by what calm allows for.
        spread = TUNING.bound * math.sqrt(variance[layout.DAMPING])
        allowed = math.log(TUNING.calm_damping) + theta[layout.DAMPING]
        slowest = out[layout.DECAY] * math.exp(-max(min(spread, allowed), 0.0))
        bounds = self._bounded(out, slowest)
        return FusedState(
            self._newest_ns, self._corrected_ns, out[layout.MSH], out[layout.AZIMUTH],
            out[layout.SH_X], out[layout.SH_Y], out[layout.STDDEV_X], out[layout.STDDEV_Y],
            out[layout.STDDEV], out[layout.STATE :], math.exp(theta[layout.FREQUENCY]),
            math.exp(theta[layout.DAMPING]), math.sqrt(variance[layout.FREQUENCY]),
            math.sqrt(variance[layout.DAMPING]), out[layout.ENVELOPE],
            out[layout.ENVELOPE_STDDEV], out[layout.DECAY], self._moved_ns,
            theta[layout.LEVEL], theta[layout.CLOCK], *bounds, slowest,
        )  # fmt: skip

    def _bounded(self, out: list[float], slowest: float) -> tuple[float, float]:
        """Returns two bounds of the wave's envelope [m], not below the wave in measurements."""
        since = math.inf if self._moved_ns is None else self._newest_ns - self._moved_ns
        bound, sure = self._bounds.update(
            Envelope(
                self._newest_ns, out[layout.ENVELOPE], out[layout.ENVELOPE_STDDEV],
                out[layout.ENVELOPE_NOISE], out[layout.WORST_ENVELOPE], out[layout.WORST_STDDEV],
                slowest,
            ),
            resting=since >= TUNING.calm_after_ns, corrected_ns=self._corrected_ns,
            contradicted=self._rejected > 0,
        )  # fmt: skip
        shown = self._shown.amplitude(self._newest_ns, float(self._theta[layout.LEVEL]))
        return max(bound, shown), max(sure, shown)


def _noise() -> Array:
    noise = np.zeros(layout.NOISES)
    noise[layout.FLOOR] = TUNING.noise_floor
    noise[layout.SHARE], noise[layout.WAVE] = TUNING.noise_share, TUNING.noise_wave
    noise[layout.MEMORY] = TUNING.noise_memory
    noise[layout.FREQUENCY_WALK] = TUNING.frequency_walk
    noise[layout.DAMPING_WALK] = TUNING.damping_walk
    noise[layout.LEVEL_WALK], noise[layout.CLOCK_WALK] = TUNING.level_walk, TUNING.clock_walk
    noise[layout.GATE] = TUNING.innovation_gate
    noise[layout.COMMON], noise[layout.FORM] = TUNING.common_error, TUNING.form_error
    noise[layout.RELATIVE], noise[layout.ALIKE] = TUNING.relative_error, TUNING.error_memory
    noise[layout.MEAN] = TUNING.rest_average
    noise[layout.LARGE] = TUNING.large_correction
    noise[layout.STEEP] = TUNING.noise_steep
    noise[layout.MOST_FREQUENCY] = TUNING.most_frequency
    noise[layout.MOST_DAMPING] = TUNING.most_damping
    return noise


class ShownWave:
    """Wave amplitude from the root mean square of the newest heights about the still level.

    A camera that tells a maximum but not where may see a part of the wall alone. The filter takes
    such a height for the highest of all: where the crest is elsewhere, the lower ones pull its
    wave down. The heights themselves go on to swing, and that is no calm liquid.

    The noise of the heights is taken off by their differences, in which a wave is small.
    """

    def __init__(self) -> None:
        self._heights: deque[tuple[int, float]] = deque()

    def clear(self) -> None:
        """Removes all heights, after a motion of the container or a change of the liquid."""
        self._heights.clear()

    def add(self, stamp_ns: int, height: float) -> None:
        """Adds a height [m] that was measured at a stamp [ns]."""
        self._heights.append((stamp_ns, height))
        while abs(stamp_ns - self._heights[0][0]) > TUNING.shown_ns:
            self._heights.popleft()

    def amplitude(self, stamp_ns: int, level: float) -> float:
        """Returns the wave's amplitude about a still level, both [m]; 0 with few new heights."""
        heights = [one for at_ns, one in self._heights if stamp_ns - at_ns <= TUNING.shown_ns]
        if len(heights) < TUNING.shown_least:
            return 0.0
        square = math.fsum((one - level) ** 2 for one in heights) / len(heights)
        steps = math.fsum((b - a) ** 2 for a, b in pairwise(heights))
        noise = 0.5 * steps / (len(heights) - 1)
        return math.sqrt(max(2.0 * (square - noise), 0.0))
