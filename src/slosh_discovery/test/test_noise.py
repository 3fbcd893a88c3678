"""Tests noise estimates and removable residuals against data with known noise."""

import math

import numpy as np
import pytest

from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.noise import (
    Noise,
    difference_noise,
    estimate_noise,
    is_white,
    removable,
    repeat_noise,
    still_noise,
    whiteness,
)
from slosh_model import Cylinder, Inputs, Model, simulate

MODEL = Model(Cylinder(0.05, 0.07))
T = np.arange(0.0, 8.0, 1.0 / 60.0)


def shaken(amplitude=3.0, frequency=2.8, cross=0.0, start=1.0):
    """Returns four seconds of shaking near resonance at 3 Hz, after a still part."""
    t = np.arange(0.0, 8.0, 0.002)
    envelope = np.where(
        (t > start) & (t < start + 4.0), np.sin(np.pi * np.clip((t - start) / 4.0, 0, 1)) ** 2, 0.0
    )
    a = np.zeros((len(t), 3))
    a[:, 0] = amplitude * envelope * np.sin(2.0 * np.pi * frequency * t)
    a[:, 1] = cross * amplitude * envelope * np.cos(2.0 * np.pi * frequency * t)
    return Inputs(t, a)


def measured(inputs, noise, seed=0, model=MODEL, t=T):
    response, _ = simulate(model, inputs)
    heights = np.interp(t, inputs.t, response.msh)
    return MeasuredMotion(
        "shaken", inputs, t, heights + noise * np.random.default_rng(seed).normal(size=len(t))
    )


@pytest.mark.parametrize("noise", [1e-4, 3e-4, 1e-3])
@pytest.mark.parametrize("cross", [0.0, 0.05, 0.7])
@pytest.mark.parametrize("model", [MODEL, MODEL.nonlinear(), Model(MODEL.container, modes=2)])
def test_noise_under_much_larger_heights(noise, cross, model):
    motion = measured(shaken(cross=cross), noise, model=model)
    assert np.nanmax(motion.heights) > 30.0 * noise
    found = estimate_noise(motion)
    assert found.source == "differences, still part"
    assert found.stddev == pytest.approx(noise, rel=0.2)
    assert 0.02 < found.uncertainty / found.stddev < 0.1


def test_gaps_outliers_and_jitter_do_not_raise_it():
    rng = np.random.default_rng(3)
    t = T + rng.uniform(-0.002, 0.002, len(T))
    heights = measured(shaken(cross=0.3), 5e-4, t=t).heights[:, 0].copy()
    heights[rng.choice(len(t), 5, replace=False)] += 0.01
    heights[200:230] = np.nan
    heights[rng.choice(len(t), 20, replace=False)] = np.nan
    motion = MeasuredMotion("rough", shaken(cross=0.3), t, heights)
    assert estimate_noise(motion).stddev == pytest.approx(5e-4, rel=0.25)


def test_the_top_of_the_picture_is_not_taken_for_silence():
    inputs = shaken(cross=0.6, start=0.0)
    motion = measured(inputs, 5e-4)
    cap = 0.3 * float(np.nanmax(motion.heights))
    capped = MeasuredMotion("capped", inputs, T, np.minimum(motion.heights[:, 0], cap))
    assert np.mean(capped.heights == cap) > 0.3
    assert estimate_noise(capped).stddev == pytest.approx(5e-4, rel=0.3)


def test_still_part_needs_one_clock_rest_and_some_noise():
    inputs = shaken()
    motion = measured(inputs, 5e-4)
    found = still_noise(motion)
    assert found is not None
    assert found.stddev == pytest.approx(5e-4, rel=0.3)
    other_clock = MeasuredMotion("x", inputs, T, motion.msh, same_clock=False)
    assert still_noise(other_clock) is None
    assert still_noise(measured(shaken(start=0.0), 5e-4)) is None
    assert still_noise(measured(inputs, 0.0)) is None


def test_a_detection_that_is_steadier_at_rest_gives_the_noise_in_motion():
    inputs = shaken(cross=0.5)
    motion = measured(inputs, 1e-3)
    heights = motion.heights[:, 0].copy()
    heights[T < 1.0] *= 0.1
    found = estimate_noise(MeasuredMotion("locked", inputs, T, heights))
    assert found.source == "differences"
    assert found.stddev == pytest.approx(1e-3, rel=0.2)


def test_repeats_of_a_motion_add_to_it():
    inputs = shaken()
    first, second = (measured(inputs, 5e-4, seed) for seed in (1, 2))
    repeats = repeat_noise(first, second)
    assert repeats is not None
    assert repeats.stddev == pytest.approx(5e-4, rel=0.1)
    alone, together = estimate_noise(first), estimate_noise(first, [first, second])
    assert "repeats" in together.source
    assert together.uncertainty < alone.uncertainty
    assert repeat_noise(first, measured(shaken(amplitude=2.0), 5e-4)) is None


def test_a_short_or_broken_record_still_has_an_estimate():
    found = [difference_noise(T[:20], white(seed, 20)) for seed in range(100)]
    assert np.mean([each.stddev for each in found]) == pytest.approx(1.0, rel=0.1)
    broken = white(0)
    broken[::6] = broken[1::6] = np.nan  # never eleven samples within fifteen places
    estimate = difference_noise(np.arange(600) / 60.0, broken)
    assert estimate.stddev == pytest.approx(1.0, rel=0.2)


def white(seed, rows=600, columns=1):
    return np.random.default_rng(seed).normal(size=(rows, columns))


def sine(amplitude, rows=600):
    return amplitude * np.sin(2.0 * np.pi * 3.0 * np.arange(rows) / 60.0)[:, np.newaxis]


@pytest.mark.parametrize("columns", [1, 12])
def test_white_noise_with_gaps_is_white(columns):
    t = np.arange(600) / 60.0
    whites = []
    for seed in range(200):
        residual = white(seed, columns=columns)
        residual[np.random.default_rng(seed).random(600) < 0.2] = np.nan
        whites.append(is_white(t, residual))
    assert np.mean(whites) > 0.97


def test_a_sine_of_a_third_of_the_noise_is_seen():
    t = np.arange(600) / 60.0
    seen = [not is_white(t, white(seed) + sine(0.3)) for seed in range(200)]
    assert np.mean(seen) > 0.7
    stronger = [not is_white(t, white(seed) + sine(0.5)) for seed in range(200)]
    assert np.mean(stronger) > 0.98


@pytest.mark.parametrize("amplitude", [0.0, 0.5, 3.0])
def test_the_removable_part_without_knowing_the_noise(amplitude):
    t = np.arange(600) / 60.0
    found = [removable(t, (white(seed) + sine(amplitude))[:, 0]) for seed in range(200)]
    squares = np.array([each.mean_square for each in found])
    assert squares.mean() == pytest.approx(0.5 * amplitude**2, abs=0.02, rel=0.02)
    assert squares.std() == pytest.approx(found[0].mean_square_stddev, rel=0.3)
    if amplitude == 3.0:
        assert found[0].rms == pytest.approx(3.0 / math.sqrt(2.0), rel=0.05)
        assert found[0].noise == pytest.approx(1.0, rel=0.2)
        assert found[0].share == pytest.approx(4.5 / 5.5, rel=0.05)


def test_a_known_noise_sharpens_it():
    t = np.arange(600) / 60.0
    known = Noise(1.0, 0.01, "repeats")
    blind = [removable(t, white(seed) + sine(0.5)).mean_square for seed in range(200)]
    told = [removable(t, white(seed) + sine(0.5), known) for seed in range(200)]
    values = np.array([each.mean_square for each in told])
    assert values.mean() == pytest.approx(0.125, abs=0.02)
    assert values.std() < 0.95 * np.std(blind)
    assert values.std() == pytest.approx(told[0].mean_square_stddev, rel=0.3)


def test_too_few_samples_have_nothing_removable():
    t = np.arange(5) / 60.0
    found = removable(t, np.ones(5))
    assert found.rms == 0.0
    assert found.mean_square_stddev == math.inf
    assert whiteness(t, np.ones(5)) == 1.0
