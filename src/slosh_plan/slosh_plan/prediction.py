"""Predicts the sloshing heights of candidate motions with their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from slosh_base.types import Array
from slosh_model.errors import SloshModelError
from slosh_model.gaps import gap_text, unresolved
from slosh_model.model import Model
from slosh_model.parameters import parameter_value, with_parameters
from slosh_model.tilt import attitude_of, with_tilt
from slosh_plan.errors import SloshPlanError
from slosh_plan.heights import Extremes, all_extremes, usual_horizon
from slosh_plan.limits import HeightLimits
from slosh_plan.start import LiquidState
from slosh_plan.trajectory import Trajectory
from slosh_plan.validity import MotionFlag, motion_flags

LONGEST_HORIZON = 120.0
SETTLED = 1e-3
"""Liquid lower than this is still, where no residual limit says so [m]."""
COVERAGE = 2.0
"""Half widths of intervals, in standard errors: about 95 %."""


@dataclass(frozen=True, slots=True)
class ModelError:
    """Measured accuracy of the model, from the monitor or `slosh replay`.

    >>> from slosh_plan import ModelError
    >>> ModelError(sigma=2e-4, epsilon=0.01)
    ModelError(sigma=0.0002, epsilon=0.01)

    Attributes:
        sigma: mean absolute error of the height [m].
        epsilon: relative error of the maximum, as a fraction, of either sign.

    Raises:
        SloshPlanError: a negative or impossible value.
    """

    sigma: float = 0.0
    epsilon: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.sigma <= 1.0:
            raise SloshPlanError(f"sigma = {self.sigma!r} m must lie in 0 … 1 m")
        if not -1.0 <= self.epsilon <= 10.0:
            raise SloshPlanError(f"epsilon = {self.epsilon!r} must lie in -1 … 10")

    def half_width(self, standard: float, height: float) -> float:
        """Returns half the width of the 95 % interval of a height [m].

        Args:
            standard: the height's standard error by the model's parameters [m].
            height: the height [m]; where it is infinite ε does not count.
        """
        share = self.epsilon * height if math.isfinite(height) else 0.0
        return math.sqrt((COVERAGE * standard) ** 2 + (COVERAGE * self.sigma) ** 2 + share**2)

    def highest(self, limit: float) -> float:
        """Returns the greatest height whose 95 % interval, by MAE and ε alone, keeps a limit [m].

        Raises:
            SloshPlanError: the error leaves nothing of the limit.
        """
        if limit == math.inf:
            return limit
        left = limit**2 - (COVERAGE * self.sigma) ** 2
        if left <= 0.0:
            raise SloshPlanError(
                f"the model's error, {1e3 * COVERAGE * self.sigma:.3g} mm (2 MAE), is not "
                f"below the limit of {1e3 * limit:g} mm"
            )
        return left / (limit + math.sqrt(limit**2 - (1.0 - self.epsilon**2) * left))


@dataclass(frozen=True, slots=True)
class ModelAnswer:
    """Predicted heights of a motion by one model, linear or nonlinear.

    Attributes:
        model: its name.
        peak: greatest height over the wall, MSH [m]; infinite where the model left its range.
        peak_time: when, on the motion's clock [s].
        azimuth: where on the wall, from the container's +x [rad].
        residual: greatest MSH after the motion's end [m].
        settling_time: from the motion's end until the liquid is still [s]: lower than the residual
            limit, or than SETTLED; by the first mode's decay.
    """

    model: str
    peak: float
    peak_time: float
    azimuth: float
    residual: float
    settling_time: float


@dataclass(frozen=True, slots=True, repr=False)
class Prediction:
    """Prediction of the liquid's heights in a motion, with uncertainty and limits.

    >>> import slosh
    >>> found = slosh.predict("cup/model.yaml", "move.csv", limit=0.02)
    >>> print(f"{1e3 * found.nonlinear.peak:.1f} mm")
    5.9 mm

    Attributes:
        name: the motion's.
        duration: of the motion [s].
        linear, nonlinear: the L and the NL model's answers.
        lower, upper: interval of the NL model's peak [m]: the peak itself where nothing is known
            of the model's error.
        residual_upper: upper end of the residual's interval [m].
        limits: what is to be kept: as asked for, and the container's rim where it is lower.
        flags: where the motion leaves what the models were validated for.
        distance_to_rim: vertical, left by the highest place of the surface, by the interval's
            upper end [m]; below 0: it is above the rim; NaN: the rim is not known.
        growth: by which vertical acceleration makes the smallest wave grow; 1: not visibly.
        unresolved: share by which the heights may be higher since rows are far apart; the upper
            ends of the intervals contain it; infinite: the rows do not tell the motion.
    """

    name: str
    duration: float
    linear: ModelAnswer
    nonlinear: ModelAnswer
    lower: float
    upper: float
    residual_upper: float
    limits: HeightLimits
    flags: MotionFlag
    distance_to_rim: float = math.nan
    growth: float = 1.0
    unresolved: float = 0.0

    def __repr__(self) -> str:
        answer = self.nonlinear
        kept = "kept" if self.kept else "not kept"
        return (
            f"Prediction({self.name}: {self.duration:.3f} s, peak {1e3 * answer.peak:.1f} mm at "
            f"{answer.peak_time:.3f} s, afterwards {1e3 * answer.residual:.1f} mm, {kept})"
        )

    @property
    def excess(self) -> float:
        """Excess of the peak's interval over the height limit [m]; 0 if it is below the limit."""
        return max(self.upper - self.limits.height, 0.0)

    @property
    def residual_excess(self) -> float:
        """Excess of the residual height's interval over its limit [m]; 0 if it is below."""
        return max(self.residual_upper - self.limits.residual, 0.0)

    @property
    def margin(self) -> float:
        """Distance from the predicted peak to the upper end of its interval [m]."""
        finite = math.isfinite(self.upper)
        return self.upper - self.nonlinear.peak if finite else 0.0

    @property
    def kept(self) -> bool:
        """Whether the 95 % intervals of peak and residual height are below their limits."""
        return self.excess == 0.0 and self.residual_excess == 0.0


def predict(
    model: Model,
    trajectories: Trajectory | Sequence[Trajectory],
    *,
    limits: HeightLimits | None = None,
    state: LiquidState | None = None,
    horizon: float | None = None,
    error: ModelError | None = None,
) -> list[Prediction]:
    """Predicts the sloshing heights of one or many motions.

    The interval holds the model's parameters, where it has their covariance, and its measured
    error: half of it is √((2 s)² + (2 MAE)² + (ε · peak)²) with the standard error s of the peak,
    linearised along the covariance's principal axes.

    >>> import numpy as np
    >>> from slosh_model import read_model
    >>> from slosh_plan import Trajectory, predict
    >>> t = np.arange(1001) / 1000.0  # s
    >>> move = Trajectory(t, np.outer(np.sin(9.0 * t), [1.0, 0.0, 0.0]))  # m/s²
    >>> (found,) = predict(read_model("cup/model.yaml"), move)
    >>> print(f"{1e3 * found.nonlinear.peak:.1f} mm")
    5.6 mm

    Args:
        model: the model; its L and its NL twin answer. A motion that tilts the container by more
            than TILT_THRESHOLD is answered with `gravity_tilt`, which is added if it is missing.
        trajectories: candidates.
        limits: what is to be kept beside the container's rim; None: nothing.
        state: the liquid when each motion begins; None: at rest.
        horizon: how long the container is watched at rest after each motion [s]; None: three
            periods of the first mode.
        error: the model's measured error; None: unknown.

    Returns:
        as many predictions, in the same order.

    Raises:
        SloshPlanError: the limit is exceeded when the motion begins, the state of another model,
            an impossible horizon, a gap in a motion.
    """
    given = [trajectories] if isinstance(trajectories, Trajectory) else list(trajectories)
    asked, error = limits or HeightLimits(), error or ModelError()
    limits = asked.under_rim(model)
    horizon = checked_horizon(model, horizon)
    check_start(model, state, asked)
    check_gaps(model, given)
    found: dict[int, Prediction] = {}
    # Most motions are of one kind, and one run takes all of a kind.
    feels = [with_tilt(model, attitude_of(one)) for one in given]
    for felt in dict.fromkeys(feels):
        places = [at for at, one in enumerate(feels) if one == felt]
        answers = _predicted(felt, [given[at] for at in places], limits, state, horizon, error)
        found.update(zip(places, answers, strict=True))
    return [found[at] for at in range(len(given))]


def _predicted(
    model: Model,
    given: list[Trajectory],
    limits: HeightLimits,
    state: LiquidState | None,
    horizon: float,
    error: ModelError,
) -> list[Prediction]:
    """Predicts the heights of motions that are all simulated with the same model."""
    inputs = [one.inputs(horizon) for one in given]
    ends = [float(one.t[-1]) for one in given]
    linear_modal, modal = (state.linear, state.nonlinear) if state else (None, None)
    linear, nonlinear = model.linear(), model.nonlinear()
    flat = all_extremes(linear, inputs, ends, linear_modal)
    curved = all_extremes(nonlinear, inputs, ends, modal)
    spread = np.zeros((len(given), 2))
    for variant in principal_variants(nonlinear):
        pair = [all_extremes(one, inputs, ends, modal) for one in variant]
        spread += [
            [0.25 * (a.peak - b.peak) ** 2, 0.25 * (a.residual - b.residual) ** 2]
            if math.isfinite(a.peak + b.peak)
            else [math.inf, math.inf]
            for a, b in zip(*pair, strict=True)
        ]
    quiet = SETTLED if limits.residual == math.inf else limits.residual
    found, wall = [], model.container.wall
    for one, low, high, variances in zip(given, flat, curved, spread, strict=True):
        answers = (
            _answer(linear, low, quiet, horizon),
            _answer(nonlinear, high, quiet, horizon),
        )
        flags = motion_flags(model, one, high.peak)
        share = unresolved(one.spacing, model) if high.peak > 0.0 else 0.0
        told = _prediction(one, answers, np.sqrt(variances), limits, error, flags, share)
        left = float(wall.place(told.upper).distance_to_rim)
        found.append(replace(told, distance_to_rim=left, growth=high.growth, unresolved=share))
    return found


def check_gaps(model: Model, trajectories: Sequence[Trajectory]) -> None:
    """Raises an error if a motion has gaps, over which interpolation is not valid.

    Raises:
        SloshPlanError: the line names the motion, and the longest gap's time and length.
    """
    for one in trajectories:
        if text := gap_text(one.t, model):
            raise SloshPlanError(f"{one.name}: {text}")


def checked_horizon(model: Model, horizon: float | None) -> float:
    """Returns how long to predict after the motion's end [s]; for None, a default duration.

    Raises:
        SloshPlanError: an impossible one.

    >>> from slosh_model import read_model
    >>> checked_horizon(read_model("cup/model.yaml"), 2.5)  # s
    2.5
    """
    if horizon is None:
        return min(usual_horizon(model), LONGEST_HORIZON)
    if not 0.0 < horizon <= LONGEST_HORIZON:
        raise SloshPlanError(
            f"horizon = {horizon!r} s must lie above 0 and up to {LONGEST_HORIZON:g} s"
        )
    return horizon


def check_start(model: Model, state: LiquidState | None, limits: HeightLimits) -> None:
    """Raises SloshPlanError if the liquid exceeds the limit before the motion begins."""
    if state is None:
        return
    nonlinear = model.nonlinear()
    gains = zip(nonlinear.height_gains(), nonlinear.height_gains(axis=1), strict=True)
    if len(state.nonlinear) != model.mode_count:
        raise SloshPlanError(
            f"the liquid's state has {len(state.nonlinear)} modes, the model {model.mode_count}"
        )
    x = y = 0.0
    for (gain, gain_y), mode in zip(gains, state.nonlinear, strict=True):
        x, y = x + gain * mode[0], y + gain_y * mode[1]
    azimuth = model.container.axes(model.mode_count)
    c, s = math.cos(azimuth), math.sin(azimuth)
    x, y = c * x - s * y, s * x + c * y
    height = float(model.container.msh(np.asarray(x), np.asarray(y)))
    if height > limits.height:
        raise SloshPlanError(
            f"the liquid's height is {1e3 * height:.1f} mm before the motion begins, above the "
            f"limit of {1e3 * limits.height:g} mm; wait until it has settled"
        )


def principal_variants(model: Model, width: float = 1.0) -> list[tuple[Model, Model]]:
    """Returns pairs of models with parameters displaced ± along the covariance's principal axes.

    Args:
        model: the model; without a covariance there are none.
        width: how far, in standard errors.

    Raises:
        SloshPlanError: the covariance is of parameters that the model cannot take.

    >>> from slosh_model import read_model
    >>> principal_variants(read_model("cup/model.yaml"))  # no covariance
    []
    """
    covariance = model.covariance
    if covariance is None:
        return []
    try:
        centre = np.array([parameter_value(model, name) for name in covariance.parameters])
        steps = [width * step for step in covariance.principal_steps.T if step.any()]
        return [
            (
                with_parameters(
                    model, dict(zip(covariance.parameters, centre + step, strict=True))
                ),
                with_parameters(
                    model, dict(zip(covariance.parameters, centre - step, strict=True))
                ),
            )
            for step in steps
        ]
    except SloshModelError as error:
        raise SloshPlanError(f"the model's covariance cannot be used: {error}") from None


def _answer(model: Model, found: Extremes, quiet: float, horizon: float) -> ModelAnswer:
    return ModelAnswer(
        model.name, found.peak, found.peak_time, found.azimuth, found.residual,
        _settling(model, found, quiet, horizon),
    )  # fmt: skip


def _settling(model: Model, found: Extremes, quiet: float, horizon: float) -> float:
    """Computes the settling time [s] by extrapolating the wave's exponential decay."""
    if found.residual <= quiet:
        return 0.0
    if not math.isfinite(found.last):
        return math.inf
    mode = model.mode_constants()[0]
    rate = mode.damping_ratio * mode.natural_frequency
    if found.last > quiet:
        return horizon + math.log(found.last / quiet) / rate if rate > 0.0 else math.inf
    # Between the end's height and the last one, on the exponential through both.
    share = math.log(found.residual / quiet) / math.log(found.residual / found.last)
    return horizon * share


def _prediction(
    trajectory: Trajectory,
    answers: tuple[ModelAnswer, ModelAnswer],
    standard: Array,
    limits: HeightLimits,
    error: ModelError,
    flags: MotionFlag,
    share: float,
) -> Prediction:
    """Returns the prediction; heights may be higher by a share for what rows do not tell."""
    linear, nonlinear = answers
    half, after = (
        error.half_width(float(s), height)
        for s, height in zip(standard, (nonlinear.peak, nonlinear.residual), strict=True)
    )
    return Prediction(
        trajectory.name, trajectory.duration, linear, nonlinear, max(nonlinear.peak - half, 0.0),
        nonlinear.peak + half + share * nonlinear.peak,
        nonlinear.residual + after + (share * nonlinear.residual if nonlinear.residual else 0.0),
        limits, flags,
    )  # fmt: skip
