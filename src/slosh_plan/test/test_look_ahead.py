"""Tests predictions of a motion before it begins."""

import math

import numpy as np
import pytest

from slosh_model import Cylinder, Inputs, Model, simulate
from slosh_model.motion_profiles import quintic
from slosh_model.simulate import State
from slosh_model.tray import Tray, TrayContainer
from slosh_plan import HeightLimits, LiquidState, ModelError, SloshPlanError, Trajectory
from slosh_plan.look_ahead import Record, error_of, look_ahead, warning

CUP = Model(Cylinder(0.05, 0.07), damping_ratio=0.02).spatial().nonlinear()
HELD = Tray((TrayContainer("", CUP),))
LIMITS = HeightLimits(0.02, 0.004)
HIGH = LiquidState([[0.004, 0.0, 0.0, 0.0]], [[0.004, 0.0, 0.0, 0.0]])


def line(spacing: float = 0.001) -> Trajectory:
    t = np.linspace(0.0, 1.0, round(1.0 / spacing) + 1)
    return Trajectory(t, np.outer(quintic(t)[2], [0.4, 0.0, 0.0]), name="line")


@pytest.mark.parametrize("spacing", [0.001, 0.05])
@pytest.mark.parametrize("delay", [0.05, 0.4])
def test_the_liquid_goes_on_moving_until_the_motion_begins(delay, spacing):
    motion = line(spacing)
    found = look_ahead(HELD, motion, delay, limits=LIMITS, state=HIGH).of_worst
    t = np.arange(-delay, 3.0, 0.001)
    a = np.interp(t, motion.t, motion.acceleration[:, 0], left=0.0, right=0.0)
    felt = np.column_stack([a, 0 * a, 0 * a])
    response, _ = simulate(CUP, Inputs(t, felt), state=State(t[0], HIGH.nonlinear, np.zeros(4)))
    top = int(np.argmax(response.msh))
    assert found.nonlinear.peak == pytest.approx(response.msh[top], rel=2e-3)
    assert found.nonlinear.peak_time == pytest.approx(t[top], abs=0.02)
    assert found.duration == pytest.approx(1.0)
    at_once = look_ahead(HELD, motion, 0.0, limits=LIMITS, state=HIGH).of_worst
    assert found.nonlinear.peak != at_once.nonlinear.peak


def test_liquid_above_the_limit_is_refused():
    with pytest.raises(SloshPlanError, match="before the motion begins"):
        look_ahead(HELD, line(), 0.1, limits=HeightLimits(0.001), state=HIGH)


def test_the_cells_own_record_widens_the_interval():
    assert error_of(None) == error_of(Record(2, 0.002, 0.1)) == ModelError()
    assert error_of(Record(0, math.nan, math.nan)) == ModelError()
    error = error_of(Record(3, 0.002, 0.1))
    assert error == ModelError(0.002, 0.1)
    found = look_ahead(HELD, line(), 0.0, limits=LIMITS, error=error).of_worst
    half = math.hypot(0.004, 0.1 * found.nonlinear.peak)
    assert found.upper == pytest.approx(found.nonlinear.peak + half)


def test_a_warning_says_by_how_much_and_when():
    found = look_ahead(HELD, line(), 0.0, limits=HeightLimits(0.012, 0.002)).of_worst
    said = warning(found)
    assert f"rise to {1e3 * found.upper:.1f} mm" in said
    assert f"{1e3 * found.excess:.1f} mm above the limit of 12 mm" in said
    assert "will be left after the end" in said
    assert warning(look_ahead(HELD, line(), 0.0, limits=HeightLimits(1.0)).of_worst) == ""


@pytest.mark.parametrize(
    ("count", "sigma", "epsilon"),
    [(5, -1.0, 0.0), (5, math.nan, 0.0), (5, 1e-3, math.inf), (-5, 1e-3, 0.0)],
)
def test_a_record_that_cannot_be_is_not_used(count, sigma, epsilon):
    record = Record(count, sigma, epsilon)
    assert not record.possible
    assert error_of(record) == ModelError()
    assert Record(5, 1e-3, -0.1).possible
