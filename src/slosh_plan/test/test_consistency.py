"""Positions, velocities and accelerations that are not those of one motion are refused."""

import numpy as np
import pytest

from slosh_model.motion_profiles import quintic
from slosh_plan import SloshPlanError
from slosh_plan.consistency import check_consistent

RATES = (500.0, 50.0, 10.0)


def motion(rate, seconds=1.5, length=0.5):
    """t, positions, velocities, accelerations of a quintic move in x."""
    t = np.linspace(0.0, seconds, round(seconds * rate) + 1)
    place, speed, change = quintic(t / seconds)
    columns = (length * place, length * speed / seconds, length * change / seconds**2)
    return t, *(np.column_stack((one, 0.0 * one, 0.0 * one)) for one in columns)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("seconds", [0.4, 1.5, 20.0])
def test_what_agrees_is_taken(rate, seconds):
    t, position, velocity, acceleration = motion(rate, seconds)
    check_consistent("m", t, position, velocity, acceleration)
    check_consistent("m", t, position + 1.0, None, acceleration)
    check_consistent("m", t, position + 0.3 * t[:, np.newaxis], None, acceleration)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("factor", [0.0, 0.1, -1.0, 1000.0, 1.0 / 9.81])
def test_accelerations_of_another_motion_are_refused(rate, factor):
    t, position, _, acceleration = motion(rate)
    match = r"m: positions and accelerations contradict each other: from t = .* in x"
    with pytest.raises(SloshPlanError, match=match):
        check_consistent("m", t, position, None, factor * acceleration)


def test_other_axes_gravity_and_other_units_are_refused():
    t, position, velocity, acceleration = motion(100.0)
    for wrong in (acceleration[:, [1, 0, 2]], acceleration + np.array([0.0, 0.0, 9.81])):
        with pytest.raises(SloshPlanError, match="positions and accelerations"):
            check_consistent("m", t, position, None, wrong)
        with pytest.raises(SloshPlanError, match="velocities and accelerations"):
            check_consistent("m", t, None, velocity, wrong)
    with pytest.raises(
        SloshPlanError, match=r"positions and velocities .* correct the velocities"
    ):
        check_consistent("m", t, position, 1000.0 * velocity, acceleration)
    with pytest.raises(SloshPlanError, match="positions and velocities"):
        check_consistent("m", t, 1000.0 * position, velocity)


def test_the_error_tells_where_and_both_values():
    t, position, _, acceleration = motion(500.0)
    with pytest.raises(SloshPlanError) as caught:
        check_consistent("m", t, position, None, 0.0 * acceleration)
    # The greatest acceleration of the quintic is 5.77 L/T² at 0.211 T.
    assert "the positions give a mean of -1.2" in str(caught.value) or "mean of 1.2" in str(
        caught.value
    )
    assert "the accelerations 0 m/s²" in str(caught.value)
