"""Tests estimator and observer in a container whose outline has no symmetry."""

import numpy as np
import pytest

from slosh_estimator.estimator import Estimator
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import WallHeights
from slosh_model import Inputs, Model, measured_heights, simulate
from slosh_model.shapes import Prism
from slosh_motion.inputs.sampling import Sample
from slosh_testing.mode_solver import needs_solver

pytestmark = needs_solver
OUTLINES = {
    "scalene": ((0.0, 0.0), (0.1, 0.0), (0.04, 0.07)),
    "leaning isosceles": ((0.0, 0.0), (0.095534, 0.029552), (0.02117, 0.100757)),
}
MS = 1_000_000


@pytest.fixture(params=list(OUTLINES))
def model(request: pytest.FixtureRequest) -> Model:
    return Model(Prism(outline=OUTLINES[request.param], fill_height=0.05)).spatial()


def test_the_estimator_has_the_models_heights(model: Model) -> None:
    t = np.arange(400) / 1000.0
    a = np.column_stack([2.0 * np.sin(9.0 * t), np.cos(14.0 * t) - 1.0, np.sin(5.0 * t)])
    expected, _ = simulate(model, Inputs(t, a))
    estimator = Estimator(model)
    for k, row in enumerate(a.tolist()):
        found = estimator.update(Sample(k * MS, *row, 0.0, k == 0)).nonlinear
        given = (expected.msh[k], expected.sh_x[k], expected.sh_y[k])
        assert (found.msh, found.sh_x, found.sh_y) == pytest.approx(given, abs=1e-12)
    assert found.azimuth == pytest.approx(expected.azimuth[-1])


def test_the_observer_finds_a_wave_that_was_there(model: Model) -> None:
    t = np.arange(1500) / 500.0
    a = np.zeros((len(t), 3))
    a[:250, 0] = 2.0 * np.sin(4.0 * np.pi * t[:250])
    a[:250, 1] = a[:250, 0]
    truth, _ = simulate(model, Inputs(t, a))
    azimuths = np.linspace(-np.pi, np.pi, 8, endpoint=False)
    read = measured_heights(model, truth, azimuths)
    observer, states = Observer(model), []
    for k in range(250, len(t)):  # begins in the middle of the wave
        if k % 8 == 0:
            columns = [azimuths, read[k - 4], np.full(8, 2e-4)]
            observer.take(WallHeights(2 * (k - 4) * MS, np.column_stack(columns)))
        states.append(observer.follow(Sample(2 * k * MS, 0.0, 0.0, 0.0, 0.0, k == 250), 0))
    found = [state for state in states if state is not None]
    at = np.array([state.stamp_ns for state in found]) * 1e-9
    wall = [np.interp(at, t, column) for column in (truth.sh_x, truth.sh_y, truth.msh)]
    error = np.array([[state.sh_x, state.sh_y, state.msh] for state in found]).T - wall
    assert np.abs(truth.msh[250:]).max() > 0.004
    assert np.abs(error[:, at > 1.5]).max() < 5e-4
