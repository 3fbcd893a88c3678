"""Tests that the study of left-out heights recognises right and wrong intervals."""

import numpy as np
import pytest
from observer_real import Run, foretold, row

from slosh_discovery.discover import MeasuredMotion
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate

NOISE = 1.5e-3


@pytest.fixture(scope="module")
def run():
    """Returns a simulated cup that is pushed to and fro, with noisy heights."""
    model = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
    t = np.arange(0.0, 6.0, 0.002)
    push = np.where((t > 1.5) & (t < 4.0), 0.3 * np.sin(15.0 * (t - 1.5)), 0.0)
    inputs = Inputs(t, np.column_stack([push, 0.0 * t, 0.0 * t]))
    seen = np.arange(0.0, 6.0, 1.0 / 60.0)
    rng = np.random.default_rng(2)
    # The maximum does not fall below the noise of what is read at rest.
    heights = np.interp(seen, t, simulate(model, inputs)[0].msh) + NOISE * rng.normal(size=360)
    return Run("own", model, MeasuredMotion("own", inputs, seen, msh=heights))


def test_left_out_heights_are_inside_where_the_noise_is_stated_and_outside_where_not(run):
    right, wrong = foretold(run, NOISE), foretold(run, 0.1 * NOISE)
    assert np.mean(right.squares <= 1.96**2) > 0.9
    assert np.mean(wrong.squares <= 1.96**2) < 0.5
    assert right.heights == pytest.approx(0.5 * 60 * 4.5, abs=30)
    assert right.foretold == pytest.approx(NOISE, rel=0.2)
    assert "| own |  |" in row("own", "", (right,))
