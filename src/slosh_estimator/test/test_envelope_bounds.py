"""Bounds of the envelope: they decay at rest, and rise by nothing but what can raise a wave."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_estimator.observer.calm import CalmReason, CalmWatch
from slosh_estimator.observer.envelope_bounds import Envelope, EnvelopeBounds
from slosh_estimator.observer.observer import Observer
from slosh_estimator.sample import Sample
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder

SECOND = 1_000_000_000
ENVELOPE = Envelope(SECOND, 0.01, 0.001, 1e-5, 0.2, 0.5)
SLOWEST = 0.2 * math.exp(-1.645 * 0.5)
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


def test_without_any_measurement_calm_is_told_after_a_bounded_time():
    observer, watch = Observer(Model(Cylinder(0.05, 0.07), damping_ratio=0.05)), CalmWatch(1e-3)
    calm_at, bound = None, 0.0
    for k in range(1500):
        t = 0.01 * k
        push = 2.0 * math.sin(2.0 * math.pi * (t - 0.5)) if 0.5 < t < 1.5 else 0.0
        state = observer.follow(
            Sample(SECOND + k * SECOND // 100, push, 0.0, 0.0, restarted=k == 0)
        )
        calm = watch.update(state)
        if t < 1.5:
            assert calm.reason is not CalmReason.CALM or t < 0.6
        if t > 1.75 and not bound:
            bound = state.sure_bound
        if calm.calm and t > 1.75 and calm_at is None:
            calm_at = t
    decay = state.decay * math.exp(-1.645 * 0.5)
    assert bound > 2e-3
    assert calm_at == pytest.approx(1.75 + math.log(bound / 1e-3) / decay, rel=0.1)
