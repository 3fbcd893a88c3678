"""Evaluates the study: limits of the straight line, models and residual vibration."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tm20.camera_sample import Sample
from tm20.design import DEPTH, FILL_HEIGHT, TOLERANCE, Geometry
from tm20.experiments import Measured, geometry_of, places
from tm20.line_limits import Limits

from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.identify import identify
from slosh_discovery.identify.result import IdentifiedModel
from slosh_discovery.identify.validity import count_within
from slosh_model.measure import predicted_heights
from slosh_model.model import Model
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.simulate import Inputs
from slosh_motion.signals.metrics import (
    effective_difference,
    effective_height,
    line_slopes,
)

Array = NDArray[np.float64]

M1 = ("natural_frequency", "damping_ratio")
M2 = (*M1, "p")
SIDES = np.array([0.0, math.pi])
_RATE = 1000.0  # Hz, of a motion's acceleration


@dataclass(frozen=True, slots=True)
class Validity:
    """Deviation of the surface from a straight line by speed, for one container.

    Attributes:
        speeds: (N,) [1/min].
        mean, spread: (N,) of ε̄ over the repetitions [m] (TM20, (14), (15)); NaN: the wave broke.
        fastest: n_max [1/min]; 0: none.
    """

    speeds: tuple[int, ...]
    mean: Array
    spread: Array
    fastest: int


def validity(series: Sequence[Measured]) -> Validity:
    """Evaluates the deviation from a straight line for one container's experiments."""
    mean = np.array([math.nan if one.broke else one.errors.mean() for one in series])
    spread = np.array([math.nan if one.broke else one.errors.std(ddof=1) for one in series])
    speeds = tuple(one.experiment.speed for one in series)
    count = count_within(mean.tolist(), TOLERANCE)
    return Validity(speeds, mean, spread, speeds[count - 1] if count else 0)


@dataclass(frozen=True, slots=True)
class Fits:
    """Identified models of one form (M1 or M2) for one container.

    Attributes:
        overall: MOSM.
        single: SOSM, by speed.
        overall_errors, single_errors: SEOE by speed [rad].
    """

    overall: IdentifiedModel
    single: dict[int, IdentifiedModel]
    overall_errors: dict[int, float]
    single_errors: dict[int, float]


def fits(series: Sequence[Measured], names: Sequence[str]) -> Fits:
    """Identifies a container's models from its valid experiments.

    All repetitions of an experiment have the same motion: their mean tells of the model what they
    tell together.
    """
    base = base_model(geometry_of(series[0].experiment))
    motions = {one.experiment.speed: mean_motion(one) for one in series}
    overall = identify(list(motions.values()), base, names).overall
    single = {speed: identify([motion], base, names).overall for speed, motion in motions.items()}
    return Fits(
        overall,
        single,
        {one.experiment.speed: standard_error(one, overall.model) for one in series},
        {
            one.experiment.speed: standard_error(one, single[one.experiment.speed].model)
            for one in series
        },
    )


def base_model(geometry: Geometry) -> Model:
    """Returns model M1 with the frequency of TM20's eq. (20) and an assumed damping."""
    return Model(Rectangle(geometry.width, DEPTH, FILL_HEIGHT), damping_ratio=0.03)


def inputs_of(measured: Measured) -> Inputs:
    """Returns the container's motion in an experiment as simulation input."""
    cycle = measured.experiment.cycle
    t = np.arange(0.0, cycle.cycle_time + 0.5 / _RATE, 1.0 / _RATE)
    t[-1] = min(t[-1], cycle.cycle_time)
    acceleration = np.zeros((len(t), 3))
    acceleration[:, 0] = cycle.at(t)[2]
    acceleration[-1] = 0.0
    return Inputs(t, acceleration)


def mean_motion(measured: Measured) -> MeasuredMotion:
    """Returns an experiment's mean over repetitions as heights at both walls."""
    half = 0.5 * geometry_of(measured.experiment).width
    wall = half * measured.slopes.mean(axis=0)
    inputs = inputs_of(measured)
    known = measured.experiment.times <= inputs.t[-1]
    eta = np.column_stack((wall, -wall))[known]
    name = f"n{measured.experiment.speed}"
    times = measured.experiment.times[known]
    return MeasuredMotion(name, inputs, times, eta=eta, eta_azimuth=SIDES)


def simulated_slopes(measured: Measured, model: Model) -> Array:
    """Returns the surface slopes θ (FRAMES,) that a model predicts for an experiment."""
    inputs = inputs_of(measured)
    times = np.minimum(measured.experiment.times, inputs.t[-1])
    heights = predicted_heights(model, inputs, times, SIDES)
    width = geometry_of(measured.experiment).width
    return np.asarray((heights[:, 0] - heights[:, 1]) / width)


def standard_error(measured: Measured, model: Model) -> float:
    """Returns the standard error SEOE of θ over all repetitions [rad] (TM20, eq. (16))."""
    missed = measured.slopes - simulated_slopes(measured, model)
    return float(np.sqrt(np.mean(missed**2)))


@dataclass(frozen=True, slots=True)
class Residual:
    """Residual vibration of one experiment [m] (TM20, eqs. (17) to (19)).

    Attributes:
        measured, line, simulated: η_eff by the profiles, their lines and the model.
        line_missed, simulated_missed: Δη_appr and Δη_simul.
    """

    measured: float
    line: float
    simulated: float
    line_missed: float
    simulated_missed: float


def residual(measured: Measured, model: Model) -> Residual:
    """Computes the residual vibration of an experiment, measured and by a model."""
    t, x = measured.dwell_times, places(geometry_of(measured.experiment))
    lines = np.array([line_slopes(x, each) for each in measured.dwell])
    theta = simulated_slopes(measured, model)[-len(t) :]

    def mean(height: Callable[[int], float]) -> float:
        return float(np.mean([height(k) for k in range(len(lines))]))

    return Residual(
        mean(lambda k: effective_height(t, x, measured.dwell[k])),
        mean(lambda k: effective_height(t, x, np.outer(lines[k], x))),
        effective_height(t, x, np.outer(theta, x)),
        effective_difference(t, x, measured.dwell, lines),
        effective_difference(t, x, measured.dwell, theta),
    )


@dataclass(frozen=True, slots=True)
class Findings:
    """The study's results for one container.

    Attributes:
        validity: limits of the straight line.
        first, second: models M1 and M2 from its valid experiments.
        validated: SEOE of MOSM M1 on the other motion, by speed [rad].
        residuals: of that motion, by speed.
    """

    validity: Validity
    first: Fits
    second: Fits
    validated: dict[int, float]
    residuals: dict[int, Residual]


@dataclass(frozen=True, slots=True)
class Study:
    """All results of the study.

    Attributes:
        findings: by the geometry's number.
        samples: what the camera made of some experiments, by geometry.
        limits: n_max by other truths.
        experiments: how many there were.
        seconds: that it took.
    """

    findings: dict[int, Findings]
    samples: dict[int, Sample]
    limits: tuple[Limits, ...]
    experiments: int
    seconds: float
