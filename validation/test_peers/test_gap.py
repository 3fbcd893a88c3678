"""Tests the removed share of the error: all for the true equation, nothing for none."""

import numpy as np
import pytest

from validation.peers.gap import closed
from validation.peers.library import TERMS
from validation.peers.oracle import latent
from validation.test_peers.truths import coefficients, motion, truth_of


@pytest.mark.parametrize("effect", ["surface_nonlinearity", "gravity_tilt", "yaw_coupling"])
def test_the_true_coefficients_close_the_gap(effect):
    base, truth = truth_of(effect)
    exact = latent(truth, base, motion())
    true = coefficients(base, truth, exact.inputs)
    nothing, half, whole = closed(
        base, [exact], np.array([np.zeros(len(TERMS)), 0.5 * true, true])
    )
    assert nothing == pytest.approx(0.0, abs=1e-9)
    assert half < whole
    assert whole > 0.999


def test_a_model_that_blows_up_is_worse_than_none():
    base, truth = truth_of("accel_gain")
    exact = latent(truth, base, motion())
    wild = np.zeros(len(TERMS))
    wild[TERMS.index("damping")] = -500.0
    assert closed(base, [exact], wild[np.newaxis])[0] < -1.0
