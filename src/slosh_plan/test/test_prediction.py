"""Tests predictions against the equations, and their uncertainty."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slosh_model import Inputs, simulate
from slosh_model.covariance import Covariance
from slosh_model.limits import ValidityLimits
from slosh_plan import (
    HeightLimits,
    LiquidState,
    ModelError,
    SloshPlanError,
    Trajectory,
    predict,
)
from slosh_plan.validity import MotionFlag


def curve(name):
    t = np.linspace(0.0, 2.0, 2001)
    rise = np.sin(np.pi * t / 2.0) ** 2
    columns = {
        "swing": (3.0 * np.sin(7.0 * t), 0.0 * t, 0.0 * t),
        "round": (2.0 * np.cos(9.0 * t), 2.0 * np.sin(9.0 * t), 0.0 * t),
        "rising": (2.5 * np.sin(11.0 * t), 2.0 * np.cos(5.0 * t), 2.5 * np.sin(13.0 * t)),
    }[name]
    return Trajectory(t, np.column_stack(columns) * rise[:, np.newaxis], name=name)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("swing", marks=pytest.mark.long),
        pytest.param("round", marks=pytest.mark.long),
        pytest.param("rising", marks=pytest.mark.long),
    ],
)
def test_peaks_are_those_of_an_independent_integration(cup, reference, name):
    motion = curve(name)
    (found,) = predict(cup, motion, horizon=0.5)
    moments = np.linspace(0.0, 2.0, 4001)
    for answer, nonlinear in ((found.nonlinear, True), (found.linear, False)):
        truth = reference(motion, moments, nonlinear=nonlinear)
        at = int(np.argmax(truth))
        if moments[at] < 1.99:  # else it lies after the end
            assert answer.peak == pytest.approx(truth[at], rel=1e-4)
            assert answer.peak_time == pytest.approx(moments[at], abs=2e-3)
        assert answer.residual >= truth[-1] * (1.0 - 1e-4)


def test_azimuth_residual_and_settling(cup, line):
    (found,) = predict(cup, line(1.0), horizon=1.0)
    answer = found.nonlinear
    assert abs(answer.azimuth) in (0.0, pytest.approx(math.pi))
    assert 0.001 < answer.residual < answer.peak
    # The truth: simulated for as long as it takes.
    inputs = line(1.0).inputs(60.0)
    response, _ = simulate(cup, inputs)
    last = inputs.t[np.flatnonzero(response.msh > 1e-3)[-1]] - 1.0
    assert answer.settling_time == pytest.approx(last, abs=0.3)
    (quick,) = predict(cup, line(1.0), limits=HeightLimits(residual=0.05))
    assert quick.nonlinear.settling_time == 0.0


def test_the_liquid_goes_on_from_its_state(cup, line):
    motion = line(1.0)
    first = slice(0, 301)
    _, state = simulate(cup, Inputs(motion.t[first], motion.acceleration[first]))
    rest = Trajectory(motion.t[300:], motion.acceleration[300:])
    liquid = LiquidState(state.modal, state.modal)
    (whole,) = predict(cup, motion)
    (split,) = predict(cup, rest, state=liquid)
    assert split.nonlinear.residual == pytest.approx(whole.nonlinear.residual, rel=1e-9)
    (still,) = predict(cup, rest)
    assert still.nonlinear.residual != pytest.approx(whole.nonlinear.residual, rel=0.01)


def test_excess_counts_from_the_upper_end(cup, line):
    (plain,) = predict(cup, line())
    peak = plain.nonlinear.peak
    limits = HeightLimits(peak + 0.001)
    (sure,) = predict(cup, line(), limits=limits)
    (unsure,) = predict(cup, line(), limits=limits, error=ModelError(sigma=0.001))
    assert (sure.lower, sure.upper) == (peak, peak)
    assert sure.kept
    assert unsure.upper == pytest.approx(peak + 0.002)
    assert unsure.excess == pytest.approx(0.001)
    assert not unsure.kept
    (relative,) = predict(cup, line(), error=ModelError(epsilon=-0.1))
    assert relative.upper == pytest.approx(1.1 * peak)
    assert relative.lower == pytest.approx(0.9 * peak)


def test_the_covariance_of_the_model_widens_the_interval(cup, line):
    frequency, ratio = 0.3, 0.8
    matrix = ((frequency**2, ratio * frequency * 0.002), (ratio * frequency * 0.002, 0.002**2))
    names = ("natural_frequency", "damping_ratio")
    unsure = replace(cup, covariance=Covariance(names, matrix))
    (found,) = predict(unsure, line())
    # What many draws of the parameters give.
    draws = np.random.default_rng(1).multivariate_normal(
        (cup.mode_frequency(1), 0.01), matrix, 300
    )
    models = [replace(cup, natural_frequency=w, damping_ratio=abs(z)) for w, z in draws]
    peaks = [predict(model, line())[0].nonlinear.peak for model in models[:150]]
    assert (found.upper - found.lower) / 4.0 == pytest.approx(np.std(peaks), rel=0.2)


def test_flags_tell_where_the_models_end(cup, line):
    low = replace(cup, container=replace(cup.container, rim_height=0.08))
    (found,) = predict(low, line(0.5))
    assert found.flags & MotionFlag.ABOVE_RIM
    assert found.flags & MotionFlag.JERK_LIMIT
    (calm,) = predict(low, line(2.0))
    assert calm.flags == MotionFlag.NONE
    narrow = replace(cup, limits=ValidityLimits(acceleration=1.0))
    assert predict(narrow, line(1.0))[0].flags == MotionFlag.ACCELERATION_LIMIT


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: HeightLimits(0.0), "height limit = 0.0 m must lie above 0"),
        (lambda: HeightLimits(math.nan), "height limit = nan"),
        (lambda: HeightLimits(15.0), "up to 1 m"),
        (lambda: ModelError(sigma=-1.0), "sigma = -1.0"),
        (lambda: ModelError(epsilon=math.nan), "epsilon = nan"),
        (lambda: LiquidState(np.zeros(3), np.zeros((1, 4))), r"linear.*\(3,\)"),
    ],
)
def test_impossible_values_are_refused(make, match):
    with pytest.raises(SloshPlanError, match=match):
        make()
