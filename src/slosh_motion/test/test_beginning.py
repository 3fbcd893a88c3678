"""Tests how an input that begins in motion is told from one that begins at rest."""

import math

import numpy as np
import pytest

from slosh_motion.checks.constancy import BEGAN, Beginning, began_doubt, speed_at_start

RATES = [50.0, 125.0, 500.0]


def stroke(t, size=0.6, lasts=0.7):
    """Returns place [m] and speed [m/s] of a stroke that begins at 0, at rest at both ends."""
    s = np.clip(np.asarray(t) / lasts, 0.0, 1.0)
    place = size * s**3 * (10 - 15 * s + 6 * s * s)
    return place, size / lasts * 30.0 * s**2 * (1.0 - s) ** 2


def along(values):
    return np.outer(values, (0.6, 0.0, 0.8))


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("begin", [0.2, 0.35, 0.5])
@pytest.mark.parametrize("derivative", [0, 1])
def test_the_speed_at_the_first_moment_is_found(rate, begin, derivative):
    t = np.arange(int(0.16 * rate) + 1) / rate
    place, speed = stroke(begin + t)
    found = speed_at_start(t, along(place if derivative else speed), derivative)
    assert found == pytest.approx(speed[0], rel=0.15)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("lead", [0.0, 0.02, 0.1, 1.0])
@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3])
def test_a_stroke_that_begins_with_the_recording_begins_at_rest(rate, lead, noise):
    draw = np.random.default_rng(7)
    t = np.arange(int(0.16 * rate) + 1) / rate
    values = along(stroke(t - lead)[0]) + draw.normal(0.0, noise, (len(t), 3))
    assert speed_at_start(t, values, 1) == 0.0


@pytest.mark.parametrize("acceleration", [1.0, 8.0])
def test_a_step_of_the_acceleration_begins_at_rest(acceleration):
    t = np.arange(20) / 125.0
    assert speed_at_start(t, along(0.5 * acceleration * t**2), 1) == 0.0
    assert speed_at_start(t, along(acceleration * t), 0) == 0.0


def begins(accelerations, rate):
    """Returns after which sample a motion is known [s], and the first acceleration [m/s²]."""
    check = Beginning()
    for k, (x, y) in enumerate(accelerations):
        if check.take(10**18 + round(1e9 * k / rate), (x, y, 0.0)):
            return k / rate, check.size
    return math.inf, check.size


@pytest.mark.parametrize("rate", RATES)
def test_accelerations_of_a_motion_are_known_within_half_a_second(rate):
    t = np.arange(int(rate)) / rate
    after, size = begins(np.column_stack([3.0 * np.cos(9.0 * t), 0.0 * t]), rate)
    assert after < 0.5
    assert size == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(("constant", "noise"), [(0.0, 0.3), (2.0, 0.3), (2.0, 0.0)])
def test_a_tilted_noisy_sensor_begins_at_rest(rate, constant, noise):
    for seed in range(40):
        draw = np.random.default_rng(seed)
        values = np.array((constant, 0.0)) + draw.normal(0.0, noise, (int(rate), 2))
        assert begins(values, rate) == (math.inf, 0.0)


@pytest.mark.parametrize("lead", [0.0, 0.03, 0.2])
def test_a_motion_that_begins_with_the_accelerations_begins_at_rest(lead):
    t = np.arange(500) / 500.0 - lead
    values = np.where(t > 0.0, 6.0 * np.sin(8.0 * t), 0.0)
    assert begins(np.column_stack([values, values]), 500.0) == (math.inf, 0.0)


def test_a_gap_after_the_first_samples_is_no_motion():
    check = Beginning()
    stamps = [0, 10_000_000, 300_000_000, 2_000_000_000, 2_010_000_000]
    assert [check.take(stamp, (0.0, 0.0, 0.0)) for stamp in stamps] == [False] * 5
    assert not check.open


def test_what_is_told_says_what_to_do():
    doubt = began_doubt("1.3 m/s")
    assert BEGAN in doubt.text
    assert "1.3 m/s" in doubt.text
    assert "while the container rests" in doubt.text
    assert doubt.wrong
