"""Runs the linear and the nonlinear twin of a model on a stream of samples."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from slosh_model.model import Model
from slosh_model.simulate import MAXIMUM_STEP, Simulator

from slosh_estimator import validity
from slosh_estimator.checks import in_range
from slosh_estimator.gate import GateSettings, SampleGate
from slosh_estimator.sample import Sample, Start, wrap


@dataclass(frozen=True, slots=True)
class EstimatorSettings:
    """How the estimator works.

    Attributes:
        gate: limits of the gate.
        max_step: longest sub-step of the integration [s].
        settling_fraction: estimates count as settling until an unknown initial oscillation would
            have decayed to this fraction by the first mode's damping.
        divergence_bound: largest displacement of a mass that is still physical, over the radius.
        jerk_time_constant: of the jerk's filter [s].

    Raises:
        SloshEstimatorError: a value out of range.
    """

    gate: GateSettings = field(default_factory=GateSettings)
    max_step: float = MAXIMUM_STEP
    settling_fraction: float = 0.5
    divergence_bound: float = 2.0
    jerk_time_constant: float = validity.JERK_TIME_CONSTANT

    def __post_init__(self) -> None:
        in_range("max_step", self.max_step, 1e-5, 0.02, "s")
        in_range("settling_fraction", self.settling_fraction, 1e-3, 1.0, "")
        in_range("divergence_bound", self.divergence_bound, 0.1, 100.0, "R")
        in_range("jerk_time_constant", self.jerk_time_constant, 1e-3, 1.0, "s")


class ModelAnswer(NamedTuple):
    """One model's state.

    Attributes:
        msh: maximum sloshing height [m].
        azimuth: of the maximum, from the container's +x [rad].
        sh_x, sh_y: signed height at the container's +x and +y [m].
        position, velocity: x1 y1 x2 y2 … [m], [m/s], in axes that do not yaw.
    """

    msh: float
    azimuth: float
    sh_x: float
    sh_y: float
    position: list[float]
    velocity: list[float]


class Estimate(NamedTuple):
    """The answer to one sample; fields as in slosh_msgs/SloshEstimate."""

    stamp_ns: int
    linear: ModelAnswer
    nonlinear: ModelAnswer
    acceleration: tuple[float, float, float]
    jerk: float
    yaw: float
    flags: int
    samples_used: int
    samples_dropped: int


class Estimator:
    """The estimator: samples in, estimates out.

    Without a gap its heights are bit for bit those of `slosh_model.simulate` on the same samples.

    Args:
        model: the model; its linear and nonlinear twins are run.
        settings: how.

    Attributes:
        gate: the gate that `update` uses; input adapters share it.
        divergences: how often a model left the physical range.
    """

    def __init__(self, model: Model, settings: EstimatorSettings | None = None) -> None:
        self._settings = settings or EstimatorSettings()
        self.gate = SampleGate(self._settings.gate)
        self._jerk = validity.JerkFilter(self._settings.jerk_time_constant)
        self.divergences = 0
        self.load_model(model)

    @property
    def models(self) -> tuple[Model, Model]:
        """The linear and the nonlinear twin."""
        return self._linear.model, self._nonlinear.model

    @property
    def settling_time(self) -> float:
        """Time after a start during which estimates are flagged as settling [s]."""
        return self._settling_ns / 1e9

    def load_model(self, model: Model) -> None:
        """Replaces the model; it starts from rest at the next sample.

        Raises:
            SloshModelError: the model cannot be run; the old one goes on.
        """
        twins = [
            Simulator(twin, max_step=self._settings.max_step)
            for twin in (model.linear(), model.nonlinear())
        ]
        for twin in twins:
            # Compiles the kernel, or loads it from the disk's cache, before a sample waits for it.
            twin.step(0.0, 0.0, 0.0, 0.0)
            twin.step(1e-3, 0.0, 0.0, 0.0)
            twin.reset()
        self._linear, self._nonlinear = twins
        self._limits, self._freeboard = model.limits, model.container.freeboard
        self._bound = self._settings.divergence_bound * model.container.radius
        self._settling_ns = _settling_time_ns(model, self._settings.settling_fraction)
        self.reset()

    def reset(self) -> None:
        """Back to rest; the next sample is a first one. The counters stay."""
        self.gate.reset()
        self._rest()
        self._last_ns = self._started_ns = 0

    def update(
        self,
        stamp_ns: int,
        ax: float,
        ay: float,
        az: float,
        yaw: float = 0.0,
        receive_ns: int | None = None,
    ) -> Estimate | None:
        """Takes a sample through the gate.

        Args:
            stamp_ns: its stamp [ns].
            ax, ay, az: acceleration without gravity, in axes that do not follow the yaw [m/s²].
            yaw: the container's yaw against these axes [rad].
            receive_ns: its time of arrival on the stamps' clock [ns]; None: unknown.

        Returns:
            the estimate at the sample's stamp, or None where the sample is dropped.
        """
        start = self.gate.check(stamp_ns, math.isfinite(ax + ay + az + yaw), receive_ns)
        if start is None:
            return None
        return self.advance(Sample(stamp_ns, ax, ay, az, yaw, start))

    def advance(self, sample: Sample) -> Estimate:
        """Takes a sample that an input adapter let through the gate."""
        stamp_ns, ax, ay, az, yaw, start = sample
        flags = 0
        dt = (stamp_ns - self._last_ns) / 1e9
        if start is not Start.CONTINUES:
            # What the liquid did meanwhile is unknown: rest is as good a guess as any, and flagged.
            dt = 0.0
            self._rest()
            self._started_ns = stamp_ns
            if start is Start.AFTER_GAP:
                flags = validity.AFTER_GAP
        self._last_ns = stamp_ns
        linear, first = self._step(self._linear, dt, sample)
        nonlinear, second = self._step(self._nonlinear, dt, sample)
        if first or second:
            flags |= validity.DIVERGED
            self.divergences += 1
            self._started_ns = stamp_ns
        if stamp_ns - self._started_ns < self._settling_ns:
            flags |= validity.SETTLING
        jerk = self._jerk.update(dt, ax, ay, az)
        norm = math.sqrt(ax * ax + ay * ay + az * az)
        height = max(linear.msh, nonlinear.msh)
        flags |= validity.regime_flags(self._limits, norm, jerk, height, self._freeboard)
        gate = self.gate
        return Estimate(
            stamp_ns, linear, nonlinear, (ax, ay, az), jerk, wrap(yaw), flags, gate.used,
            gate.dropped,
        )  # fmt: skip

    def _rest(self) -> None:
        self._linear.reset()
        self._nonlinear.reset()
        self._jerk.reset()

    def _step(self, simulator: Simulator, dt: float, sample: Sample) -> tuple[ModelAnswer, bool]:
        """One model's answer, and whether it diverged and was reset to rest."""
        sh_x, sh_y = simulator.step(dt, sample.ax, sample.ay, sample.az)
        position, velocity = _modal(simulator)
        diverged = False
        for value in position:
            # Written so that NaN fails it too.
            diverged = diverged or not -self._bound <= value <= self._bound
        if diverged or not math.isfinite(sum(velocity)):
            simulator.reset()
            sh_x, sh_y = simulator.step(0.0, sample.ax, sample.ay, sample.az)
            position, velocity = _modal(simulator)
            diverged = True
        msh = math.hypot(sh_x, sh_y)
        azimuth = math.atan2(sh_y, sh_x)
        yaw = sample.yaw
        if yaw != 0.0:
            azimuth = wrap(azimuth - yaw)
            c, s = math.cos(yaw), math.sin(yaw)
            sh_x, sh_y = c * sh_x + s * sh_y, c * sh_y - s * sh_x
        return ModelAnswer(msh, azimuth, sh_x, sh_y, position, velocity), diverged


def _modal(simulator: Simulator) -> tuple[list[float], list[float]]:
    position: list[float] = []
    velocity: list[float] = []
    for x, y, vx, vy in simulator.modal.tolist():
        position += (x, y)
        velocity += (vx, vy)
    return position, velocity


def _settling_time_ns(model: Model, fraction: float) -> float:
    """Time in which the first mode's free oscillation decays to the fraction; ∞ if undamped."""
    mode = model.mode_constants()[0]
    decay = mode.damping_ratio * mode.natural_frequency
    return 1e9 * math.log(1.0 / fraction) / decay if decay > 0.0 else math.inf
