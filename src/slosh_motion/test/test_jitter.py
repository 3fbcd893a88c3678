"""Tests how stamps that scatter are told from uneven measurements, noise and lost messages."""

import math

import numpy as np
import pytest

from slosh_motion.checks.stamp_checks import HEIGHT_GAIN, JitterCheck

BEGIN = 1_700_000_000_000_000_000
OMEGA = 18.5


def stroke(t, size=0.5, lasts=0.7):
    """Returns places (N,) on a stroke and back [m]."""
    found = np.zeros_like(t)
    for begin, sign in ((1.0, 1.0), (3.5, -1.0)):
        s = np.clip((t - begin) / lasts, 0.0, 1.0)
        found += sign * size * s**3 * (10 - 15 * s + 6 * s * s)
    return found


def checked(stamps, values, order=2):
    check = JitterCheck("poses", order)
    for t, x in zip(stamps.tolist(), values.tolist(), strict=True):
        check.take(BEGIN + round(1e9 * t), (x, 0.2 * x, 0.5))
    return check


@pytest.mark.parametrize("rate", [50.0, 125.0])
@pytest.mark.parametrize("order", [1, 2])
def test_the_scatter_of_stamps_is_found_and_named(rate, order):
    draw = np.random.default_rng(3)
    t = np.arange(0.0, 6.0, 1.0 / rate)
    scatter = 0.4 / rate
    values = stroke(t) if order == 2 else np.gradient(stroke(t), t)
    check = checked(t + draw.normal(0.0, scatter, len(t)), values, order)
    assert 0.7 * scatter < check.scatter < 2.2 * scatter
    doubt = check.doubt(OMEGA, 1.0 / rate)
    assert "scatter by" in doubt.text
    assert doubt.wrong


def test_the_error_is_that_of_white_noise_on_an_oscillator():
    """Tests the error against the waves that many drawn scatters make, without damping."""
    rate, scatter, rows = 125.0, 0.003, []
    t = np.arange(0.0, 6.0, 1.0 / rate)
    speed = np.gradient(stroke(t), t) * math.hypot(1.0, 0.2)
    for seed in range(300):
        noise = speed * np.random.default_rng(seed).normal(0.0, scatter, len(t))
        # Of q'' + ω² q = -n'', beside n itself: ω ∫ n sin ω(t - τ) dτ.
        rows.append(OMEGA * np.sum(noise * np.sin(OMEGA * (t[-1] - t))) / rate)
    draw = np.random.default_rng(5)
    check = checked(t + draw.normal(0.0, scatter, len(t)), stroke(t))
    expected = HEIGHT_GAIN * float(np.std(rows))
    assert check.error(OMEGA, 1.0 / rate) == pytest.approx(expected, rel=0.3)


@pytest.mark.parametrize("rate", [20.0, 125.0, 1000.0])
@pytest.mark.parametrize(("noise", "quantum"), [(0.0, 0.0), (1e-3, 0.0), (1e-5, 1e-3)])
@pytest.mark.parametrize("lost", [0.0, 0.1])
def test_uneven_measurements_with_noise_are_no_scatter(rate, noise, quantum, lost):
    draw = np.random.default_rng(11)
    t = np.arange(0.0, 6.0, 1.0 / rate)
    t = (t + draw.uniform(0.0, 0.9, len(t)) / rate)[draw.random(len(t)) >= lost]
    values = stroke(t) + draw.normal(0.0, noise, len(t))
    if quantum:
        values = np.round(values / quantum) * quantum
    assert checked(t, values).doubt(OMEGA, 1.0 / rate) is None


@pytest.mark.parametrize("rate", [50.0, 500.0])
def test_a_scatter_that_the_even_clock_takes_out_is_not_named(rate):
    draw = np.random.default_rng(2)
    t = np.arange(0.0, 6.0, 1.0 / rate)
    check = checked(t + draw.uniform(0.0, 0.2, len(t)) / rate, stroke(t))
    assert check.scatter == pytest.approx(0.2 / math.sqrt(12.0) / rate, rel=0.3)
    assert check.doubt(OMEGA, 1.0 / rate) is None


def test_gaps_and_stamps_that_go_back_do_not_end_it():
    check = checked(np.array([0.0, 0.1, 0.1, 0.05, 9.0, 2.0, 2.1]), np.arange(7.0))
    assert check.scatter == 0.0
