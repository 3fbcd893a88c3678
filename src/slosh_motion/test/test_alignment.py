"""Tests that the clock offset is found from the motion, with its uncertainty."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_motion.errors import SloshMotionError
from slosh_motion.signals.alignment import (
    DISTINCT,
    despike,
    estimate_clock_offset,
    find_onset,
    find_still_level,
)
from slosh_motion.signals.clock_drift import ClockDriftWatch, estimate_clock_drift

MODEL_T = np.arange(0.0, 5.0, 0.002)


def motion(t):
    """Returns a height [m] that rises, oscillates and decays as in a robot's motion."""
    envelope = np.where((t > 0.0) & (t < 5.0), np.sin(np.pi * t / 5.0) ** 2, 0.0)
    return 0.02 * envelope * (1.0 + 0.6 * np.sin(6.0 * t + 2.0 * np.sin(2.0 * t)))


def record(offset, *, level=0.003, noise=2e-4, gain=1.0, seed=0, end=30.0):
    t = np.arange(0.0, end, 1.0 / 60.0)
    rng = np.random.default_rng(seed)
    return t, level + gain * motion(t - offset) + noise * rng.standard_normal(t.size)


@settings(deadline=None, max_examples=15)
@given(
    offset=st.floats(3.0, 20.0),
    level=st.floats(-0.01, 0.01),
    gain=st.floats(0.7, 1.4),
    seed=st.integers(0, 99),
)
def test_offset_is_found_whatever_level_gain_and_noise(offset, level, gain, seed):
    t, height = record(offset, level=level, gain=gain, seed=seed)
    found = estimate_clock_offset(t, height, MODEL_T, motion(MODEL_T))
    assert found.offset == pytest.approx(offset, abs=0.02)
    assert found.unambiguous
    assert abs(found.offset - offset) < 4.0 * found.stddev + 1e-3


def test_a_model_much_too_low_is_not_laid_over_the_quiet_part():
    t, height = record(8.0, gain=6.0, end=60.0)
    found = estimate_clock_offset(t, height, MODEL_T, motion(MODEL_T))
    # Over still liquid the model's own height would be the whole, far smaller residual.
    still = np.sqrt(np.mean(motion(MODEL_T) ** 2))
    assert found.rms > still
    assert found.offset == pytest.approx(8.0, abs=0.1)


def test_a_quiet_part_that_reaches_beyond_the_peak_is_no_still_level():
    t = np.arange(0.0, 12.0, 1.0 / 60.0)
    height = 0.005 + 3e-4 * np.random.default_rng(0).standard_normal(t.size)
    height[360:366] = 0.03
    height[366:] = 0.009
    assert find_still_level(t, height).level == pytest.approx(0.005, abs=2e-4)


def test_outliers_move_neither_offset_nor_onset():
    t, height = record(8.0)
    spiked = height.copy()
    spiked[[100, 300, 900]] += 0.05
    clean = estimate_clock_offset(t, height, MODEL_T, motion(MODEL_T))
    found = estimate_clock_offset(t, spiked, MODEL_T, motion(MODEL_T))
    assert found.offset == pytest.approx(clean.offset, abs=1e-3)
    assert found.onset_offset == pytest.approx(clean.onset_offset, abs=0.02)


def test_despike_takes_spikes_and_no_crests():
    t = np.arange(0.0, 3.0, 1.0 / 60.0)
    crests = 0.03 * np.abs(np.sin(2.0 * np.pi * 3.0 * t))
    np.testing.assert_array_equal(despike(crests), crests)
    spiked = crests.copy()
    spiked[50] = 0.06
    assert np.flatnonzero(np.isnan(despike(spiked))).tolist() == [50]


def test_a_periodic_series_is_ambiguous():
    t = np.arange(0.0, 30.0, 1.0 / 60.0)
    wave = np.where((t > 8.0) & (t < 28.0), 0.01 * np.sin(2.0 * np.pi * 3.0 * t), 0.0)
    wave += 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    model = 0.01 * np.sin(2.0 * np.pi * 3.0 * MODEL_T)
    found = estimate_clock_offset(t, wave, MODEL_T, model, centre=12.1)
    assert found.runner_up < DISTINCT
    assert np.isfinite(found.stddev)  # it is not the window's edge that makes it doubtful
    assert not found.unambiguous


def test_a_record_that_ends_within_the_motion_is_refused():
    t, height = record(8.0, end=10.8)
    with pytest.raises(SloshMotionError, match="does not cover"):
        estimate_clock_offset(t, height, MODEL_T, motion(MODEL_T))


def test_a_record_without_quiet_part_is_refused():
    t = np.arange(0.0, 3.0, 0.02)
    with pytest.raises(SloshMotionError, match="at rest before the motion"):
        find_still_level(t, 0.01 * np.cos(t))


def test_no_onset_is_refused():
    t = np.arange(0.0, 3.0, 0.02)
    with pytest.raises(SloshMotionError, match="no motion"):
        find_onset(t, np.zeros_like(t), 1e-3)


@pytest.mark.parametrize("rate", [0.015, -0.004, 0.002])
def test_a_clock_that_drifts_is_told_in_ppm(rate):
    t, height = record(8.0, noise=5e-5)
    drifted = 8.0 + (t - 8.0) * (1.0 + rate)  # as the other clock stamps them
    found = estimate_clock_drift(drifted, height - 0.003, MODEL_T, motion(MODEL_T), 8.0)
    assert found.rate == pytest.approx(rate, abs=max(4.0 * found.stddev, 0.02 * abs(rate)))
    assert found.stddev < 2e-4
    assert found.seen
    assert f"{1e6 * abs(found.rate):.0f} ± " in found.text()
    assert ("fast" in found.text()) == (rate > 0.0)


# Offset and drift of the heights' clock, followed motion by motion.


def wave(t: np.ndarray, frequency: float) -> np.ndarray:
    """Returns a wave [m] that a motion starts and that decays."""
    since = np.clip(t, 0.0, None)
    return 0.01 * np.abs(np.sin(frequency * since)) * since * np.exp(1.0 - since)


def watched(
    count: int, rate: float = 0.0, offset: float = 0.0, frequency: float = 19.0
) -> ClockDriftWatch:
    """Returns a watch after motions 8 s apart, with a model frequency of 19 rad/s."""
    watch, random = ClockDriftWatch(), np.random.default_rng(4)
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
    watch = ClockDriftWatch()
    t = np.arange(0.0, 5.0, 0.02)
    watch.add(t, np.zeros_like(t), np.zeros_like(t), (1.0, 3.0))
    watch.add(t, np.full_like(t, np.nan), wave(t - 1.0, 19.0), (1.0, 3.0))
    watch.add(t[:10], wave(t[:10], 19.0), wave(t[:10], 19.0), (0.0, 1.0))
    assert (watch.line, watch.facts(), watch.text()) == (None, {}, "")


def test_images_with_one_stamp_or_out_of_order_do_no_harm() -> None:
    watch = ClockDriftWatch()
    t = np.repeat(np.arange(-2.0, 5.0, 0.02), 2)
    t[100] -= 1.0
    for _ in range(2):
        watch.add(t, wave(t - 0.03, 19.0), wave(t, 19.0), (0.0, 3.0))
    assert watch.facts()["clock offset [ms]"].startswith("30.")
    watch.add(np.zeros(30), np.zeros(30), np.zeros(30), (0.0, 3.0))
