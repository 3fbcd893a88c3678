"""Tests the governor's own simulation of waves against that of any model."""

import math

import numpy as np
import pytest

from slosh_base.compiled.compilation import uncompiled
from slosh_governor.core import ModelDoubt, layout, waves
from slosh_governor.core.cups import cups_of, stores_of, table_of
from slosh_governor.core.lane_heights import add_heights
from slosh_model import Cylinder, Model, Rectangle
from slosh_model.shapes import Frustum
from slosh_model.tray import Tray, TrayContainer
from slosh_plan.planning.limits import PlanLimits

ROWS, END, SPACING = 60, 40, 0.02
CUP = Model(Cylinder(0.05, 0.07)).with_effect("vertical_acceleration").nonlinear()
TANK = Model(Rectangle(0.1, 0.07, 0.08)).with_effect("vertical_acceleration").nonlinear()
FRUSTUM = Model(Frustum(bottom_radius=0.03, top_radius=0.045, height=0.1, fill_height=0.07))
add = uncompiled(add_heights)


def motion(scale, seed=0):
    """Returns accelerations (1, 1, ROWS, 3) that begin and end with zero [m/s²]."""
    steps = np.random.default_rng(seed).normal(size=(ROWS, 3)) * [1.0, 1.0, 0.5]
    rows = scale * np.cumsum(steps, axis=0)
    rows[0] = rows[END:] = 0.0
    return rows[np.newaxis, np.newaxis]


def simulated(model, driven, *, kind=None, ceiling=math.inf):
    """Returns the rows that are simulated, heights and greatest heights of all models."""
    containers = cups_of(Tray((TrayContainer("", model),)), PlanLimits(0.02), turns=False)
    (cup,) = table_of(containers, SPACING, 0.03, turns=False)[0]
    cup[layout.WAVE] = cup[layout.WAVE] if kind is None else kind
    heights, tops = np.zeros((ROWS, 2, layout.MODELS)), np.zeros(layout.MODELS)
    done = add(
        stores_of(containers, ModelDoubt().factors), cup, driven, np.array([0]),
        np.arange(layout.MODELS), np.array([END]), np.full(ROWS - 1, SPACING), ROWS, ceiling,
        heights, tops,
    )  # fmt: skip
    return done, heights, tops


@pytest.mark.parametrize("model", [CUP, TANK, FRUSTUM], ids=["cup", "tank", "linear"])
def test_heights_are_those_of_the_general_simulation(model):
    assert waves.kind_of(model) != waves.OTHER
    driven = motion(0.3)
    done, heights, tops = simulated(model, driven)
    expected = simulated(model, driven, kind=waves.OTHER)
    assert done == expected[0] == ROWS
    assert heights == pytest.approx(expected[1], abs=1e-13)
    assert tops == pytest.approx(expected[2], abs=1e-13)
    assert 0.005 < tops.max() < 0.05
    # Models with other frequencies and damping ratios are other waves.
    assert len(np.unique(tops.round(9))) == layout.MODELS


def test_a_pendulum_that_swings_far_is_simulated_with_its_own_sine():
    driven = motion(3.0)
    _, heights, tops = simulated(TANK, driven)
    expected = simulated(TANK, driven, kind=waves.OTHER)
    assert (heights == expected[1]).all()
    assert (tops == expected[2]).all()


@pytest.mark.parametrize("model", [CUP, TANK], ids=["cup", "tank"])
def test_it_ends_after_a_height_beyond_the_ceiling(model):
    driven = motion(0.3)
    tops = simulated(model, driven)[2]
    done, _, found = simulated(model, driven, ceiling=0.5 * tops.max())
    assert done < ROWS
    assert found.max() > 0.5 * tops.max()
    assert simulated(model, driven, ceiling=1.001 * tops.max())[0] == ROWS


@pytest.mark.parametrize("model", [CUP, TANK], ids=["cup", "tank"])
def test_an_unknown_acceleration_is_an_infinite_height(model):
    driven = motion(0.3)
    driven[0, 0, 20, 0] = math.nan
    assert (simulated(model, driven)[2] == math.inf).all()


@pytest.mark.parametrize(
    "model",
    [
        CUP.with_effect("second_mode"),
        CUP.with_effect("quadratic_damping", beta=1.0),
        CUP.with_gravity_tilt(),
        Model(Rectangle(0.1, 0.07, 0.08)),
    ],
    ids=["second mode", "damping", "tilt", "linear rectangle"],
)
def test_other_models_are_left_to_the_general_simulation(model):
    assert waves.kind_of(model) == waves.OTHER
