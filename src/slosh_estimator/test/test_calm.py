"""Tests whether the liquid is calm, and when it will be."""

import math

import pytest

from slosh_estimator.observer.calm import CalmReason, CalmWatch
from slosh_estimator.observer.states import FusedState

SECOND = 1_000_000_000
STATE = FusedState(
    10 * SECOND, 10 * SECOND, 0.0, 0.0, 0.0, 0.0, 1e-4, 1e-4, 1e-4, [0.0] * 4, 1.0, 1.0, 0.01, 0.1,
    0.004, 1e-4, 0.2, None, 0.0, 0.0, 0.004 + 1.645e-4, 0.004 + 3.1e-4,
    0.15,
)  # fmt: skip


def changed(**fields):
    """Returns a copy of a fused state with changed fields, and the filter's bounds."""
    state = STATE._replace(**fields)
    height, stddev = state.envelope, state.envelope_stddev
    return state._replace(bound=height + 1.645 * stddev, sure_bound=height + 3.1 * stddev)


def test_the_wait_is_that_of_an_exponential_decay():
    state = CalmWatch(1e-3).update(STATE)
    assert state.reason is CalmReason.SETTLING
    assert state.wait == pytest.approx(math.log(4.0) / 0.2)
    assert state.bound == pytest.approx(0.004 + 1.645e-4)
    assert 0.0 < state.shortest < state.wait < state.longest
    # That time later the envelope is the tolerance.
    assert 0.004 * math.exp(-0.2 * state.wait) == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("envelope", "stddev", "reason"),
    [
        (1e-4, 1e-4, CalmReason.CALM),
        (9e-4, 1e-5, CalmReason.CALM),
        (9e-4, 1e-4, CalmReason.UNSURE),
        (1.1e-3, 1e-5, CalmReason.SETTLING),
        (math.nan, 1e-5, CalmReason.UNSURE),
    ],
)
def test_a_wave_must_surely_be_within_the_tolerance(envelope, stddev, reason):
    state = changed(envelope=envelope, envelope_stddev=stddev)
    assert CalmWatch(1e-3).update(state).reason is reason


def test_calm_lasts_until_the_bound_is_clearly_above():
    watch = CalmWatch(1e-3)
    assert watch.update(changed(envelope=5e-4)).calm
    assert watch.update(changed(envelope=1.0e-3)).calm
    assert not watch.update(changed(envelope=1.1e-3)).calm
    assert not watch.update(changed(envelope=9e-4)).calm


def test_a_moving_container_and_a_start_without_measurements_are_not_calm():
    still = changed(envelope=1e-5)
    moved = still._replace(moved_ns=still.stamp_ns - SECOND // 10)
    watch = CalmWatch(1e-3)
    assert watch.update(moved).reason is CalmReason.MOVING
    assert watch.update(still._replace(stamp_ns=still.stamp_ns + SECOND)).calm
    blind, watch = still._replace(corrected_ns=None), CalmWatch(1e-3)
    assert watch.update(blind).reason is CalmReason.UNSURE
    assert watch.update(blind._replace(stamp_ns=blind.stamp_ns + SECOND)).calm
