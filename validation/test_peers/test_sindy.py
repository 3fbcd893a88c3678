"""Tests that each sparse regression finds an obvious effect; skipped without PySINDy."""

import pytest

pytest.importorskip("pysindy", reason="PySINDy is optional: requirements/peers.txt")
pytest.importorskip("cvxpy", reason="SINDy-PI's solver is optional: requirements/peers.txt")

from validation.peers.library import TERMS
from validation.peers.oracle import latent
from validation.peers.sindy import METHODS, RANGES, Data, grid
from validation.test_peers.truths import coefficients, motion, truth_of

SETTINGS = {
    "window": 0.03,
    "half_width": 0.12,
    "threshold": 0.08,
    "weight": 1e-4,
    "inclusion": 0.9,
}


@pytest.mark.parametrize("method", METHODS)
def test_a_plain_effect_is_found_with_its_coefficient(method):
    base, truth = truth_of("gravity_tilt")
    exact = latent(truth, base, motion())
    true = coefficients(base, truth, exact.inputs)
    found = METHODS[method](Data([exact], 1e-5, 1), SETTINGS)
    assert found.support == ("lean",)
    index = TERMS.index("lean")
    assert found.coefficients[index] == pytest.approx(true[index], rel=0.05)
    assert set(found.inclusion) == ({"lean"} if method == "ensemble" else set())


def test_a_grid_holds_every_combination_once():
    for method, ranges in RANGES.items():
        count = 1
        for values in ranges.values():
            count *= len(values)
        assert len({tuple(each.items()) for each in grid(method)}) == count
