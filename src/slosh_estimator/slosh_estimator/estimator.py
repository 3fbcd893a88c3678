"""The estimator's core: samples in, the linear and the nonlinear model's heights out."""

from __future__ import annotations

import math
from typing import NamedTuple

from slosh_estimator.sample import Sample
from slosh_estimator.validity import EstimateFlag, ValidityWatch
from slosh_model.model import Model
from slosh_model.simulate import Simulator

RUNAWAY = 5.0
"""A sloshing mass farther out than so many radii is no liquid any more."""
SETTLED = 3.0
"""After so many time constants 1/(ζω) less than 5 % of an unknown initial state is left."""
_SETTLING = int(EstimateFlag.SETTLING)
_AFTER_GAP = int(EstimateFlag.AFTER_GAP)
_DIVERGED = int(EstimateFlag.DIVERGED)


class ModelState(NamedTuple):
    """One model's answer [m, rad, m/s], in the container's axes but for the modal state.

    Attributes:
        msh, azimuth: maximum sloshing height and where it is.
        sh_x, sh_y: signed height at the container's +x and +y side.
        modal: x, y, vx, vy of each mode's mass, in the sample's axes.
    """

    msh: float
    azimuth: float
    sh_x: float
    sh_y: float
    modal: list[list[float]]


class Estimate(NamedTuple):
    """Both models' answers to one sample.

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


class Estimator:
    """Runs a model's L and NL twin side by side.

    The container counts as at rest, with still liquid, when the first sample comes. After a gap
    the liquid's state is unknown: the models restart from rest, and the estimates carry a flag
    until the unknown part has died out.
    """

    def __init__(self, model: Model) -> None:
        self.divergences = 0
        self.load_model(model)

    def load_model(self, model: Model) -> None:
        """Replaces the model; it starts from rest with the next sample."""
        linear, nonlinear = Simulator(model.linear()), Simulator(model.nonlinear())
        self.model, self._linear, self._nonlinear = model, linear, nonlinear
        self._watch = ValidityWatch(model)
        first = model.mode_constants()[0]
        rate = first.damping_ratio * first.natural_frequency
        self._settling_ns = round(SETTLED / rate * 1e9) if rate > 1e-6 else 2**62
        self._bound = RUNAWAY * model.container.radius
        self.reset()

    def reset(self) -> None:
        """Back to rest; the next sample counts as the first."""
        self._linear.reset()
        self._nonlinear.reset()
        self._last_ns: int | None = None
        self._settled_ns = -(2**62)

    @property
    def names(self) -> tuple[str, str]:
        """Names of the two models, e.g. ('3D-L', '3D-NL')."""
        return self._linear.model.name, self._nonlinear.model.name

    def update(self, sample: Sample) -> Estimate:
        """Takes a sample and returns both models' answers to it."""
        flags = 0
        last = self._last_ns
        if sample.restarted and last is not None:
            flags = _AFTER_GAP
            self._restart(sample.stamp_ns)
            last = None
        self._last_ns = sample.stamp_ns
        # A quotient, not a product with 1e-9: correctly rounded, thus the same bits offline.
        dt = 0.0 if last is None else (sample.stamp_ns - last) / 1e9
        linear = self._step(self._linear, dt, sample)
        nonlinear = self._step(self._nonlinear, dt, sample)
        if linear is None or nonlinear is None:
            flags |= _DIVERGED
            self.divergences += 1
            self._restart(sample.stamp_ns)
            linear = self._step(self._linear, 0.0, sample) or _REST
            nonlinear = self._step(self._nonlinear, 0.0, sample) or _REST
        if sample.stamp_ns < self._settled_ns:
            flags |= _SETTLING
        validity, jerk = self._watch.update(sample, max(linear.msh, nonlinear.msh))
        return Estimate(sample, linear, nonlinear, jerk, flags | validity)

    def _restart(self, stamp_ns: int) -> None:
        self._linear.reset()
        self._nonlinear.reset()
        self._settled_ns = stamp_ns + self._settling_ns

    def _step(self, simulator: Simulator, dt: float, sample: Sample) -> ModelState | None:
        """One model's answer; None where it has left the physical range."""
        hx, hy = simulator.step(dt, sample.ax, sample.ay, sample.az)
        modal = simulator.modal.tolist()
        bound = self._bound
        for x, y, _, _ in modal:
            if not (-bound < x < bound and -bound < y < bound):  # false for NaN too
                return None
        if sample.yaw:
            c, s = math.cos(sample.yaw), math.sin(sample.yaw)
            hx, hy = c * hx + s * hy, c * hy - s * hx
        return ModelState(math.sqrt(hx * hx + hy * hy), math.atan2(hy, hx), hx, hy, modal)


_REST = ModelState(0.0, 0.0, 0.0, 0.0, [])
