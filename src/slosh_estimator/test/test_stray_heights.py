"""Tests that a single wrong image is detected, and that correct ones are not."""

import numpy as np
import pytest

from slosh_estimator.comparison import EstimatePoint, Expected, MeasuredPoint
from slosh_estimator.height_checks import StrayHeights
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.sight import AMBIGUOUS

FREQUENCY, SIGMA = 19.0, 8e-5


def heights(rate: float, gain: float, late: float, count: int = 120) -> tuple[np.ndarray, ...]:
    """Returns stamps [ns], measured heights and expected heights [m] of a sine wave."""
    t = np.arange(count) / rate
    size = 0.015 * np.clip(t / 0.5, 0.0, 1.0)
    noise = np.random.default_rng(3).normal(0.0, SIGMA, count)
    seen = size * np.abs(np.sin(FREQUENCY * t)) + noise
    expected = gain * size * np.abs(np.sin(FREQUENCY * (t - late)))
    return np.rint(1e9 * t).astype(int), seen, expected


def told(stamps: np.ndarray, seen: np.ndarray, expected: np.ndarray) -> list[bool]:
    watch = StrayHeights()
    return [
        watch.look(MeasuredPoint(int(t), float(m), SIGMA), Expected(nonlinear=float(e)))
        for t, m, e in zip(stamps, seen, expected, strict=True)
    ]


@pytest.mark.parametrize("rate", [15.0, 30.0, 60.0])
@pytest.mark.parametrize(("gain", "late"), [(1.0, 0.0), (0.8, 0.004), (1.2, 0.01)])
def test_an_old_picture_is_told_and_no_honest_one(rate: float, gain: float, late: float) -> None:
    stamps, seen, expected = heights(rate, gain, late)
    assert sum(told(stamps, seen, expected)) <= 0.01 * len(stamps)
    at = 60 + int(np.argmax(seen[60:80]))
    seen[at] -= 0.012
    assert told(stamps, seen, expected)[at]


def test_the_monitor_flags_it() -> None:
    monitor, flags = Monitor(MonitorSettings()), []
    stamps, seen, expected = heights(60.0, 1.0, 0.0)
    seen[90] += 0.006
    for t, height, estimate in zip(stamps.tolist(), seen.tolist(), expected.tolist(), strict=True):
        monitor.add_estimate(EstimatePoint(t, estimate, estimate), t)
        found = monitor.add_measurement(MeasuredPoint(t, height, SIGMA), t)
        flags += [one.measured_flags for one in found]
    assert np.flatnonzero(flags).tolist() == [90]
    assert flags[90] == AMBIGUOUS
