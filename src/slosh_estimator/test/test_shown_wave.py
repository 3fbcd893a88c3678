"""Tests of the wave that heights at one place show."""

import math

import numpy as np
import pytest

from slosh_estimator.observer.observer import Observer, ShownWave
from slosh_estimator.observer.states import WallHeights
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_motion.inputs.sampling import Sample

SECOND = 1_000_000_000
OMEGA = 19.0


def shown(heights, rate=60.0):
    wave = ShownWave()
    for k, height in enumerate(heights):
        wave.add(SECOND + round(k / rate * SECOND), height)
    return wave, SECOND + round(len(heights) / rate * SECOND)


@pytest.mark.parametrize("noise", [0.0, 0.5e-3])
def test_a_swing_about_the_level_shows_its_amplitude_and_noise_alone_none(noise):
    random = noise * np.random.default_rng(3).normal(size=600)
    t = np.arange(600) / 60.0
    wave, now = shown(2e-3 + 4e-3 * np.sin(OMEGA * t) + random)
    assert wave.amplitude(now, 2e-3) == pytest.approx(4e-3, rel=0.15)
    wave, now = shown(2e-3 + random)
    assert wave.amplitude(now, 2e-3) < 0.8 * noise + 1e-6


def test_few_old_and_forgotten_heights_show_nothing():
    wave, now = shown([4e-3] * 10)
    assert wave.amplitude(now, 0.0) == 0.0
    wave, now = shown([4e-3] * 60)
    assert wave.amplitude(now, 0.0) > 4e-3
    assert wave.amplitude(now + 2 * SECOND, 0.0) == 0.0
    wave.clear()
    assert wave.amplitude(now, 0.0) == 0.0


def test_heights_of_a_part_of_the_wall_that_swing_are_not_calm():
    observer, least = Observer(Model(Cylinder(0.05, 0.07))), math.inf
    for k in range(1000):
        t = 0.005 * k
        if k % 4 == 0:
            point = [[math.nan, 4e-3 * math.sin(OMEGA * t), 2.5e-3]]
            observer.take(WallHeights(SECOND + round(t * SECOND), np.array(point)))
        sample = Sample(SECOND + round(t * SECOND), 0.0, 0.0, 0.0, restarted=k == 0)
        state = observer.follow(sample)
        if state is not None and t > 2.0:
            least = min(least, state.sure_bound)
            assert state.msh < 4e-3
    assert least > 3e-3
