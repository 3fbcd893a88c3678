"""Checks planned motions by simulation at their sample rate."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_model import Inputs, Model
from slosh_model.standing import Standing
from slosh_model.standing_use import StandingUse, standing_use
from slosh_model.tray import TrayContainer
from slosh_plan.heights import first_period, highest, highest_of_each, msh_of
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.time_law import PlannedMotion
from slosh_plan.prediction import ModelError, principal_variants

PERIODS = 8.0
"""Of the first mode that are looked at after a motion's end."""
GLANCED = 1.0
"""The same for motions that are only looked at."""
TOLERANCE = 1e-9
LEFT = 1e-6
"""Share of a height limit that is left, so that a prediction of what is written keeps it, too."""


class LooseContainer(NamedTuple):
    """A container that stands loosely on a tray, as needed to check motions of the tray.

    Attributes:
        standing: how it stands.
        place: of the centre of its still surface in the tray's frame [m].
    """

    standing: Standing
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def of(cls, one: TrayContainer) -> LooseContainer | None:
        """Returns the loosely standing container of a tray, or None if it is held."""
        return None if one.standing is None else cls(one.standing, one.place)


@dataclass(frozen=True, slots=True, eq=False)
class CheckedMotion:
    """A motion with the maximum heights that its simulation gives.

    Attributes:
        motion: the motion.
        msh: (M,) maximum height over the wall at the motion's rate, over motion and horizon [m].
        peak: largest height, in the motion or after it [m].
        residual: largest height after the motion's end [m].
        upper, residual_upper: upper ends of their intervals (95 %) [m], or the greatest heights
            of all scenarios; the heights themselves where neither is asked for.
        acceleration: largest ‖a‖ [m/s²].
        jerk: largest change of the acceleration from row to row, by time [m/s³].
        tilt, tilt_rate, tilt_acceleration: the largest [rad, rad/s, rad/s²]; 0: there is none.
        joints: shares of the joints' limits that are used, by their names in JOINT_LIMITS; empty:
            the joints are not known.
        standing: shares of friction and base that a container uses that stands loosely, by their
            names in STANDING_LIMITS; empty: it is held.
    """

    motion: PlannedMotion
    msh: Array
    peak: float
    residual: float
    upper: float
    residual_upper: float
    acceleration: float
    jerk: float
    tilt: float
    tilt_rate: float
    tilt_acceleration: float
    joints: Mapping[str, float] = field(default_factory=dict)
    standing: Mapping[str, float] = field(default_factory=dict)

    def excess(self, limits: PlanLimits) -> dict[str, float]:
        """Returns the relative excess over each limit; at most 0 for a limit that is kept."""
        plain = ("acceleration", "jerk", "tilt_rate", "tilt_acceleration")
        shares = {name: getattr(self, name) / getattr(limits, name) - 1.0 for name in plain}
        used = {**self.joints, **self.standing}
        shares |= {name: share / getattr(limits, name) - 1.0 for name, share in used.items()}
        return shares | {
            "height": self.upper / limits.height - 1.0 + LEFT,
            "residual": self.residual_upper / limits.residual - 1.0 + LEFT,
            "tilt": self.tilt / limits.tilt - 1.0 if self.tilt > 0.0 else -1.0,
        }

    def keeps(self, limits: PlanLimits, tolerance: float = TOLERANCE) -> bool:
        """Returns whether the motion keeps every limit within a relative tolerance."""
        return max(self.excess(limits).values()) <= tolerance


def error_of(model: Model, error: ModelError | None) -> ModelError | None:
    """Returns a model's measured error; 0 beside a covariance where it is not known."""
    return ModelError() if error is None and model.covariance is not None else error


def horizon(model: Model) -> float:
    """Returns how long to simulate after a motion's end [s]."""
    return PERIODS * first_period(model)


@dataclass(frozen=True, slots=True, eq=False)
class Checker:
    """Simulates planned motions that start with liquid at rest, to check their limits.

    Attributes:
        model: the model.
        attitude: (4,) quaternion that the container keeps; None: upright.
        error: the model's measured error: with it, and the covariance of the model's parameters
            where there is one, heights have intervals, whose upper ends count; None: the heights
            themselves do.
        scenarios: models with other parameters, that count as the model's own do.
        loose: how the container stands where it is not held; None: it is held.
    """

    model: Model
    attitude: Array | None = None
    error: ModelError | None = None
    scenarios: tuple[Model, ...] = ()
    loose: LooseContainer | None = None

    def __call__(
        self, motions: Sequence[PlannedMotion], periods: float = PERIODS
    ) -> list[CheckedMotion]:
        """Returns motions with the maximum heights that their simulation gives.

        Args:
            motions: the motions.
            periods: of the first mode that are looked at after their ends.
        """
        found = self._found(self.model, motions, periods)
        for scenario in self.scenarios:
            others = self._found(scenario, motions, periods)
            found = [_higher(*pair) for pair in zip(found, others, strict=True)]
        if self.error is None:
            return found
        spread = np.zeros((len(motions), 2))
        for variant in principal_variants(self.model):
            one, other = (checked(twin, motions, self.attitude, periods) for twin in variant)
            spread += [_squared(*pair) for pair in zip(one, other, strict=True)]
        return [
            replace(
                one,
                upper=one.upper + self.error.half_width(peak, one.upper),
                residual_upper=one.residual_upper
                + self.error.half_width(after, one.residual_upper),
            )
            for one, (peak, after) in zip(found, np.sqrt(spread).tolist(), strict=True)
        ]

    def _found(
        self, model: Model, motions: Sequence[PlannedMotion], periods: float
    ) -> list[CheckedMotion]:
        """Simulates motions with a model; computes friction and base use of a loose container."""
        found = checked(model, motions, self.attitude, periods)
        if self.loose is None:
            return found
        uses = [standing_uses([model], one, self.attitude, self.loose) for one in motions]
        return [
            replace(one, standing=used._asdict()) for one, (used,) in zip(found, uses, strict=True)
        ]

    def glance(self, motions: Sequence[PlannedMotion]) -> list[CheckedMotion]:
        """Simulates motions shortly and without uncertainty: a quick lower bound of heights."""
        return replace(self, model=replace(self.model, covariance=None))(motions, GLANCED)


class AllContainers(NamedTuple):
    """Simulates planned motions of a tray with all containers.

    What a motion reaches is told in shares of the first container's limits, by the worst.

    Attributes:
        each: the check and the limits of each container, the first one that is planned for.
    """

    each: tuple[tuple[Checker, PlanLimits], ...]

    def __call__(self, motions: Sequence[PlannedMotion]) -> list[CheckedMotion]:
        """Returns motions with the worst that their simulation gives."""
        return self._worst([check(motions) for check, _ in self.each])

    def glance(self, motions: Sequence[PlannedMotion]) -> list[CheckedMotion]:
        """Returns lower bounds of it, without the uncertainty of parameters."""
        return self._worst([check.glance(motions) for check, _ in self.each])

    def _worst(self, found: list[list[CheckedMotion]]) -> list[CheckedMotion]:
        limits = [each for _, each in self.each]
        first = limits[0]
        answers = []
        for row in zip(*found, strict=True):
            upper = max(one.upper / kept.height for one, kept in zip(row, limits, strict=True))
            after = max(
                one.residual_upper / kept.residual for one, kept in zip(row, limits, strict=True)
            )
            standing: dict[str, float] = {}
            for name, used in (pair for one in row for pair in one.standing.items()):
                standing[name] = max(used, standing.get(name, 0.0))
            answers.append(
                replace(
                    row[0],
                    upper=upper * first.height,
                    residual_upper=after * first.residual,
                    standing=standing,
                )
            )
        return answers


def _higher(one: CheckedMotion, other: CheckedMotion) -> CheckedMotion:
    """Raises a motion's upper bounds of heights and limit use where another model's are higher."""
    return replace(
        one,
        upper=max(one.upper, other.peak),
        residual_upper=max(one.residual_upper, other.residual),
        standing={name: max(used, other.standing[name]) for name, used in one.standing.items()},
    )


def _squared(one: CheckedMotion, other: CheckedMotion) -> tuple[float, float]:
    """Returns variances [m²] of peak and residual height from models at ± one standard error."""
    if not math.isfinite(one.peak + other.peak):
        return math.inf, math.inf
    return (0.25 * (one.peak - other.peak) ** 2, 0.25 * (one.residual - other.residual) ** 2)


def checked(
    model: Model,
    motions: Sequence[PlannedMotion],
    attitude: Array | None,
    periods: float = PERIODS,
) -> list[CheckedMotion]:
    """Simulates motions that start with liquid at rest; returns their maximum heights.

    Args:
        model: the model.
        motions: any number.
        attitude: (4,) quaternion that the container keeps; None: upright.
        periods: of the first mode that are looked at after their ends.
    """
    seconds = periods * first_period(model)
    inputs = [_with_rest(motion, seconds, attitude) for motion in motions]
    return [
        _checked(motion, _finite(msh_of(model.container, one.heights)))
        for motion, one in zip(motions, highest(model, inputs), strict=True)
    ]


def heights_after(
    models: Sequence[Model], motion: PlannedMotion, attitude: Array | None
) -> Iterator[Array]:
    """Simulates a motion with many models; yields each model's maximum wall heights [m].

    Args:
        models: that differ in their parameters; the first one's horizon is that of all.
        motion: the motion.
        attitude: (4,) quaternion that the container keeps; None: upright.
    """
    inputs = _with_rest(motion, horizon(models[0]), attitude)
    for model, heights in zip(models, highest_of_each(models, inputs), strict=True):
        yield _finite(msh_of(model.container, heights))


def standing_uses(
    models: Sequence[Model], motion: PlannedMotion, attitude: Array | None, loose: LooseContainer
) -> Iterator[StandingUse]:
    """Simulates a motion with many models; yields the used friction and support base.

    Args:
        models, motion, attitude: as of `heights_after`.
        loose: how the container stands.
    """
    inputs = _with_rest(motion, horizon(models[0]), attitude)
    for model in models:
        yield standing_use(model, loose.standing, inputs, np.array(loose.place))


def _with_rest(motion: PlannedMotion, seconds: float, attitude: Array | None) -> Inputs:
    """Returns a motion, followed by rest, as input of a model."""
    rest = np.zeros((int(np.ceil(seconds / motion.step)), 3))
    acceleration = np.concatenate([motion.acceleration, rest])
    t: Array = motion.step * np.arange(len(acceleration), dtype=np.float64)
    return Inputs(t, acceleration, attitudes(motion, attitude, len(t)))


def _finite(msh: Array) -> Array:
    """Returns heights [m] with infinity in place of values that are not finite."""
    return np.where(np.isfinite(msh), msh, np.inf)


def attitudes(motion: PlannedMotion, attitude: Array | None, rows: int) -> Array | None:
    """Returns quaternions over a motion and the rest that follows; None if upright.

    Args:
        motion: the motion.
        attitude: (4,) that the container keeps where it does not tilt.
        rows: not fewer than the motion's.
    """
    own = motion.attitude
    if own is not None:
        return np.concatenate([own, np.tile(own[-1], (rows - len(own), 1))])
    return None if attitude is None else np.tile(attitude, (rows, 1))


def _checked(motion: PlannedMotion, msh: Array) -> CheckedMotion:
    steps = np.linalg.norm(np.diff(motion.acceleration, axis=0), axis=1)
    peak, residual = float(msh.max()), float(msh[len(motion.t) - 1 :].max())
    return CheckedMotion(
        motion,
        msh,
        peak,
        residual,
        peak,
        residual,
        float(np.linalg.norm(motion.acceleration, axis=1).max()),
        float(steps.max()) / motion.step,
        *((0.0, 0.0, 0.0) if motion.tilt is None else motion.tilt.largest),
        {} if motion.joints is None else motion.joints.shares(motion.step),
    )
