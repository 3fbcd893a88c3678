"""Tests that planned motions are accepted, or refused in one line."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.spatial.transform import Rotation

from slosh_model.motion_profiles import quintic
from slosh_plan import SloshPlanError, Trajectory
from slosh_plan.consistency import check_consistent


def still(t):
    return Trajectory(np.asarray(t, dtype=float), np.zeros((len(t), 3)), name="m")


def with_row(row, column, value):
    acceleration = np.zeros((5, 3))
    acceleration[row, column] = value
    return Trajectory(np.arange(5) * 0.01, acceleration, name="m")


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: still([0.0, 0.2, 0.1, 0.3]), r"m: t\[2\] = 0.1 s comes before t\[1\] = 0.2 s"),
        (lambda: still([0.0, 0.1, 0.1, 0.2]), r"m: t\[2\] = 0.1 s repeats t\[1\] = 0.1 s"),
        (lambda: still([1.0, 1.0]), "m: the motion lasts 0 s"),
        (lambda: still([0.0]), "m: 1 point: a motion needs at least 2"),
        (lambda: still([]), "m: 0 points"),
        (lambda: still([0.0, np.nan, 1.0]), r"m: t\[1\] = nan is not finite"),
        (lambda: still([*np.arange(20) * 0.01, 3.0]), r"m: a gap: 2.81 s between t\[19\]"),
        (lambda: still(np.arange(1_000_000) * 1e-3), "m: 1000000 points are more than 200000"),
        (lambda: still(np.arange(10_000) * 0.1), "lasts 999.9 s, more than 600 s"),
        (lambda: with_row(3, 1, np.nan), r"m: acceleration\[3\].y = nan is not finite"),
        (lambda: with_row(3, 2, -2e3), r"m: acceleration\[3\] reaches 2000 m/s².*another unit"),
        (
            lambda: Trajectory([0.0, 1.0], np.zeros((2, 2)), name="m"),
            r"acceleration has the shape \(2, 2\), expected \(2, 3\)",
        ),
        (
            lambda: Trajectory([0.0, 1.0], np.zeros((2, 3)), np.zeros((2, 4)), name="m"),
            r"m: attitude\[0\] has the length 0",
        ),
        (lambda: Trajectory("ab", [], name="m"), "m: t is not an array of numbers"),
        (lambda: Trajectory.from_poses([0.0, 1.0], np.zeros((2, 3)), name="m"), "2 poses do not"),
        (
            lambda: Trajectory.from_poses([0.0, 1.0, 2.0], np.full((3, 3), 1e6), name="m"),
            r"m: position\[0\] reaches 1e\+06 m",
        ),
        (
            lambda: Trajectory.from_poses(np.arange(9) * 1e-3, np.eye(9, 3), name="m"),
            "Are the poses at rest at both ends",
        ),
    ],
)
def test_what_is_no_motion_is_refused_in_one_line(make, match):
    with pytest.raises(SloshPlanError, match=match) as caught:
        make()
    assert "\n" not in str(caught.value)


ANY = st.floats(width=64)


@given(
    t=arrays.arrays(float, st.integers(0, 8), elements=ANY),
    acceleration=arrays.arrays(
        float, st.tuples(st.integers(0, 8), st.integers(2, 3)), elements=ANY
    ),
    poses=st.booleans(),
)
def test_a_motion_is_made_or_refused_never_anything_else(t, acceleration, poses):
    make = Trajectory.from_poses if poses else Trajectory
    try:
        motion = make(t, acceleration)
    except SloshPlanError as error:
        assert "\n" not in str(error)
        return
    assert (np.diff(motion.t) > 0.0).all()
    assert motion.acceleration.shape == (len(motion.t), 3)
    assert not motion.acceleration.flags.writeable


def test_attitudes_between_poses_turn_smoothly():
    t = np.linspace(0.0, 1.0, 11)
    turns = Rotation.from_rotvec(np.outer(0.2 * t**2, [1.0, 0.0, 0.0]))
    motion = Trajectory.from_poses(t, np.zeros((11, 3)), turns.as_quat())
    assert np.diff(motion.t).max() <= 0.002 + 1e-9
    assert motion.angular_velocity[len(motion.t) // 2, 0] == pytest.approx(0.2, abs=0.01)
    half = motion.scaled(2.0)
    assert np.allclose(half.angular_velocity, motion.angular_velocity / 2.0)


@pytest.mark.parametrize("factor", [0.0, -1.0, np.nan, np.inf])
def test_an_impossible_scale_is_refused(factor):
    with pytest.raises(SloshPlanError, match="time scale"):
        still([0.0, 1.0]).scaled(factor)


# Positions, velocities and accelerations that are not those of one motion are refused.


RATES = (500.0, 50.0, 10.0)


def motion(rate, seconds=1.5, length=0.5):
    """Returns t, positions, velocities and accelerations of a quintic move along x."""
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
