from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from slosh_model import Cylinder, Inputs, Model, Rectangle, SloshModelError, simulate
from slosh_model.gradient import peak_gradient
from slosh_model.motion_profiles import quintic

CUP = Model(Cylinder(0.05, 0.07), damping_ratio=0.02)
MODELS = {
    "2D-L": CUP,
    "3D-L": CUP.spatial(),
    "2D-NL": CUP.nonlinear(),
    "3D-NL": CUP.spatial().nonlinear(),
    "two modes": CUP.spatial().nonlinear().with_effect("second_mode", damping_ratio=0.01),
    "static share": CUP.spatial().nonlinear().with_effect("quasi_static_modes"),
    "other modes": CUP.nonlinear().with_effect("fill_level", delta=-0.01),
    "rectangle": Model(Rectangle(0.08, 0.06, 0.07), damping_ratio=0.02).spatial(),
}


def inputs_of(seed=0, count=160, step=0.005):
    """Returns an unevenly sampled motion in all directions that causes small waves."""
    generator = np.random.default_rng(seed)
    t = np.cumsum(step * generator.uniform(0.4, 1.6, count))
    phases = generator.uniform(0.0, 6.0, (3, 1))
    waves = np.sin(generator.uniform(8.0, 22.0, (3, 1)) * t + phases)
    return Inputs(t, (np.array([[2.5], [2.0], [3.0]]) * waves).T)


def changed(inputs, row, axis, by):
    acceleration = inputs.acceleration.copy()
    acceleration[row, axis] += by
    return Inputs(inputs.t, acceleration)


@pytest.mark.parametrize("name", MODELS)
def test_the_gradient_is_that_of_finite_differences(name):
    model, inputs = MODELS[name], inputs_of()
    found = peak_gradient(model, inputs)
    assert found.height == simulate(model, inputs)[0].msh.max()
    assert found.gradient[found.index + 1 :] == pytest.approx(0.0, abs=1e-18)
    scale = np.abs(found.gradient).max()
    for row in (0, 1, found.index // 3, found.index - 2, found.index):
        for axis in range(3):
            h = 1e-4
            ends = [peak_gradient(model, changed(inputs, row, axis, by)).height for by in (-h, h)]
            slope = (ends[1] - ends[0]) / (2.0 * h)
            assert found.gradient[row, axis] == pytest.approx(slope, abs=1e-6 * scale)


@pytest.mark.parametrize("smoothing", [1e-4, 1e-3])
def test_the_smooth_maximum_lies_above_and_has_its_own_gradient(smoothing):
    model, inputs = MODELS["3D-NL"], inputs_of(1)
    peak, smooth = peak_gradient(model, inputs), peak_gradient(model, inputs, smoothing=smoothing)
    assert 0.0 < smooth.height - peak.height < smoothing * np.log(len(inputs.t))
    for row in (3, 60, 120):
        ends = [
            peak_gradient(model, changed(inputs, row, 1, by), smoothing=smoothing).height
            for by in (-1e-4, 1e-4)
        ]
        slope = (ends[1] - ends[0]) / 2e-4
        assert smooth.gradient[row, 1] == pytest.approx(slope, rel=1e-5, abs=1e-12)


def test_an_optimiser_lowers_the_peak_with_it():
    model, t = MODELS["3D-NL"], np.linspace(0.0, 0.9, 451)
    u = t / 0.9
    shape = np.stack([quintic(u)[2], *(np.gradient(np.gradient(
        (u * (1.0 - u)) ** 4 * (1.0 - 2.0 * u) ** n, u), u) for n in (1, 3))])  # fmt: skip

    def cost(c):
        acceleration = np.zeros((len(t), 3))
        acceleration[:, 0] = 0.4 / 0.81 * (shape[0] + c @ shape[1:])
        found = peak_gradient(model, Inputs(t, acceleration), smoothing=2e-4)
        return 1e3 * found.height, 1e3 * 0.4 / 0.81 * shape[1:] @ found.gradient[:, 0]

    start = cost(np.zeros(2))[0]
    found = minimize(cost, np.zeros(2), jac=True, method="BFGS", options={"maxiter": 30})
    assert found.fun < 0.93 * start


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda m, i: peak_gradient(m.with_effect("quadratic_damping", beta=0.1), i),
         "no gradients with the effect 'quadratic_damping'"),
        (lambda m, i: peak_gradient(m.with_effect("accel_gain", gain=1.1), i), "'accel_gain'"),
        (lambda m, i: peak_gradient(m.with_effect("fill_loss", rate=1e-4), i), "'fill_loss'"),
        (lambda m, i: peak_gradient(MODELS["rectangle"].nonlinear(), i), "'pendulum_nonlinear"),
        (lambda m, i: peak_gradient(m, replace(i, attitude=np.tile([0, 0, 0, 1.0], (160, 1)))),
         "upright containers"),
        (lambda m, i: peak_gradient(m, i, smoothing=-1.0), "smoothing = -1.0"),
    ],
)  # fmt: skip
def test_what_is_not_covered_is_refused_in_one_line(make, text):
    with pytest.raises(SloshModelError, match=text) as caught:
        make(CUP, inputs_of())
    assert "\n" not in str(caught.value)
