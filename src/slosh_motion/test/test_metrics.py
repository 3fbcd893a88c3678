import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from slosh_motion.errors import SloshMotionError
from slosh_motion.signals.metrics import (
    RunningAccuracy,
    effective_difference,
    effective_height,
    line_approximation_error,
    line_slopes,
    mean_absolute_error,
    peak_error,
    rms_error,
)

MEASURED = [0.01, 0.04, math.nan, 0.02]
MODEL = [0.02, 0.01, 0.09, 0.03]


def test_peak_error_is_a_signed_fraction_of_the_measured_peak() -> None:
    assert peak_error(MEASURED, MODEL) == pytest.approx(-0.25)


def test_pairs_without_a_measurement_do_not_count() -> None:
    assert mean_absolute_error(MEASURED, MODEL) == pytest.approx(0.05 / 3)
    assert rms_error(MEASURED, MODEL) == pytest.approx(math.sqrt(11e-4 / 3))


@pytest.mark.parametrize("metric", [peak_error, mean_absolute_error, rms_error])
def test_nothing_to_compare_is_an_error(metric: Callable[..., float]) -> None:
    with pytest.raises(SloshMotionError, match="no finite moment"):
        metric([math.nan], [1.0])


def test_shapes_that_do_not_match_are_refused_with_both_shapes() -> None:
    with pytest.raises(SloshMotionError, match=r"\(2,\).*\(3,\)"):
        mean_absolute_error([1, 2], [1, 2, 3])


HEIGHT = st.floats(-1.0, 1.0) | st.just(math.nan) | st.just(math.inf)


@given(st.lists(st.tuples(HEIGHT, HEIGHT), max_size=40))
def test_the_stream_gives_what_the_arrays_give(pairs: list[tuple[float, float]]) -> None:
    accuracy = RunningAccuracy()
    for measured, model in pairs:
        accuracy.update(measured, model)
    columns = np.array(pairs).reshape(-1, 2).T
    assert accuracy.count == int(np.isfinite(columns).all(axis=0).sum())
    if not accuracy.count:
        assert math.isnan(accuracy.sigma)
        assert math.isnan(accuracy.epsilon)
        return
    np.testing.assert_allclose(accuracy.epsilon, peak_error(*columns), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(
        accuracy.sigma, mean_absolute_error(*columns), rtol=1e-12, atol=1e-15
    )


@given(st.lists(st.tuples(HEIGHT, HEIGHT), max_size=40), st.integers(0, 40))
def test_parts_give_what_the_whole_gives(pairs: list[tuple[float, float]], cut: int) -> None:
    parts, whole = RunningAccuracy(), RunningAccuracy()
    columns = np.array(pairs).reshape(-1, 2).T
    for part in (columns[:, :cut], columns[:, cut:]):
        parts.update_many(*part)
    whole.update_many(*columns)
    assert parts.count == whole.count
    np.testing.assert_equal(parts.epsilon, whole.epsilon)
    for name in ("sigma", "rms"):
        one, other = getattr(parts, name), getattr(whole, name)
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)


@pytest.mark.filterwarnings("error")
def test_a_forged_height_is_counted_without_a_word() -> None:
    accuracy = RunningAccuracy()
    accuracy.update_many(np.array([0.01, 1e308]), np.array([0.01, 0.01]))
    assert accuracy.count == 2


# TM20's indices of the surface's shape and of what is left of it in a dwell.


WIDTH = 0.06
X = np.linspace(-WIDTH / 2.0, WIDTH / 2.0, 61)


def test_slopes_are_those_that_levenberg_marquardt_finds():
    eta = np.random.default_rng(1).normal(0.0, 1e-3, (4, len(X))) + np.outer([0, 0.1, -0.2, 1], X)
    for theta, frame in zip(line_slopes(X, eta), eta, strict=True):
        found = least_squares(lambda s, f=frame: f - s[0] * X, [0.0], method="lm")
        assert theta == pytest.approx(found.x[0], abs=1e-9)


def test_gaps_in_a_frame_do_not_move_its_line():
    eta = np.outer([0.1, 0.2], X)
    eta[0, 10:30] = np.nan
    eta[1, :] = np.nan
    slopes = line_slopes(X, eta)
    assert slopes[0] == pytest.approx(0.1, abs=1e-12)
    assert math.isnan(slopes[1])


def test_the_error_of_a_line_is_none_and_that_of_a_sine_is_known():
    assert line_approximation_error(X, np.outer([0.1, 0.5], X)) < 1e-15
    # First mode: sin(πx/w) is 4/π²·6/w·x at best; what is left has the rms √(1/2 − 48/π⁴).
    x = np.linspace(-WIDTH / 2.0, WIDTH / 2.0, 6001)
    wave = 2e-3 * np.sin(math.pi * x / WIDTH)
    assert line_slopes(x, wave[np.newaxis])[0] == pytest.approx(
        2e-3 * 24.0 / (math.pi**2 * WIDTH), rel=1e-3
    )
    expected = 2e-3 * math.sqrt(0.5 - 48.0 / math.pi**4)
    assert line_approximation_error(x, wave[np.newaxis]) == pytest.approx(expected, rel=2e-3)


def test_effective_height_of_a_decaying_line():
    t = np.linspace(1.0, 2.0, 2001)
    rate, omega = 1.5, 22.5
    theta = 0.1 * np.exp(-rate * (t - 1.0)) * np.cos(omega * (t - 1.0))
    x = np.linspace(-WIDTH / 2.0, WIDTH / 2.0, 601)
    # Mean of x² over the width is w²/12; that of θ² by the closed integral of the damped cosine.
    z = 2.0 * rate
    decay = (1.0 - math.exp(-z)) / z
    w2 = 2.0 * omega
    swing = (z - math.exp(-z) * (z * math.cos(w2) - w2 * math.sin(w2))) / (z**2 + w2**2)
    expected = math.sqrt(WIDTH**2 / 12.0 * 0.01 * 0.5 * (decay + swing))
    assert effective_height(t, x, np.outer(theta, x)) == pytest.approx(expected, rel=1e-4)


def test_differences_pool_the_repetitions_as_mean_squares():
    t = np.linspace(0.0, 1.0, 101)
    flat = np.zeros((len(t), len(X)))
    raised = np.stack([flat + 1e-3, flat + 3e-3])
    assert effective_difference(t, X, raised, np.zeros(len(t))) == pytest.approx(math.sqrt(5e-6))
    # Against its own line a straight surface differs by nothing, against another by θ·w/√12.
    line = np.outer(np.full(len(t), 0.2), X)
    assert effective_difference(t, X, line, np.full(len(t), 0.2)) < 1e-15
    assert effective_difference(t, X, line, np.full(len(t), 0.1)) == pytest.approx(
        0.1 * WIDTH / math.sqrt(12.0), rel=1e-3
    )


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: line_slopes(X, np.zeros(61)), r"shape \(61,\)"),
        (lambda: line_approximation_error(X, np.full((2, 61), np.nan)), "no frame"),
        (lambda: effective_height([0.0], X, np.zeros((1, 61))), "two whole frames"),
        (lambda: effective_height([0.0, 1.0], X, np.zeros((3, 61))), "does not match"),
        (
            lambda: effective_difference([0.0, 1.0], X, np.zeros((2, 61)), np.zeros(5)),
            "slopes",
        ),
    ],
)
def test_what_does_not_match_is_refused(call, match):
    with pytest.raises(SloshMotionError, match=match):
        call()
