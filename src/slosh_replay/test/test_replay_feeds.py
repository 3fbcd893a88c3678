"""Tests that the monitor gets recorded data as it would have got them live."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_estimator.comparison import EstimatePoint, MeasuredPoint
from slosh_estimator.limits import Hysteresis
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.validity import EstimateFlag
from slosh_replay.recording.heights import Measurements
from slosh_replay.replay.monitor_feed import CHECK_NS, MonitoredHeights, MonitorFeed
from slosh_replay.replay.series import chosen

MS = 1_000_000
START = 10**18
LIMITS = MonitorSettings(measured_limit=0.01, estimated_limit=0.012, disagreement_limit=0.004)


def run(seed, seconds=2.0):
    """Returns estimates at 250 Hz and images at 60 Hz with gaps and equal stamps."""
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
    moved = np.column_stack((np.sin(20.0 * t) * (np.sin(0.7 * t) > 0.3), 0.0 * t, 0.0 * t))
    estimates = MonitoredHeights(
        stamps, wave, 1.1 * wave, flags, azimuths=0.3 + 0.0 * t, accelerations=3.0 * moved
    )
    height = np.interp(images, stamps, wave) if len(stamps) else np.zeros(len(images))
    height = height + 0.004 * (random.random(len(images)) < 0.1)
    measured = Measurements(
        images, np.where(random.random(len(images)) < 0.05, np.nan, height),
        np.where(random.random(len(images)) < 0.1, 1, 0), np.full(len(images), 1e-4),
        np.zeros(len(images)), height * np.exp(1j * np.where(images % 7, 0.3, np.nan)),
        np.full(len(images), np.nan), 0.5 * height,
    )  # fmt: skip
    return estimates, measured


def one_by_one(estimates, measured, settings=LIMITS):
    """Returns comparisons, events and motions of a monitor that gets single messages."""
    points = [
        EstimatePoint(*row, acceleration=tuple(felt), azimuth=azimuth)
        for row, felt, azimuth in zip(
            rows_of(estimates[:4]),
            estimates.accelerations.tolist(),
            estimates.azimuths.tolist(),
            strict=True,
        )
    ]
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
            (stamp, 2, MeasuredPoint(stamp, height, stddev, flags, wave, axis, level))
            for stamp, height, flags, stddev, _, wave, axis, level in rows_of(measured)
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
    return found, monitor.take_events(), monitor.motions


def rows_of(table):
    return zip(*(column.tolist() for column in table), strict=True)


def same(a, b):
    """Returns whether two values are equal, with NaN equal to itself."""
    return repr(a) == repr(b)


@pytest.mark.long
@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.integers(0, 2000), max_size=5),
    st.sampled_from([None, 0, 300, -300]),
    st.sampled_from([2.0, 12.0]),
)
def test_the_monitor_is_fed_as_if_message_by_message(seed, cuts, delay, seconds):
    estimates, measured = run(seed, seconds)
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
    comparisons, expected, motions = one_by_one(estimates, measured)
    assert same(found, comparisons)
    assert same(events, expected)
    assert same(feed.monitor.motions.take_finished(), motions.take_finished())
    assert feed.monitor.motions.warning == motions.warning


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


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.lists(st.integers(0, 2000), max_size=3))
def test_changed_limits_give_the_same_events_as_live(seed, moments):
    """Tests that changed limits give the same events in a replay as live."""
    estimates, measured = run(seed)
    random = np.random.default_rng(seed)
    patient = replace(LIMITS, timeout=1e6)  # who is silent at which moment differs live
    wanted = [
        replace(
            patient,
            measured_limit=random.uniform(0.003, 0.015),
            estimated_limit=random.uniform(0.003, 0.015),
            disagreement_limit=random.uniform(0.001, 0.005),
            hysteresis=Hysteresis(random.uniform(0.5, 1.0), int(random.integers(200)) * MS),
        )
        for _ in moments
    ]
    messages = [(row[0], 1, EstimatePoint(*row)) for row in rows_of(estimates[:4])]
    messages += [
        (stamp + 40 * MS, 2, MeasuredPoint(stamp, height, stddev, flags))
        for stamp, height, flags, stddev, *_ in rows_of(measured)
    ]
    changes = [(START + at * MS, 0, one) for at, one in zip(sorted(moments), wanted, strict=True)]
    live, published = Monitor(patient), []
    for arrival, kind, news in sorted([*changes, *messages], key=lambda entry: entry[:2]):
        if kind == 0:
            published.append((live.change_settings(news), news))
        else:
            (live.add_estimate if kind == 1 else live.add_measurement)(news, arrival)
    replayed = MonitorFeed(patient, published)
    replayed.add(estimates, measured)
    assert told(replayed.take_events()) == told(live.take_events())


def told(events):
    """Returns the contents of events without their numbers, in order."""
    return sorted((e.source, e.stamp_ns, e.kind, e.limit, e.peak, e.description) for e in events)
