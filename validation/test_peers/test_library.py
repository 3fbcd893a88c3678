"""Tests that the candidate terms with true coefficients explain the simulated truth exactly."""

import numpy as np
import pytest

from validation.peers.library import EFFECT_OF, EXPRESSIBLE, TERMS, names, residual, solved, terms
from validation.peers.oracle import latent, noisy
from validation.test_peers.truths import HIDDEN, coefficients, motion, truth_of


@pytest.mark.parametrize("effect", HIDDEN)
def test_the_true_coefficients_give_the_true_acceleration(effect):
    base, truth = truth_of(effect)
    exact = latent(truth, base, motion())
    state = (exact.drive, exact.q, exact.v, exact.acceleration)
    lacking = residual(*state)
    true = coefficients(base, truth, exact.inputs)
    assert np.abs(lacking).max() > 1e-3
    assert np.abs(terms(*state) @ true - lacking).max() < 1e-6
    assert names(np.array(TERMS)[true != 0.0], [effect]) == {effect}


def test_the_oracle_s_derivatives_are_those_of_its_states():
    base, truth = truth_of("lever_arm")
    exact = latent(truth, base, motion())
    inside = slice(2, -2)
    for lower, upper in ((exact.q, exact.v), (exact.v, exact.acceleration)):
        slope = np.gradient(lower, exact.t, axis=0)
        assert np.abs(slope - upper)[inside].max() < 0.03 * np.abs(upper).max()


def test_a_model_with_the_true_coefficients_accelerates_as_the_truth():
    base, truth = truth_of("surface_nonlinearity")
    exact = latent(truth, base, motion())
    true = coefficients(base, truth, exact.inputs)[np.newaxis]
    for index in (50, 200, 400):
        row = slice(index, index + 1)
        found = solved(exact.drive.row(index), exact.q[row], exact.v[row], true)
        assert found == pytest.approx(exact.acceleration[row], abs=1e-6)


def test_noise_is_of_the_size_asked_for():
    base, truth = truth_of("accel_gain")
    exact = latent(truth, base, motion())
    q, v = noisy(exact, 5e-4, np.random.default_rng(1))
    assert np.std(q - exact.q) == pytest.approx(5e-4, rel=0.1)
    omega = np.sqrt(exact.drive.squared[0])
    assert np.std(v - exact.v) == pytest.approx(5e-4 * omega, rel=0.1)


def test_every_expressible_effect_has_a_term():
    assert set(EXPRESSIBLE) <= set(EFFECT_OF.values())
    assert names(["stiffness", "damping"], ["fill_level"]) == {"fill_level"}
    assert names(["stiffness", "damping"], ["accel_gain"]) == {"fill_level", "damping_mismatch"}
