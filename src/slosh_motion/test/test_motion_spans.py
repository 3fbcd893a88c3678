"""Tests that motions are found equally in whole series and in parts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_motion.signals.motion_spans import (
    AFTER_NS,
    MOVING,
    PAUSE_NS,
    TURNING,
    MotionFinder,
    motion_spans,
)

MS = 1_000_000
START = 10**18
RATE = 500
NS = 10**9


def accelerations(*pieces, noise=0.0, seed=0):
    """Returns stamps and accelerations at 500 Hz from pieces of (seconds, size [m/s²])."""
    sizes = np.concatenate([np.full(round(seconds * RATE), size) for seconds, size in pieces])
    values = np.column_stack((sizes, np.zeros((len(sizes), 2))))
    values += noise * np.random.default_rng(seed).standard_normal(values.shape)
    return START + 2 * MS * np.arange(len(sizes)), values


def spans_of(stamps, values, block=10**9):
    finder = MotionFinder()
    for start in range(0, len(stamps), block):
        finder.add(stamps[start : start + block], values[start : start + block])
    finder.finish()
    return [((s.start_ns - START) / NS, (s.end_ns - START) / NS) for s in finder.spans]


def test_a_motion_is_where_the_container_is_accelerated():
    assert spans_of(*accelerations((1.0, 0.0), (2.0, 1.0), (1.0, 0.0))) == [(1.0, 3.0)]
    assert spans_of(*accelerations((3.0, 0.9 * MOVING))) == []
    assert spans_of(*accelerations((0.5, 0.0), (2.5, 1.1 * MOVING))) == [(0.5, 3.0)]


@pytest.mark.parametrize("offset", [0.2, 0.855, 9.81])
def test_a_constant_from_the_beginning_on_is_no_motion(offset):
    """Tests that a constant acceleration from the start on is not a motion."""
    stamps, values = accelerations((2.0, 0.0), (1.0, 1.0), (2.0, 0.0), (1.0, -1.0), (2.0, 0.0))
    values[:, 1] += offset
    assert spans_of(stamps, values) == [(2.0, 3.0), (5.0, 6.0)]


def test_a_constant_that_comes_again_is_that_of_rest():
    """Tests that a constant acceleration that recurs is taken as rest."""
    pieces = [(0.3, 2.0), (1.5, 0.0), (0.3, 2.0), (0.3, -2.0), (3.0, 0.0), (0.5, 1.0), (2.0, 0.0)]
    stamps, values = accelerations(*pieces)
    values[:, 1] += 0.855
    found = spans_of(stamps, values)
    assert len(found) == 2
    assert found[0] == (0.0, pytest.approx(3.2, abs=0.5))
    assert found[1] == pytest.approx((5.4, 5.9), abs=0.051)


def test_a_constant_that_appears_later_is_a_rest_once_no_arm_could_follow_it():
    """Tests that a constant which no arm can follow is taken as rest, not as motion."""
    stamps, values = accelerations((1.0, 0.0), (8.0, 1.0), (1.0, 3.0), (3.0, 1.0))
    found = spans_of(stamps, values)
    assert len(found) == 2
    assert found[0] == (1.0, pytest.approx(6.0, abs=0.1))
    assert found[1] == (9.0, 10.0)


@pytest.mark.parametrize(("pause", "motions"), [(0.5, 1), (0.95, 1), (1.0, 2), (3.0, 2)])
def test_a_pause_of_a_second_separates_motions(pause, motions):
    found = spans_of(*accelerations((1.0, 0.0), (1.0, 1.0), (pause, 0.0), (1.0, 1.0)))
    assert len(found) == motions
    assert PAUSE_NS == NS


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 700))
def test_the_size_of_the_blocks_does_not_matter(seed, block):
    random = np.random.default_rng(seed)
    pieces = [(random.uniform(0.1, 2.0), random.choice([0.0, 1.0])) for _ in range(5)]
    stamps, values = accelerations(*pieces, noise=0.1, seed=seed)
    assert spans_of(stamps, values, block) == spans_of(stamps, values)


def test_moments_belong_to_the_motion_before_them_for_a_while():
    stamps, values = accelerations((1.0, 0.0), (1.0, 1.0), (3.0, 0.0), (1.0, 1.0), (3.0, 0.0))
    finder = MotionFinder()
    finder.add(stamps, values)
    finder.finish()
    moments = START + np.array([0.5, 1.0, 1.9, 2.9, 3.1, 4.9, 5.5, 6.9, 7.1, 8.0]) * NS
    numbers = finder.number_at(moments.astype(np.int64))
    assert numbers.tolist() == [-1, 0, 0, 0, -1, -1, 1, 1, -1, -1]
    assert finder.number_at(moments[:0].astype(np.int64)).tolist() == []


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000))
def test_sample_by_sample_is_as_all_at_once(seed):
    random = np.random.default_rng(seed)
    pieces = [(random.uniform(0.1, 2.0), random.choice([0.0, 1.0])) for _ in range(5)]
    stamps, values = accelerations(*pieces, noise=0.1, seed=seed)
    finder = MotionFinder()
    for stamp, value in zip(stamps.tolist(), values.tolist(), strict=True):
        finder.add_one(stamp, tuple(value))
    finder.finish()
    assert finder.spans == motion_spans(stamps, values)


def test_a_sample_that_is_not_finite_is_left_out():
    stamps, values = accelerations((1.0, 0.0), (1.0, 1.0), (1.0, 0.0))
    finder = MotionFinder()
    for stamp, value in zip(stamps.tolist(), values.tolist(), strict=True):
        finder.add_one(stamp, tuple(value))
        finder.add_one(stamp, (np.nan, 0.0, 0.0))
    finder.finish()
    assert finder.spans == motion_spans(stamps, values)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_tilting_moves_the_liquid_and_yaw_does_not(axis):
    stamps, rates = accelerations((1.0, 0.0), (1.0, 1.1 * TURNING), (1.0, 0.0))
    turning = np.roll(rates, axis, axis=1)
    expected = [] if axis == 2 else [(START + NS, START + 2 * NS)]
    assert motion_spans(stamps, np.zeros_like(rates), turning) == expected
    assert motion_spans(stamps, np.zeros_like(rates), 0.8 * turning) == []


def test_the_first_motion_is_forgotten_and_what_goes_on_is_another():
    stamps, values = accelerations((1.0, 1.0), (2.0, 0.0), (1.5, 1.0))
    finder = MotionFinder()
    finder.add(stamps[: 4 * RATE + 1], values[: 4 * RATE + 1])
    finder.forget_first()
    assert finder.spans == [(START + 3 * NS, START + 4 * NS)]
    finder.forget_first()
    finder.add(stamps[4 * RATE + 1 :], values[4 * RATE + 1 :])
    finder.finish()
    assert finder.spans == [(START + 4 * NS, START + round(4.5 * NS))]


def test_a_motions_liquid_counts_no_longer_than_the_pause():
    """Tests that the liquid's decay after a motion ends before another motion can begin."""
    assert AFTER_NS <= PAUSE_NS
