"""Tests the detection of old images with new noise while the liquid moves."""

import cmath

import numpy as np
import pytest

from slosh_estimator.comparison import Condition, EstimatePoint, MeasuredPoint
from slosh_estimator.height_checks import RepeatedHeights
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.sight import FROZEN

FREQUENCY = 19.0
SIGMA = 8e-5


def wave(t: float, rotating: bool, size: float = 0.012) -> complex:
    phase = FREQUENCY * t
    return size * (cmath.exp(1j * phase) if rotating else complex(np.sin(phase)))


def flagged(
    rate: float, shown: list[float], *, rotating: bool, vectors: bool = True, seen: float = 0.012
) -> list[bool]:
    """Returns which measurements are flagged as repeated, for images of given times."""
    watch, random = RepeatedHeights(), np.random.default_rng(3)
    found = []
    for k, moment in enumerate(shown):
        stamp = round(1e9 * k / rate)
        told, is_seen = wave(k / rate, rotating), wave(moment, rotating, seen)
        is_seen += complex(*random.normal(0.0, SIGMA, 2))
        expected = EstimatePoint(stamp, abs(told), abs(told), azimuth=cmath.phase(told)).expected
        point = MeasuredPoint(stamp, abs(is_seen), SIGMA)
        found.append(watch.look(point._replace(wave=is_seen) if vectors else point, expected))
    return found


@pytest.mark.parametrize("rotating", [True, False])
@pytest.mark.parametrize("rate", [30.0, 60.0])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_old_pictures_in_turn_are_told(rotating: bool, rate: float, count: int) -> None:
    begin = round(0.62 * rate)
    shown = [k / rate for k in range(begin)]
    shown += [(begin - count + k % count) / rate for k in range(60)]
    found = flagged(rate, shown, rotating=rotating)
    assert not any(found[:begin])
    told = found[begin + 5 * count :]
    # One that shows hardly a wave is told, if at all, by the other side's wave.
    assert sum(told) > len(told) / (2 * count)


@pytest.mark.first(8)
@pytest.mark.parametrize("rotating", [True, False])
@pytest.mark.parametrize("vectors", [True, False])
@pytest.mark.parametrize("rate", [12.0, 15.0, 18.0, 25.0, 30.0, 60.0, 120.0])
def test_new_pictures_are_not_told(rotating: bool, vectors: bool, rate: float) -> None:
    for seen in (0.012, 0.006, 0.003):  # whatever gain the model has
        for late in (0.0, 0.03, 0.08):
            shown = [k / rate - late for k in range(round(4.0 * rate))]
            assert not any(flagged(rate, shown, rotating=rotating, vectors=vectors, seen=seen))


def test_the_monitor_believes_none_of_them() -> None:
    monitor = Monitor(MonitorSettings(disagreement_limit=0.05))
    found = []
    for k in range(240):
        stamp, told = round(1e9 * k / 60.0), wave(k / 60.0, False)
        seen = wave(min(k, 113) / 60.0, False)
        direction = {"azimuth": cmath.phase(told)}
        monitor.add_estimate(EstimatePoint(stamp, abs(told), abs(told), **direction), stamp)
        found += monitor.add_measurement(MeasuredPoint(stamp, abs(seen), SIGMA, 0, seen), stamp)
    assert not any(one.measured_flags & FROZEN for one in found[:114])
    assert all(one.measured_flags & FROZEN for one in found[122:])
    assert found[-1].state is Condition.BLIND
    assert "FROZEN" in monitor.blindness(round(1e9 * 240 / 60.0))
