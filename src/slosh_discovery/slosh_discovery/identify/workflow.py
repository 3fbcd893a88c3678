"""Runs an identification from measured motions to identified models."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_discovery.discover.finding import Role
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.noise import whiteness
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.identify.fitting import FittedVector, fit
from slosh_discovery.identify.information import Unidentified, unidentified
from slosh_discovery.identify.parameters import (
    ALIASES,
    DEFAULT,
    FreeParameter,
    free_parameters,
)
from slosh_discovery.identify.problem import STEP, Problem
from slosh_discovery.identify.result import (
    DwellVibration,
    FittedMotion,
    FoundParameter,
    Identification,
    IdentifiedModel,
    PointAgreement,
    Strategy,
)
from slosh_discovery.identify.trials import OperatingPoint, Trial, make_trials, rise_span
from slosh_discovery.identify.tuning import TUNING
from slosh_discovery.identify.validity import TOLERANCE, LineLimit, limited, line_limit
from slosh_discovery.sound_inputs import sound, sound_fit
from slosh_model.constants import GRAVITY
from slosh_model.covariance import covariance_of
from slosh_model.model import Model
from slosh_model.parameters import DAMPING, FREQUENCY
from slosh_motion.signals.metrics import (
    effective_difference,
    effective_height,
    line_slopes,
    mean_absolute_error,
    peak_error,
)

DAMPINGS = (1.0, 3.0, 8.0)
"""In units of the model's."""


def scanned_start(problem: Problem) -> Array:
    """Returns initial parameters (P,) with the best natural frequency and damping of a grid.

    A wave of a slightly wrong frequency falls out of step within a long record, and the sum of
    squares has a valley at each step: so frequencies around the model's are tried before the fit,
    each with dampings like the model's and larger ones, as that of a formula may be far too small.
    """
    starts = problem.starts
    names = [parameter.name for parameter in problem.parameters]
    if FREQUENCY not in names:
        return starts
    place = names.index(FREQUENCY)
    reduced = replace(problem, trials=_distinct(problem))
    values = []
    for factor in DAMPINGS if DAMPING in names else (1.0,):
        for frequency in _grid(reduced, starts[place]):
            value = starts.copy()
            value[place] = frequency
            if DAMPING in names:
                value[names.index(DAMPING)] *= factor
            values.append(value)
    residuals = reduced.residuals([reduced.start(value) for value in values])
    # By sizes, not squares: outliers must not choose.
    costs = np.sum(np.abs(residuals), axis=0)
    best = int(np.argmin(costs))
    own = reduced.residuals([reduced.start(starts)])[:, 0]
    if costs[best] > TUNING.scan_better * float(np.sum(np.abs(own))):
        return starts
    found: Array = values[best]
    return found


def _distinct(problem: Problem) -> tuple[Trial, ...]:
    """Returns the longest motions, at most one for each operating point."""
    firsts = {trial.point: trial for trial in reversed(problem.trials)}
    longest = sorted(firsts.values(), key=lambda trial: -float(np.ptp(trial.prepared.t)))
    return tuple(longest[: TUNING.scan_trials])


def _grid(problem: Problem, middle: float) -> Array:
    model = problem.model
    damping = model.mode_constants()[0].damping_ratio
    record = max(float(np.ptp(trial.prepared.t)) for trial in problem.trials)
    remembered = min(record, 1.0 / max(damping * middle, 1e-6))
    count = math.ceil(math.log(TUNING.scan_span**2) * middle * remembered / TUNING.scan_phase)
    half = min(max(count, TUNING.scan_fewest), TUNING.scan_most) // 2
    grid: Array = middle * TUNING.scan_span ** (np.arange(-half, half + 1) / half)
    return grid


def dwell_vibration(
    motions: Sequence[MeasuredMotion], shown: Sequence[FittedMotion], half_width: float
) -> tuple[DwellVibration, ...]:
    """Returns the residual vibration at each operating point, from measured surface profiles.

    Args:
        motions: as measured.
        shown: what the identified model says of each.
        half_width: of the container [m].
    """
    found: dict[str, list[tuple[float, float, float]]] = {}
    for motion, answer in zip(motions, shown, strict=True):
        if motion.profile is None or motion.profile_x is None:
            continue
        dwell = motion.t > rise_span(motion.inputs)[1]
        if np.count_nonzero(dwell) < TUNING.least_frames:
            continue
        t, x, eta = motion.t[dwell], motion.profile_x, motion.profile[dwell]
        simulated = answer.after[dwell, 0] / half_width
        found.setdefault(answer.point, []).append(
            (
                effective_height(t, x, eta),
                effective_difference(t, x, eta, line_slopes(x, eta)),
                effective_difference(t, x, eta, simulated),
            )
        )
    return tuple(
        DwellVibration(
            point,
            len(rows),
            max(row[0] for row in rows),
            float(np.sqrt(np.mean([row[1] ** 2 for row in rows]))),
            float(np.sqrt(np.mean([row[2] ** 2 for row in rows]))),
        )
        for point, rows in found.items()
    )


Progress = Callable[[str, float], object]

RATIO = 0.4
"""TM20's share of a cycle in which the container moves."""
ALL = "all"
FACTOR = "p"
_NO_SPEED = OperatingPoint(ALL, float("nan"), ())


def identify(
    motions: Sequence[MeasuredMotion],
    base: Model,
    names: Sequence[str] = DEFAULT,
    *,
    strategy: Strategy = Strategy.MOSM,
    holdout: Sequence[MeasuredMotion] = (),
    ratio: float = RATIO,
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
) -> Identification:
    """Identifies a model's parameters from measured motions.

    Args:
        motions: from rest, or free decays.
        base: the model; what is not fitted stays as it has it.
        names: parameters to fit; see `parameters`.
        strategy: one model for all motions (MOSM), or one for each operating point beside it.
        holdout: motions that the fit does not see.
        ratio: b, share of a cycle in which the container moves; for the names of speeds.
        tolerance: the greatest ε̄ of a surface that is taken for a line [m].
        progress: told what is done and the share of it in [0, 1].

    Raises:
        SloshDiscoveryError: no motions, none with a sound input, or parameters that cannot be
            fitted.
    """
    if not motions:
        raise SloshDiscoveryError("no motion with measured heights: nothing to identify from")
    highest = max(float(np.nanmax(np.abs(motion.heights))) for motion in motions)
    if highest < TUNING.least_seen:
        raise SloshDiscoveryError(
            f"{motions[0].name}: all heights are 0 to a micrometre: nothing was measured, the "
            "column is empty, or its unit is not m"
        )
    motions, faulty = sound_fit(motions)
    holdout, faulty_holdout = sound(holdout)
    told = progress or (lambda text, share: None)
    told("preparing", 0.0)
    free = free_parameters(base, names)
    every = [*motions, *holdout]
    trials, points = make_trials(every, base, ratio)
    fitted, others = trials[: len(motions)], trials[len(motions) :]
    told("all motions", 0.1)
    overall = _identified(base, free, fitted, _NO_SPEED)
    used = sorted({trial.point for trial in fitted})
    single = {}
    if strategy is Strategy.SOSM:
        for number, place in enumerate(used):
            told(points[place].label, 0.3 + 0.6 * number / len(used))
            own = tuple(trial for trial in fitted if trial.point == place)
            single[place] = _identified(base, free, own, points[place])
    told("results for each motion", 0.9)
    answers = [(trial, single.get(trial.point, overall).estimate, Role.FIT) for trial in fitted]
    for trial in others:
        model = single.get(trial.point, overall).result.model
        answers.append((trial, _answered(model, trial), Role.HOLDOUT))
    shown = tuple(
        _shown(base, own, trial, points[trial.point].label, role) for trial, own, role in answers
    )
    agreements = tuple(
        _agreement(points[place], place, overall, single.get(place), shown) for place in used
    )
    line = line_limit(motions, ratio, tolerance)
    told("done", 1.0)
    return Identification(
        base=base,
        strategy=strategy,
        overall=_limited(overall.result, line),
        single=tuple(_limited(single[place].result, line) for place in used if place in single),
        points=agreements,
        motions=shown,
        line=line,
        dwell=dwell_vibration(every, shown, base.container.reaches[0]),
        remarks=(*faulty, *faulty_holdout, *_remarks(overall), *_line_remarks(line)),
    )


def _limited(result: IdentifiedModel, line: LineLimit | None) -> IdentifiedModel:
    return replace(result, model=limited(result.model, line))


def answered(motions: Sequence[MeasuredMotion], model: Model) -> tuple[FittedMotion, ...]:
    """Returns a model's responses to motions; fits only clock offsets and initial states.

    Of the answers `before` and `after` are the same.
    """
    trials, points = make_trials(motions, model, RATIO)
    return tuple(
        _shown(model, _answered(model, trial), trial, points[trial.point].label, Role.HOLDOUT)
        for trial in trials
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Identified:
    """An identified model and its fit."""

    result: IdentifiedModel
    estimate: FittedVector


def _identified(
    base: Model,
    free: tuple[FreeParameter, ...],
    trials: tuple[Trial, ...],
    point: OperatingPoint,
) -> _Identified:
    problem = Problem(base, free, trials)
    estimate, held = _fit_known(problem)
    problem = estimate.problem
    names = tuple(parameter.name for parameter in problem.parameters)
    found = problem.model_at(estimate.vector)
    assert found is not None  # a fit ends within its bounds
    model = replace(found, covariance=covariance_of(names, estimate.shared) if names else None)
    result = IdentifiedModel(
        label=point.label,
        speed=point.speed,
        model=model,
        parameters=_found(estimate),
        derived=_derived(base, estimate),
        correlations=estimate.correlations,
        held=held,
        noise=estimate.colour,
        outliers=estimate.outliers,
        scatter=estimate.scatter,
        seoe=float(np.sqrt(np.mean(estimate.residual**2))),
    )
    return _Identified(result, estimate)


def _fit_known(problem: Problem) -> tuple[FittedVector, tuple[Unidentified, ...]]:
    """Fits the identifiable parameters; all other parameters keep their values.

    Raises:
        SloshDiscoveryError: they tell of nothing.
    """
    held: list[Unidentified] = []
    while True:
        estimate = fit(problem, problem.start(scanned_start(problem)))
        left, missing = unidentified(problem, estimate.vector, estimate.colour)
        held += missing
        if not missing or not left:
            break
        kept = tuple(one for one in problem.parameters if one.name in left)
        problem = replace(problem, parameters=kept)
    if not left:
        raise SloshDiscoveryError(
            f"these motions do not determine {', '.join(one.name for one in held)}: "
            + (f"add {held[0].help}" if held[0].help else "other motions are needed")
        )
    return estimate, tuple(held)


def _found(estimate: FittedVector) -> tuple[FoundParameter, ...]:
    lower, upper = estimate.interval()
    rows = zip(
        estimate.problem.parameters, estimate.values.tolist(), estimate.standard_errors.tolist(),
        lower.tolist(), upper.tolist(), strict=True,
    )  # fmt: skip
    return tuple(
        FoundParameter(
            one.name, one.unit, one.start, value, error, max(low, one.lower), min(high, one.upper)
        )
        for one, value, error, low, high in rows
    )


def _derived(base: Model, estimate: FittedVector) -> tuple[FoundParameter, ...]:
    """Derives first mode's frequency and damping, and factor p of TM20, unless they are fitted."""
    problem = estimate.problem
    names = [parameter.name for parameter in problem.parameters]
    wanted: list[tuple[str, str, Callable[[Model], float]]] = [
        (FREQUENCY, "rad/s", lambda model: model.mode_constants()[0].natural_frequency),
        (DAMPING, "1", lambda model: model.mode_constants()[0].damping_ratio),
        (FACTOR, "1/m", _factor),
    ]
    found = []
    for name, unit, of in wanted:
        fitted = ALIASES[FACTOR] in names if name == FACTOR else name not in names
        if fitted:
            value, error = _propagated(estimate, of)
            reach = estimate.quantile() * error
            entry = (name, unit, of(base), value, error, value - reach, value + reach)
            found.append(FoundParameter(*entry))
    return tuple(found)


def _factor(model: Model) -> float:
    """Returns the factor p = gain ω₀²/g [1/m] of TM20, eq. (10)."""
    gain = next((u.parameters["gain"] for u in model.effects if u.name == "accel_gain"), 1.0)
    return gain * model.mode_constants()[0].natural_frequency ** 2 / GRAVITY


def _propagated(estimate: FittedVector, of: Callable[[Model], float]) -> tuple[float, float]:
    """Evaluates a function of the fitted model, with its standard error."""
    problem, vector = estimate.problem, estimate.vector
    gradient = np.zeros(len(problem.parameters))
    for place, parameter in enumerate(problem.parameters):
        ends = []
        for sign in (1.0, -1.0):
            moved = vector.copy()
            value = moved[place] + sign * STEP * parameter.width
            moved[place] = min(max(value, parameter.lower), parameter.upper)
            ends.append((moved[place], of(_sure(problem.model_at(moved)))))
        gradient[place] = (ends[0][1] - ends[1][1]) / (ends[0][0] - ends[1][0])
    error = math.sqrt(max(float(gradient @ estimate.shared @ gradient), 0.0))
    return of(_sure(problem.model_at(vector))), error


def _sure(model: Model | None) -> Model:
    assert model is not None  # next to a fit, within its bounds
    return model


def _shown(base: Model, own: FittedVector, trial: Trial, label: str, role: Role) -> FittedMotion:
    """Returns a trial with the responses of the base model and of the identified model."""
    prepared = trial.prepared
    after, offset = _heights_and_clock(own, trial)
    before, _ = _heights_and_clock(_answered(base, trial), trial)
    band = np.full(prepared.kept.shape, np.nan)
    if role is Role.FIT:
        band[prepared.kept] = own.quantile() * _own_part(own, trial, own.band())
    measured, peaks = prepared.heights, _highest(prepared.heights, prepared.kept)
    highest = _highest(after, prepared.kept)
    return FittedMotion(
        name=trial.name,
        point=label,
        role=role,
        free_decay=trial.free,
        t=prepared.t,
        measured=measured,
        azimuths=prepared.azimuths,
        before=before,
        after=after,
        band=band,
        clock_offset=offset,
        seoe_before=_rms(measured - before),
        seoe=_rms(measured - after),
        sigma=mean_absolute_error(peaks, highest),
        epsilon=peak_error(peaks, highest),
    )


def _answered(model: Model, trial: Trial) -> FittedVector:
    """Fits the clock offset and initial state of one trial for a given model."""
    problem = Problem(model, (), (trial,))
    return fit(problem, problem.start(np.empty(0)))


def _heights_and_clock(estimate: FittedVector, trial: Trial) -> tuple[Array, float]:
    """Returns modelled heights [m] at the measurement's zero level, and its clock offset [s]."""
    problem = estimate.problem
    place = problem.trials.index(trial)
    heights = problem.predicted([estimate.vector])[0][place]
    prepared, clock = trial.prepared, problem.clocks[place]
    offset = float(estimate.vector[clock[0]]) if clock else 0.0
    if heights is None:
        return np.full(prepared.heights.shape, np.nan), offset
    if not prepared.motion.level_known:
        heights = heights + float(np.mean((prepared.heights - heights)[prepared.kept]))
    return heights, offset


def _own_part(estimate: FittedVector, trial: Trial, row: Array) -> Array:
    """Returns the part of a concatenated array that belongs to one trial."""
    trials = estimate.problem.trials
    place = trials.index(trial)
    start = sum(other.count for other in trials[:place])
    return row[start : start + trial.count]


def _agreement(
    point: OperatingPoint,
    place: int,
    overall: _Identified,
    single: _Identified | None,
    shown: Sequence[FittedMotion],
) -> PointAgreement:
    own = [trial for trial in overall.estimate.problem.trials if trial.point == place]
    before = [
        motion.measured - motion.before
        for motion in shown
        if motion.role is Role.FIT and motion.point == point.label
    ]

    def seoe(identified: _Identified | None) -> float:
        if identified is None:
            return float("nan")
        estimate = identified.estimate
        return _rms(np.concatenate([_own_part(estimate, t, estimate.residual) for t in own]))

    known = np.concatenate([part[np.isfinite(part)] for part in before])
    return PointAgreement(point, len(own), _rms(known), seoe(single), seoe(overall))


def _remarks(overall: _Identified) -> tuple[str, ...]:
    result, estimate = overall.result, overall.estimate
    remarks = []
    if result.scatter > 1.0:
        remarks.append(
            "The motions differ by more than noise: the standard errors are increased by a factor "
            f"of {result.scatter:.1f}."
        )
    elif not _noise_alone(estimate):
        remarks.append(
            "The residual exceeds the noise: the model lacks something, and the standard "
            "errors cover noise only. Run `slosh discover` to find what is missing."
        )
    return tuple(remarks)


def _line_remarks(line: LineLimit | None) -> tuple[str, ...]:
    if line is None:
        return ()
    tolerance = f"{1e3 * line.tolerance:g} mm"
    if not math.isfinite(line.speed):
        return (
            f"Even at the slowest speed the surface is not a straight line within {tolerance}.",
        )
    if not line.exceeded:
        return (
            f"The surface is a straight line within {tolerance} at all speeds, up to "
            f"{line.speed:g} 1/min: the end of that range was not reached, and no limit is "
            "written.",
        )
    return (
        f"The surface is a straight line within {tolerance} up to {line.speed:g} 1/min. Beyond "
        "the largest acceleration and jerk of that motion, now in the model's limits, an "
        "estimator flags that planarity is lost.",
    )


def _noise_alone(estimate: FittedVector) -> bool:
    """Returns whether the whitened residual of each motion is consistent with white noise."""
    trials = estimate.problem.trials
    white = estimate.noise.applied(estimate.residual)
    for trial in trials:
        prepared = trial.prepared
        laid = np.full(prepared.kept.shape, np.nan)
        laid[prepared.kept] = _own_part(estimate, trial, white)
        if whiteness(prepared.t, laid) < TUNING.surely / len(trials):
            return False
    return True


def _highest(heights: Array, kept: NDArray[np.bool_]) -> Array:
    """Returns the maximum (M,) [m] of the measured heights; NaN where nothing was measured."""
    highest = np.where(kept, heights, -np.inf).max(axis=1)
    return np.where(kept.any(axis=1), highest, np.nan)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))
