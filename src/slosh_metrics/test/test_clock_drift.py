"""Offset and drift of the heights' clock, followed motion by motion."""

import numpy as np
import pytest

from slosh_metrics.clock_drift import ClockWatch


def wave(t: np.ndarray, frequency: float) -> np.ndarray:
    """A wave that a motion raises and that decays."""
    since = np.clip(t, 0.0, None)
    return 0.01 * np.abs(np.sin(frequency * since)) * since * np.exp(1.0 - since)


def watched(
    count: int, rate: float = 0.0, offset: float = 0.0, frequency: float = 19.0
) -> ClockWatch:
    """What it knows after motions, eight seconds apart, of a model with the frequency of 19/s."""
    watch, random = ClockWatch(), np.random.default_rng(4)
    for number in range(count):
        start = 8.0 * number
        t = start + np.arange(-2.0, 5.0, 1.0 / 60.0)
        measured = wave((t - offset) / (1.0 + rate) - start, frequency)
        measured += random.normal(0.0, 1e-4, len(t))
        watch.add(t, measured, wave(t - start, 19.0), (start, start + 3.0))
    return watch


@pytest.mark.first(2)
@pytest.mark.parametrize("offset", [0.0, 0.04])
@pytest.mark.parametrize("rate", [0.005, -0.001, 0.0002])
def test_a_drift_is_told_in_ppm_with_its_error(rate: float, offset: float) -> None:
    watch = watched(12, rate, offset)
    assert watch.line is not None
    assert watch.line.rate == pytest.approx(rate, abs=4.0 * watch.line.rate_stddev)
    value, _, error = watch.facts()["clock drift [ppm]"].split()
    assert float(value) == pytest.approx(1e6 * rate, abs=4.0 * float(error))
    assert float(error) < 40.0
    assert ("fast" in watch.text()) == (rate > 0.0)
    assert "ppm" in watch.text()
    assert watch.is_sure


def test_a_constant_offset_is_told_and_is_no_drift() -> None:
    watch = watched(6, offset=0.04)
    assert set(watch.facts()) == {"clock offset [ms]"}
    assert watch.facts()["clock offset [ms]"].startswith("40.")
    assert "40 ± 1 ms late" in watch.text()


def test_a_wrong_frequency_is_no_drift_as_soon_as_motions_tell() -> None:
    one = watched(1, frequency=18.9)
    assert "or the liquid's frequency is not the model's" in one.text()
    assert not one.is_sure
    for count in (2, 6):
        assert "clock drift [ppm]" not in watched(count, frequency=18.9).facts()
        assert "ppm" not in watched(count, frequency=18.9).text()


def test_what_shows_no_wave_or_is_not_covered_says_nothing() -> None:
    watch = ClockWatch()
    t = np.arange(0.0, 5.0, 0.02)
    watch.add(t, np.zeros_like(t), np.zeros_like(t), (1.0, 3.0))
    watch.add(t, np.full_like(t, np.nan), wave(t - 1.0, 19.0), (1.0, 3.0))
    watch.add(t[:10], wave(t[:10], 19.0), wave(t[:10], 19.0), (0.0, 1.0))
    assert (watch.line, watch.facts(), watch.text()) == (None, {}, "")


def test_images_with_one_stamp_or_out_of_order_do_no_harm() -> None:
    watch = ClockWatch()
    t = np.repeat(np.arange(-2.0, 5.0, 0.02), 2)
    t[100] -= 1.0
    for _ in range(2):
        watch.add(t, wave(t - 0.03, 19.0), wave(t, 19.0), (0.0, 3.0))
    assert watch.facts()["clock offset [ms]"].startswith("30.")
    watch.add(np.zeros(30), np.zeros(30), np.zeros(30), (0.0, 3.0))
