"""Tests limits of machines with unknown strokes against a linear oscillator's theory."""

import math

import numpy as np
import pytest

from slosh_model import Cylinder, Inputs, Model, Rectangle, simulate
from slosh_plan import HeightLimits, SloshPlanError
from slosh_plan.gantry import gantry_limits

LIMITS = HeightLimits(0.004, 0.001)
LINEAR = Model(Cylinder(0.04, 0.06), damping_ratio=0.002)


def gain_and_frequency(model):
    """Returns static height per acceleration [s²] and ω [rad/s] of the first mode."""
    mode = model.mode_constants()[0]
    return model.nonlinear().height_gains()[0] / mode.natural_frequency**2, mode.natural_frequency


def test_a_hard_start_and_stop_can_add_up_to_four_static_heights():
    """Two axes at once; each of four jumps adds up to its static height."""
    gain, _ = gain_and_frequency(LINEAR)
    found = gantry_limits(LINEAR, LIMITS)
    worst = 4.0 * math.sqrt(2.0) * gain * found.acceleration
    assert worst == pytest.approx(LIMITS.height, rel=0.03)
    assert math.isnan(found.speed)


def test_ramps_of_a_period_leave_the_static_height_alone():
    gain, omega = gain_and_frequency(LINEAR)
    found = gantry_limits(LINEAR, LIMITS)
    static = math.sqrt(2.0) * gain * found.smooth_acceleration
    assert static == pytest.approx(LIMITS.height, rel=0.05)
    assert found.jerk == pytest.approx(found.smooth_acceleration * omega / (2.0 * math.pi))


def test_a_strong_machine_is_limited_by_its_speed():
    """A short push is a jump of the speed: a wave of v ω times the static height by g."""
    gain, omega = gain_and_frequency(LINEAR)
    found = gantry_limits(LINEAR, LIMITS, 20.0)
    worst = 2.0 * math.sqrt(2.0) * gain * omega * found.speed
    assert worst == pytest.approx(LIMITS.height, rel=0.05)


@pytest.mark.parametrize("model", [LINEAR, Model(Rectangle(0.12, 0.08, 0.03))], ids=["cup", "box"])
def test_random_strokes_keep_the_limit_and_wait_long_enough(model):
    """Strokes of random lengths and directions, integrated one by one."""
    nonlinear, rng = model.nonlinear(), np.random.default_rng(5)
    found = gantry_limits(model, LIMITS)
    t = np.arange(0.0, 4.0 + found.wait, 2e-3)
    for _ in range(6):
        hold, coast = rng.uniform(0.02, 0.8), rng.uniform(0.0, 1.5)
        pulse = np.where(t < hold, 1.0, np.where(t < hold + coast, 0.0, -1.0))
        end = 2.0 * hold + coast
        pulse[t >= end] = 0.0
        axes = found.acceleration * rng.choice([-1.0, 0.0, 1.0, 0.6], size=2)
        msh = simulate(nonlinear, Inputs(t, np.outer(pulse, [*axes, 0.0])))[0].msh
        assert msh.max() <= 1.03 * LIMITS.height
        assert msh[t > end + found.wait].max() <= 1.05 * LIMITS.residual


def test_without_a_limit_it_says_so():
    with pytest.raises(SloshPlanError, match="need a limit of the height, or a rim"):
        gantry_limits(LINEAR, HeightLimits())
