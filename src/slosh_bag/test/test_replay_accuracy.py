"""Which samples enter σ and ε, and which do not."""

from __future__ import annotations

import numpy as np
import pytest

from slosh_bag.errors import SloshBagError
from slosh_bag.replay_accuracy import Estimates, Measurements, compare, compare_unrelated
from slosh_estimator.monitor import SATURATED, UNUSABLE
from slosh_estimator.validity import EstimateFlag

STAMPS = np.arange(0, 1_000_000_000, 10_000_000, dtype=np.int64)
HEIGHT = 0.02


def estimates(flags=0, stamps=STAMPS, height=HEIGHT):
    ones = np.ones(len(stamps))
    return Estimates(
        ("3D-NL",), stamps, height * ones[:, None], np.full(len(stamps), flags), 3.0 * ones
    )


def measurements(heights, flags=0, stamps=STAMPS):
    heights = np.broadcast_to(heights, stamps.shape).astype(float)
    return Measurements(stamps, heights, np.broadcast_to(flags, stamps.shape).astype(np.int64))


def accuracy(measured, model=None):
    return compare("run", "accel", model or estimates(), measured).accuracy[0]


def test_a_saturated_height_counts_only_above_the_estimate():
    """It is a lower bound: below the estimate it contradicts nothing."""
    heights = np.where(np.arange(len(STAMPS)) < 60, 0.005, 0.03)
    row = accuracy(measurements(heights, SATURATED))
    assert row.count == 40
    assert row.sigma == pytest.approx(0.01)


def test_unusable_heights_do_not_count():
    flags = np.where(np.arange(len(STAMPS)) < 30, UNUSABLE, 0)
    assert accuracy(measurements(0.01, flags)).count == 70


def test_estimates_from_an_unknown_state_do_not_count():
    model = estimates(int(EstimateFlag.SETTLING))
    with pytest.raises(SloshBagError, match="do both sides use one clock"):
        accuracy(measurements(0.01), model)


def test_there_is_no_estimate_within_a_gap_or_outside():
    stamps = np.concatenate((STAMPS[10:30], STAMPS[50:90]))
    result = compare("run", "accel", estimates(stamps=stamps), measurements(0.01))
    known = np.isfinite(result.heights["3D-NL"])
    np.testing.assert_array_equal(np.flatnonzero(known), [*range(10, 30), *range(50, 90)])


def test_still_level_is_taken_off_where_the_clocks_are_unrelated():
    t = np.arange(0.0, 12.0, 1 / 60)

    def wave(x):
        inside = (x > 0.0) & (x < 4.0)
        return np.where(inside, 0.02 * np.sin(np.pi * x / 4.0) ** 2 * (2 + np.sin(7 * x)), 0.0)

    model_stamps = np.arange(0, 4_000_000_000, 2_000_000, dtype=np.int64)
    model = Estimates(
        ("3D-NL",),
        model_stamps,
        wave(model_stamps * 1e-9)[:, None],
        np.zeros(len(model_stamps), dtype=np.int64),
        np.full(len(model_stamps), 3.0),
    )
    stamps = np.rint(t * 1e9).astype(np.int64)
    measured = measurements(0.004 + wave(t - 5.0), stamps=stamps)
    result = compare_unrelated("run", "pose", model, measured)
    row = result.accuracy[0]
    assert result.still.level == pytest.approx(0.004)
    assert row.clock.offset == pytest.approx(5.0, abs=2e-3)
    assert row.sigma < 2e-4


def test_a_container_that_does_not_move_is_refused():
    still = estimates()._replace(acceleration=np.zeros(len(STAMPS)))
    with pytest.raises(SloshBagError, match="does not move"):
        compare_unrelated("run", "pose", still, measurements(0.0))
