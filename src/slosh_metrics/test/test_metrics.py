import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_metrics.errors import SloshMetricsError
from slosh_metrics.metrics import (
    RunningAccuracy,
    mean_absolute_error,
    peak_error,
    rms_error,
    standard_error_of_estimate,
)

MEASURED = [0.01, 0.04, math.nan, 0.02]
MODEL = [0.02, 0.01, 0.09, 0.03]


def test_peak_error_is_a_signed_fraction_of_the_measured_peak() -> None:
    assert peak_error(MEASURED, MODEL) == pytest.approx(-0.25)


@pytest.mark.parametrize(
    "metric", [peak_error, mean_absolute_error, rms_error, standard_error_of_estimate]
)
def test_nothing_to_compare_is_an_error(metric: Callable[..., float]) -> None:
    with pytest.raises(SloshMetricsError, match="no finite moment"):
        metric([math.nan], [1.0])


def test_seoe_compares_every_repetition_with_the_one_simulation() -> None:
    assert standard_error_of_estimate([[1.0, 2.0], [3.0, 2.0]], [2.0, 2.0]) == pytest.approx(
        math.sqrt(0.5)
    )


def test_shapes_that_do_not_match_are_refused_with_both_shapes() -> None:
    with pytest.raises(SloshMetricsError, match=r"\(2,\).*\(3,\)"):
        mean_absolute_error([1, 2], [1, 2, 3])
    with pytest.raises(SloshMetricsError, match=r"\(2, 2\).*\(3,\)"):
        standard_error_of_estimate([[1, 2], [3, 4]], [1, 2, 3])


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
