"""Tests that values which a limit ignores may be left out."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slosh_estimator.comparison import EstimatePoint, MeasuredPoint
from slosh_estimator.limits import Hysteresis, LimitTracker, Source
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings

MS = 1_000_000
VALUES = st.one_of(st.floats(0.0, 0.02), st.just(float("nan")), st.sampled_from([0.009, 0.01]))
SERIES = st.lists(st.tuples(st.integers(1, 60), VALUES), min_size=1, max_size=60)
HOLDS = st.sampled_from([0, 40 * MS, 100 * MS])


def told(tracker: LimitTracker, stamps: list[int], values: list[float]) -> list[str]:
    """Returns the limit events of a series of values, as text."""
    found = [tracker.update(*row) for row in zip(stamps, values, strict=True)]
    return [repr(event) for event in found if event is not None]


@given(SERIES, SERIES, HOLDS, st.sampled_from([0.01, float("nan")]))
def test_values_that_cannot_matter_can_be_left_out(before, series, hold, limit) -> None:
    whole, less = (LimitTracker(Source.ESTIMATED, limit, Hysteresis(0.9, hold)) for _ in "ab")
    steps = np.cumsum([step for step, _ in before + series]) * MS
    stamps, values = steps.tolist(), [value for _, value in before + series]
    cut = len(before)
    for tracker in (whole, less):
        told(tracker, stamps[:cut], values[:cut])
    kept = less.can_matter(steps[cut:], np.array(values[cut:]))
    if less.ignores(values[cut:]):
        assert told(whole, stamps[cut:], values[cut:]) == []
        return
    rows = cut + np.flatnonzero(kept)
    expected = told(whole, stamps[cut:], values[cut:])
    assert told(less, steps[rows].tolist(), np.array(values)[rows].tolist()) == expected
    assert (whole.active, whole.identifier) == (less.active, less.identifier)


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(1, 900), max_size=4), st.booleans())
def test_many_estimates_are_as_one_by_one(seed: int, cuts: list[int], quiet: bool) -> None:
    random = np.random.default_rng(seed)
    t = np.arange(0.0, 9.0, 0.01)
    moved = 2.0 * np.sin(15.0 * t) * ((t % 4.5) < 1.5)
    height = (0.002 if quiet else 0.012) * np.abs(np.sin(15.0 * t)) + 0.0 * moved
    points = [
        EstimatePoint(
            10 * k * MS, h, h, 0, (float(a), 0.0, 0.0) if random.random() < 0.98 else None,
            azimuth=0.3,
        )
        for k, (h, a) in enumerate(zip(height.tolist(), moved.tolist(), strict=True))
    ]  # fmt: skip
    ends = sorted({*cuts, len(points)})
    results = []
    for many in (False, True):
        monitor = Monitor(MonitorSettings(estimated_limit=0.01, disagreement_limit=0.01))
        found, start = [], 0
        for end in ends:
            part, start = points[start:end], end
            if many:
                found += monitor.add_estimates(part)
            else:
                for point in part:
                    found += monitor.add_estimate(point, point.stamp_ns)
            if part:
                # Images of the last half second, on another side and lower.
                for point in part[-40::2]:
                    stamp = point.stamp_ns
                    seen = MeasuredPoint(stamp, 0.5 * point.nonlinear, 1e-4, 0, -0.5 + 0j)
                    found += monitor.add_measurement(seen, part[-1].stamp_ns)
            found += monitor.check(points[end - 1].stamp_ns)
        motions = monitor.motions
        results.append(
            repr(
                (found, monitor.take_events(), motions.take_finished(), motions.warning,
                 monitor.condition(points[-1].stamp_ns))
            )
        )  # fmt: skip
    assert results[0] == results[1]
