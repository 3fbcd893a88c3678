"""Tests that a missing generic term is proposed with the right coefficient."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slosh_discovery.discover.generic.response import MotionWithTerms
from slosh_discovery.discover.generic.terms import LIBRARY
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.propose import propose
from slosh_model import Cylinder, Inputs, Model
from slosh_model.errors import SloshModelError
from slosh_model.measure import predicted_heights

MODEL = Model(Cylinder(0.05, 0.07))
MODE = MODEL.mode_constants()[0]
OMEGA, ZETA = MODE.natural_frequency, MODE.damping_ratio
GAIN = MODEL.height_gains()[0]
NOISE = 3e-4
T = np.arange(0.0, 3.5, 1.0 / 60.0)
TERMS = {term.label: term for term in LIBRARY}


def moved(x, y, ratio):
    """Returns three seconds of motion along a figure of eight, a circle or a line."""
    t = np.arange(0.0, 3.5, 0.01)
    envelope = np.clip(t, 0.0, 0.5) / 0.5 * np.clip(3.0 - t, 0.0, 0.5) / 0.5
    phase = ratio * OMEGA * t
    a = np.stack([x * np.sin(phase), y * np.sin(2.0 * phase), 0.0 * t], axis=1)
    if ratio > 1.0:
        a[:, 1] = y * np.cos(phase)
    return Inputs(t, envelope[:, np.newaxis] * a)


MOTIONS = (moved(1.5, 1.0, 0.75), moved(0.9, 0.5, 1.15))


def truth(inputs, extra):
    """Returns heights (M, 2) at +x and +y of a linear oscillator with an additional force."""

    def slope(t, state):
        q, v = state[:2], state[2:]
        a = np.array([np.interp(t, inputs.t, inputs.acceleration[:, k]) for k in range(2)])
        return [*v, *(extra(t, q, v) - 2.0 * ZETA * OMEGA * v - OMEGA**2 * q - a)]

    times = np.minimum(T, inputs.t[-1])
    solution = solve_ivp(
        slope, (0.0, inputs.t[-1]), np.zeros(4), t_eval=np.unique(times),
        max_step=0.02, rtol=1e-6, atol=1e-9,
    )  # fmt: skip
    return GAIN * np.stack([np.interp(T, solution.t, each) for each in solution.y[:2]], axis=1)


def measured(extra):
    rng = np.random.default_rng(5)
    return [
        MeasuredMotion(
            f"motion {k}",
            inputs,
            T,
            np.linalg.norm(truth(inputs, extra), axis=1) + NOISE * rng.normal(size=len(T)),
        )
        for k, inputs in enumerate(MOTIONS)
    ]


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("extra", "label", "size", "unit"),
    [
        (lambda t, q, v: 0.9 * np.array([-v[1], v[0]]), "J q̇", 0.9, "1/s"),
        (lambda t, q, v: np.array([-8e4 * q[0] ** 3, 0.0]), "q_x³ x̂", -8e4, "1/(m² s²)"),
        (lambda t, q, v: -0.3 * t * v, "t q̇", -0.3, "1/s²"),
    ],
    ids=["coriolis", "cubic spring", "damping that drifts"],
)
def test_the_right_term_is_first(extra, label, size, unit):
    motions = measured(extra)
    before = [motion.heights - predicted_heights(MODEL, motion.inputs, T) for motion in motions]
    assert np.sqrt(np.mean(np.square(before))) > 3.0 * NOISE
    found = propose(motions, MODEL)
    assert found is not None
    assert found.terms[0][0] == label
    assert found.terms[0][1] == pytest.approx(size, rel=0.05)
    assert found.terms[0][2] == unit
    assert found.explained > 0.95
    assert label in found.equation
    assert unit in found.equation


def test_nothing_is_proposed_for_noise():
    assert propose(measured(lambda t, q, v: np.zeros(2)), MODEL) is None


@pytest.mark.long
def test_nothing_is_proposed_for_what_no_term_explains():
    rng = np.random.default_rng(2)
    motions = []
    for motion in measured(lambda t, q, v: np.zeros(2)):
        odd = 2e-3 * np.sin(2.0 * np.pi * 0.7 * T + rng.uniform(0.0, 6.0))
        motions.append(MeasuredMotion(motion.name, motion.inputs, T, motion.msh + odd))
    found = propose(motions, MODEL)
    assert found is None or found.explained < 0.5


def test_terms_act_as_a_second_integrator_says():
    def extra(t, q, v):
        return 0.9 * np.array([-v[1], v[0]]) - 0.2 * t * v

    azimuth = np.array([0.0, 0.5 * np.pi])
    motion = MeasuredMotion("walls", MOTIONS[1], T, eta_azimuth=azimuth, eta=np.zeros((len(T), 2)))
    heights = MotionWithTerms.of(MODEL, motion, 0.0).heights(
        [TERMS["J q̇"], TERMS["t q̇"]], [0.9, -0.2]
    )
    expected = truth(MOTIONS[1], extra)
    assert heights == pytest.approx(expected, abs=5e-3 * np.abs(expected).max())


def test_a_gain_on_the_acceleration_from_wall_heights():
    inputs, azimuth = MOTIONS[1], np.radians(np.arange(0.0, 360.0, 10.0))
    x, y = (1.2 * truth(inputs, lambda t, q, v: np.zeros(2))).T
    eta = np.outer(x, np.cos(azimuth)) + np.outer(y, np.sin(azimuth))
    eta += NOISE * np.random.default_rng(1).normal(size=eta.shape)
    motion = MeasuredMotion("walls", inputs, T, eta_azimuth=azimuth, eta=eta)
    found = propose([motion], MODEL)
    assert found is not None
    assert found.terms[0][:2] == ("a", pytest.approx(-0.2, abs=0.02))
    assert found.equation.endswith("= −a − 0.2 a")


def test_a_term_that_runs_away_is_an_error():
    motion = measured(lambda t, q, v: np.zeros(2))[0]
    with pytest.raises(SloshModelError, match="no bounded solution"):
        MotionWithTerms.of(MODEL, motion, 0.0).heights([TERMS["q̇"]], [50.0])
