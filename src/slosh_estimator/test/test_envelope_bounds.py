"""Tests envelope bounds: they decay at rest, and rise only if something can raise a wave."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_estimator.observer.calm import CalmWatch
from slosh_estimator.observer.envelope_bounds import Envelope, EnvelopeBounds
from slosh_estimator.observer.observer import Observer
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_motion.inputs.sampling import Sample

SECOND = 1_000_000_000
SLOWEST = 0.1
ENVELOPE = Envelope(SECOND, 0.01, 0.001, 1e-5, 0.012, 0.001, SLOWEST)
REST = {"resting": True, "corrected_ns": None, "contradicted": False}


def later(seconds, **fields):
    return ENVELOPE._replace(stamp_ns=SECOND + round(seconds * SECOND), **fields)


def test_at_rest_they_decay_with_the_least_plausible_damping_whatever_the_filter_says():
    bounds = EnvelopeBounds()
    assert bounds.update(ENVELOPE, **REST) == pytest.approx((0.011645, 0.0131))
    # A linear filter's deviation grows with the phase error.
    found = bounds.update(later(10.0, height=0.001, stddev=0.1), **REST)
    assert found == pytest.approx(
        (0.011645 * math.exp(-10 * SLOWEST), 0.0131 * math.exp(-10 * SLOWEST))
    )


def test_the_worst_model_bounds_what_the_filter_does_not_know():
    unsure = ENVELOPE._replace(stddev=0.01)
    found = EnvelopeBounds().update(unsure, **REST)
    expected = [math.hypot(0.012 + error, error) for error in (1.645e-3, 3.1e-3)]
    assert found == pytest.approx(tuple(expected))


def test_motion_and_measurements_set_them_anew_and_contradiction_holds_them():
    bounds = EnvelopeBounds()
    low = later(1.0, height=1e-4, stddev=1e-4)
    for how in ({"resting": False}, {"corrected_ns": 5}):
        bounds.update(ENVELOPE, **REST)
        assert bounds.update(low, **{**REST, **how})[0] == pytest.approx(1e-4 + 1.645e-4)
    bounds = EnvelopeBounds()
    before = bounds.update(ENVELOPE, **REST)
    assert bounds.update(low, **{**REST, "contradicted": True}) == before


def test_a_vibration_above_the_noise_holds_them_up_and_noise_does_not():
    shaken, noisy = EnvelopeBounds(), EnvelopeBounds()
    for bounds, noise in ((shaken, 1e-4), (noisy, 4e-3)):
        bounds.update(ENVELOPE, **REST)
        told = bounds.update(later(1000.0, height=0.01, noise=noise), **REST)
        assert told[1] == pytest.approx(max(0.01 - 3.1 * noise, 0.0), abs=1e-9)


def test_what_is_no_number_is_no_bound_and_does_not_stay():
    bounds = EnvelopeBounds()
    bounds.update(ENVELOPE, **REST)
    assert math.isnan(bounds.update(later(1.0, height=math.nan), **REST)[0])
    assert math.isfinite(bounds.update(later(2.0), **REST)[0])


@given(st.lists(st.floats(0.0, 0.05), min_size=2, max_size=20))
def test_at_rest_they_never_rise_but_by_vibration(heights):
    bounds = EnvelopeBounds()
    told = [bounds.update(later(k, height=height), **REST)[1] for k, height in enumerate(heights)]
    for before, after, height in zip(told, told[1:], heights[1:], strict=False):
        assert after <= max(before, height)


@pytest.mark.parametrize("damping", [0.5, 2.0])
@pytest.mark.parametrize("frequency", [0.98, 1.02])
def test_without_measurements_calm_is_told_neither_early_nor_needlessly_late(frequency, damping):
    cup = Model(Cylinder(0.05, 0.07), damping_ratio=0.04)
    truth = cup.with_effect("frequency_mismatch", factor=frequency)
    truth = truth.with_effect("damping_mismatch", factor=damping)
    t = np.arange(0.0, 15.0, 0.005)
    push = np.where((t > 0.5) & (t < 1.4), 2.0 * np.sin(2.0 * np.pi * (t - 0.5) / 0.9), 0.0)
    acceleration = np.column_stack([push, 0.0 * t, 0.0 * t])
    height = simulate(truth.nonlinear(), Inputs(t, acceleration))[0].msh
    needed = t[np.flatnonzero(height > 1e-3)[-1]]
    observer, watch, calm_at = Observer(cup), CalmWatch(1e-3), None
    for k, moment in enumerate(t):
        stamp_ns = SECOND + round(1e9 * moment)
        state = observer.follow(Sample(stamp_ns, float(push[k]), 0.0, 0.0, restarted=k == 0))
        if state is not None and watch.update(state).calm and moment > 1.4:
            calm_at = moment
            break
    assert calm_at > needed
    if damping == 0.5:  # the slowest liquid that calm allows for
        assert calm_at < 1.4 + 1.5 * (needed - 1.4)
