"""Tests what the governor knows of the liquid at past moments."""

import numpy as np
import pytest

from slosh_governor.core.past import PastLiquid
from slosh_governor.tuning import TUNING
from slosh_model import Cylinder, Model
from slosh_model.layout import divided
from slosh_model.simulate import Simulator

CUP = Model(Cylinder(0.05, 0.07))
STEP = 10_000_000


def filled(count):
    """Returns the past of a liquid in a jerked cup, and its displacements every millisecond."""
    coarse, fine = Simulator(CUP), Simulator(CUP)
    past, found = PastLiquid(coarse.store[np.newaxis]), [0.0]
    for one in (coarse, fine):
        one.step(0.0, 0.0, 0.0, 0.0)
    for number in range(count):
        past.add((number + 1) * STEP, coarse.store[np.newaxis], np.array([0.1 * number, 0.0, 0.0]))
        for part in range(1, 11):
            fine.step(0.001, 0.1 * number + 0.01 * part, 0.0, 0.0)
            found.append(fine.modal[0, 0])
        coarse.step(0.01, 0.1 * (number + 1), 0.0, 0.0)
    return past, np.array(found)


def displacement(past, stamp):
    store = past.at(stamp)[0]
    return divided(store)[1]["x"][0]


@pytest.mark.parametrize("ms", [0, 10, 13, 25, 89, 90])
def test_the_state_at_a_moment_between_two_steps_is_simulated(ms):
    past, found = filled(10)
    assert displacement(past, STEP + ms * 1_000_000) == pytest.approx(found[ms], abs=1e-9)
    # It is a copy.
    past.at(STEP)[:] = 7.0
    assert displacement(past, STEP) == 0.0


def test_moments_before_the_first_step_and_after_the_last_one_are_not_known():
    past, _ = filled(3)
    assert past.at(STEP - 1) is None
    assert past.at(3 * STEP + 1) is None
    assert PastLiquid(np.zeros((1, 3))).at(5) is None


def test_old_steps_are_overwritten():
    past, found = filled(TUNING.past + 10)
    assert past.at(5 * STEP) is None
    last = TUNING.past + 5
    assert displacement(past, (last + 1) * STEP) == pytest.approx(found[10 * last], abs=1e-9)
