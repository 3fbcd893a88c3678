"""The monitor gets a recording as it would have come; motions are found however it is cut."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_bag.recording.heights import Measurements
from slosh_bag.replay.columns import chosen
from slosh_bag.replay.monitor_feed import CHECK_NS, Heights, MonitorFeed
from slosh_bag.replay.motions import BIN_NS, MOVING, PAUSE_NS, MotionFinder
from slosh_estimator.monitor import EstimatePoint, MeasuredPoint, Monitor, MonitorSettings
from slosh_estimator.validity import EstimateFlag

MS = 1_000_000
START = 10**18
LIMITS = MonitorSettings(measured_limit=0.01, estimated_limit=0.012, disagreement_limit=0.004)


def run(seed, seconds=2.0):
    """Estimates at 250 Hz and images at 60 Hz with gaps, silences and equal stamps."""
    random = np.random.default_rng(seed)
    stamps = START + 4 * MS * np.arange(round(seconds * 250))
    images = START + np.unique(np.rint(np.arange(seconds * 60) / 60 * 250).astype(int)) * 4 * MS
    images = images + np.where(random.random(len(images)) < 0.5, 0, MS)
    for _ in range(2):
        gap = START + int(random.integers(seconds * 1000)) * MS
        width = int(random.integers(700)) * MS
        stamps = stamps[(stamps < gap) | (stamps > gap + width)]
        gap = START + int(random.integers(seconds * 1000)) * MS
        images = images[(images < gap) | (images > gap + width)]
    t = (stamps - START) * 1e-9
    wave = 0.015 * np.sin(2.0 * t) * np.sin(20.0 * t)
    flags = np.where(random.random(len(t)) < 0.02, int(EstimateFlag.SETTLING), 0)
    estimates = Heights(stamps, wave, 1.1 * wave, flags)
    height = np.interp(images, stamps, wave) if len(stamps) else np.zeros(len(images))
    height = height + 0.004 * (random.random(len(images)) < 0.1)
    measured = Measurements(
        images, np.where(random.random(len(images)) < 0.05, np.nan, height),
        np.where(random.random(len(images)) < 0.1, 1, 0), np.full(len(images), 1e-4),
        np.zeros(len(images)),
    )  # fmt: skip
    return estimates, measured


def one_by_one(estimates, measured, settings=LIMITS):
    """As the node would have been called: message by message, and by its timer."""
    points = [EstimatePoint(*row) for row in rows_of(estimates[:4])]
    if estimates.readings is not None:
        points = [
            point._replace(reading=tuple(read), delay_ns=delay)
            for point, read, delay in zip(
                points, estimates.readings.tolist(), estimates.delays.tolist(), strict=True
            )
        ]
    entries = [
        *((point.stamp_ns, 1, point) for point in points),
        *(
            (stamp, 2, MeasuredPoint(stamp, height, stddev, flags))
            for stamp, height, flags, stddev, _ in rows_of(measured)
        ),
    ]
    entries.sort(key=lambda entry: entry[:2])
    monitor, found, tick = Monitor(settings), [], None
    for stamp, kind, point in entries:
        if tick is None or stamp - tick > 100 * CHECK_NS:
            tick = stamp
        while tick <= stamp:
            found += monitor.check(tick)
            tick += CHECK_NS
        if kind == 1:
            found += monitor.add_estimate(point, stamp)
        else:
            found += monitor.add_measurement(point, stamp)
    return found, monitor.take_events()


def rows_of(table):
    return zip(*(column.tolist() for column in table), strict=True)


def same(a, b):
    """Equal to the last bit, with NaN equal to itself."""
    return repr(a) == repr(b)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.integers(0, 2000), max_size=5),
    st.sampled_from([None, 0, 300, -300]),
)
def test_the_monitor_is_fed_as_if_message_by_message(seed, cuts, delay):
    estimates, measured = run(seed)
    if delay is not None:
        heights = np.column_stack((estimates.linear, estimates.nonlinear))
        delays = np.full(len(heights), delay * MS)
        estimates = estimates._replace(readings=1.2 * heights, delays=delays)
    feed = MonitorFeed(LIMITS)
    found, events = [], []
    last = -(2**62)
    for moment in [*sorted(START + cut * MS for cut in cuts), 2**62]:
        parts = [
            chosen(side, (side.stamps > last) & (side.stamps <= moment))
            for side in (estimates, measured)
        ]
        found += feed.add(*parts)
        events += feed.take_events()
        last = moment
    comparisons, expected = one_by_one(estimates, measured)
    assert same(found, comparisons)
    assert same(events, expected)


def test_the_runs_above_have_everything_in_them():
    """Else the test above would say little."""
    stale, excesses, unmatched = 0, set(), 0
    for seed in range(12):
        found, events = one_by_one(*run(seed))
        stale += sum(row.measured_stale or row.estimate_stale for row in found)
        excesses |= {event.source for event in events}
        unmatched += sum(row.estimated_linear != row.estimated_linear for row in found)
    assert stale > 20
    assert len(excesses) == 3
    assert unmatched > 20


def test_a_silence_of_an_hour_costs_nothing():
    estimates, measured = run(0, 1.0)
    later = estimates._replace(stamps=estimates.stamps + 3600 * 1000 * MS)
    feed = MonitorFeed(LIMITS)
    feed.add(estimates, measured)
    calls = []
    check = feed.monitor.check
    feed.monitor.check = lambda now: calls.append(now) or check(now)
    feed.add(later, chosen(measured, slice(0)))
    assert 0 < len(calls) < 30


RATE = 500
NS = 10**9


def accelerations(*stretches, noise=0.0, seed=0):
    """Stamps and accelerations at 500 Hz: stretches of (seconds, size [m/s²])."""
    sizes = np.concatenate([np.full(round(seconds * RATE), size) for seconds, size in stretches])
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
    assert spans_of(*accelerations((3.0, 1.1 * MOVING))) == [(0.0, 3.0)]


def test_a_motion_that_lasts_to_the_end_is_one():
    assert spans_of(*accelerations((1.0, 0.0), (0.51, 1.0))) == [(1.0, 1.55)]


@pytest.mark.parametrize(("pause", "motions"), [(0.5, 1), (0.95, 1), (1.0, 2), (3.0, 2)])
def test_a_pause_of_a_second_separates_motions(pause, motions):
    found = spans_of(*accelerations((1.0, 1.0), (pause, 0.0), (1.0, 1.0)))
    assert len(found) == motions
    assert PAUSE_NS == NS


def test_noise_moves_nothing():
    stamps, values = accelerations((20.0, 0.0), noise=0.1)
    assert np.linalg.norm(values, axis=1).max() > 2 * MOVING
    assert spans_of(stamps, values) == []


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 700))
def test_the_size_of_the_blocks_does_not_matter(seed, block):
    random = np.random.default_rng(seed)
    stretches = [(random.uniform(0.1, 2.0), random.choice([0.0, 1.0])) for _ in range(5)]
    stamps, values = accelerations(*stretches, noise=0.1, seed=seed)
    assert spans_of(stamps, values, block) == spans_of(stamps, values)


def test_moments_belong_to_the_motion_before_them_for_a_while():
    stamps, values = accelerations((1.0, 0.0), (1.0, 1.0), (3.0, 0.0), (1.0, 1.0), (3.0, 0.0))
    finder = MotionFinder()
    finder.add(stamps, values)
    finder.finish()
    moments = START + np.array([0.5, 1.0, 1.9, 2.9, 3.1, 4.9, 5.5, 6.9, 7.1, 8.0]) * NS
    numbers = finder.number_at(moments.astype(np.int64), NS)
    assert numbers.tolist() == [-1, 0, 0, 0, -1, -1, 1, 1, -1, -1]
    assert finder.number_at(moments[:0].astype(np.int64), NS).tolist() == []


def test_moments_within_the_bin_that_is_being_filled_belong_to_its_motion():
    finder = MotionFinder()
    finder.add(*accelerations((1.0, 0.0), (0.03, 1.0)))
    assert finder.number_at(np.array([START + NS - 1, START + NS]), NS).tolist() == [-1, 0]
    assert finder.spans == []
    assert BIN_NS == 50 * MS


def test_there_are_no_motions_before_the_first():
    finder = MotionFinder()
    assert finder.number_at(np.array([START]), NS).tolist() == [-1]
