"""Tests the growth of the smallest wave against Mathieu's equation, solved by SciPy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slosh_model import Cylinder, Inputs, Model
from slosh_model.constants import GRAVITY
from slosh_model.least_wave import LEAST_WAVE, growing_waves

MODEL = Model(Cylinder(radius=0.04, fill_height=0.06)).spatial()
MODE = MODEL.mode_constants()[0]
OMEGA, ZETA = MODE.natural_frequency, MODE.damping_ratio
THRESHOLD = 4.0 * ZETA * GRAVITY


def shaken(size, *, ratio=2.0, seconds=30.0, along=(0.0, 0.0, 1.0)):
    t = np.arange(0.0, seconds, 0.002)
    return Inputs(t, np.outer(size * np.cos(ratio * OMEGA * t), along))


def by_scipy(motion):
    """Returns the greatest growth over all phases of a wave, by Mathieu's equation."""

    def slope(t, state):
        stiffness = OMEGA**2 * (1.0 + np.interp(t, motion.t, motion.acceleration[:, 2]) / GRAVITY)
        x, v, y, w = state
        return v, -2 * ZETA * OMEGA * v - stiffness * x, w, -2 * ZETA * OMEGA * w - stiffness * y

    ends = motion.t[[0, -1]]
    found = solve_ivp(slope, ends, (1.0, 0.0, 0.0, OMEGA), t_eval=motion.t, rtol=1e-8, atol=1e-9)
    return float(np.hypot(found.y[0], found.y[2]).max())


def test_growth_is_that_of_mathieus_equation():
    motion = shaken(2.5 * THRESHOLD)
    (found,) = growing_waves(MODEL, [motion])
    assert found is not None
    assert found.factor == pytest.approx(by_scipy(motion), rel=1e-3)


@pytest.mark.parametrize(
    "motion",
    [
        shaken(0.7 * THRESHOLD),
        shaken(2.5 * THRESHOLD, ratio=1.5),
        shaken(2.5 * THRESHOLD, seconds=2.0),
        shaken(5.0, along=(1.0, 1.0, 0.0)),
    ],
    ids=["below the threshold", "another frequency", "short", "horizontal"],
)
def test_waves_that_do_not_grow_are_not_seen(motion):
    assert growing_waves(MODEL, [motion]) == [None]


def test_waves_start_in_the_phase_from_which_they_grow_highest():
    motion = shaken(2.5 * THRESHOLD)
    found, none = growing_waves(MODEL, [motion, shaken(0.7 * THRESHOLD)])
    assert none is None
    along_x, along_y = found.starts
    (gain,) = MODEL.height_gains()
    assert gain * math.hypot(along_x[0, 0], along_x[0, 2] / OMEGA) == pytest.approx(LEAST_WAVE)
    np.testing.assert_array_equal(along_y[0], along_x[0, [1, 0, 3, 2]])


@pytest.mark.first(4)
@pytest.mark.parametrize("seed", range(12))
def test_no_wave_that_becomes_visible_is_passed_over(seed):
    """Tests the bound by which motions are passed over against Mathieu's equation."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, random.uniform(3.0, 25.0), 0.004)
    swell = random.uniform(0.0, 1.0) + np.sin(random.uniform(0.1, 1.0) * t) ** 2
    size, ratio = THRESHOLD * random.uniform(0.5, 4.0), random.normal(2.0, 0.02)
    motion = Inputs(t, np.outer(size * swell * np.cos(ratio * OMEGA * t), [0.0, 0.0, 1.0]))
    (found,) = growing_waves(MODEL, [motion])
    grown = by_scipy(motion)
    if found is None:
        assert grown * LEAST_WAVE < 1.01e-4
    else:
        assert found.factor == pytest.approx(grown, rel=5e-3)


def test_many_models_are_told_apart():
    motion = shaken(2.5 * THRESHOLD)
    other = Model(Cylinder(radius=0.08, fill_height=0.06)).spatial()
    found, none = growing_waves([MODEL, other], [motion, motion])
    assert none is None
    (alone,) = growing_waves(MODEL, [motion])
    assert found.factor == alone.factor
