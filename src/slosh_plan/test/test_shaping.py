import math
from dataclasses import replace

import numpy as np
import pytest

from slosh_model import Cylinder, Model, Rectangle
from slosh_plan import Trajectory
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.checked import checked
from slosh_plan.shaping.filters import FILTERS, Damped
from slosh_plan.shaping.shaped import (
    course_of,
    deviation,
    excited_modes,
    filter_for,
    residual_free,
    residual_free_motion,
    shaped,
    shaped_per_axis,
)

CUP = Model(Cylinder(0.05, 0.07), damping_ratio=0.03)
FIRST = CUP.mode_constants()[0]
MODE = Damped(FIRST.natural_frequency, FIRST.damping_ratio)


def wave_left(acceleration, t, mode):
    """Returns the amplitude [m] of an oscillator after the motion, by quadrature."""
    pole = complex(-mode.decay, mode.damped_frequency)
    value = np.trapezoid(acceleration * np.exp(pole * (t[-1] - t)), t)
    return abs(value) / mode.damped_frequency


def residual_of(model, motion):
    """Returns the simulated height right after the motion's end [m]."""
    return checked(model, [motion], None)[0].residual


@pytest.fixture(scope="module")
def course(line):
    return course_of(line(0.9))


@pytest.fixture(scope="module")
def bend():
    """Returns a motion along a quarter of a circle."""
    t = np.linspace(0.0, 1.2, 121)
    u = t / 1.2
    angle = 0.5 * math.pi * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    places = 0.2 * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle])
    return course_of(Trajectory.from_poses(t, places))


@pytest.mark.parametrize("damping", [0.0, 0.006, 0.1])
@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_keeps_the_sum_and_has_its_zero_at_the_mode(name, damping):
    mode = Damped(19.0, damping)
    made = FILTERS[name](mode)
    assert made.amplitudes.sum() == pytest.approx(1.0, abs=1e-14)
    assert (made.amplitudes > 0.0).all()
    assert 0.0 <= made.times.min() <= made.times.max() <= made.length
    # The average's zeros are those of an undamped mode: of a damped one about ζ is left.
    left = made.residual(mode)
    assert left < (damping if name == "average" else 0.0) + 1e-12
    if name == "average":
        decay = math.exp(-mode.decay * mode.period)
        assert left == pytest.approx((1.0 - decay) / (19.0 * mode.period), abs=1e-12)


@pytest.mark.parametrize("name", [*FILTERS, "polynomial"])
def test_no_wave_of_the_linear_model_is_left(course, name):
    motion = (
        residual_free_motion(course, MODE)
        if name == "polynomial"
        else shaped(course, FILTERS[name](MODE))
    )
    plain = wave_left(course.motion().acceleration[:, 0], course.motion().t, MODE)
    left = wave_left(motion.acceleration[:, 0], motion.t, MODE)
    bound = 1.2 * MODE.damping_ratio if name == "average" else 1e-3
    assert left < bound * plain
    # The product's own linear model agrees; its nonlinear one, honestly, does not quite.
    assert residual_of(CUP, motion) < (bound + 2e-3) * residual_of(CUP, course.motion())
    if name != "average":
        assert residual_of(CUP.nonlinear(), motion) > residual_of(CUP, motion)


@pytest.mark.parametrize("name", FILTERS)
def test_the_path_stays_along_its_length_and_is_bent_per_axis(bend, name):
    made = FILTERS[name](MODE)
    along, axes = shaped(bend, made), shaped_per_axis(bend, made)
    assert deviation(bend, along) < 1e-6
    assert deviation(bend, axes) > 1e-3
    for motion in (along, axes):
        assert motion.duration == pytest.approx(bend.duration + made.length, abs=1.1e-3)
        assert motion.position[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
        assert motion.position[-1] == pytest.approx([0.2, 0.2, 0.0], abs=1e-5)
        # Its columns are derivatives of each other.
        velocity = np.gradient(motion.position, 1e-3, axis=0)
        assert np.linalg.norm(velocity, axis=1)[3:-3] == pytest.approx(
            motion.speed[3:-3], abs=3e-3
        )
    # Per axis the filter is linear: what is left is zero; along a bend it is not quite.
    flat = Model(Cylinder(0.05, 0.07), damping_ratio=0.03)
    assert residual_of(flat, axes) < (0.05 if name == "average" else 0.005) * residual_of(
        flat, bend.motion()
    )


def test_accelerations_alone_tell_the_path(line):
    motion = line(0.9)
    course = course_of(replace(motion, position=None))
    assert course.motion().position == pytest.approx(motion.position, abs=1e-4)
    with pytest.raises(SloshPlanError, match=r"end at a speed of .* m/s"):
        course_of(Trajectory(motion.t[:500], motion.acceleration[:500]))


def test_a_motion_that_turns_back_rests_there(line):
    there = line(0.9)
    t = np.concatenate([there.t, there.t[1:] + 0.9])
    places = np.concatenate([there.position, there.position[-2::-1]])
    course = course_of(Trajectory.from_poses(t, places))
    assert len(course.path.legs) == 2
    made = FILTERS["zv"](MODE)
    motion = shaped(course, made)
    assert motion.duration == pytest.approx(1.8 + 2.0 * made.length, abs=1.1e-3)
    assert deviation(course, motion) < 1e-6
    assert motion.position[:, 0].max() == pytest.approx(0.4, abs=1e-4)
    assert residual_of(CUP, motion) < 5e-3 * residual_of(CUP, course.motion())


@pytest.mark.parametrize("duration", [0.4, 0.9, 1.37, 2.5])
def test_the_polynomial_is_at_rest_at_both_ends_and_has_no_part_at_the_pole(duration):
    law = residual_free(MODE, duration)
    u = np.linspace(0.0, 1.0, 20_001)
    place, rate, change = law(u)
    assert (place[0], place[-1]) == pytest.approx((0.0, 1.0), abs=1e-12)
    assert [*rate[[0, -1]], *change[[0, -1]]] == pytest.approx([0.0] * 4, abs=1e-9)
    assert np.gradient(place, u)[1:-1] == pytest.approx(rate[1:-1], abs=1e-5)
    assert np.gradient(rate, u)[1:-1] == pytest.approx(change[1:-1], abs=1e-2)
    assert wave_left(change, u * duration, MODE) < 1e-6 * np.abs(change).max()


def test_the_polynomial_does_not_run_backwards():
    for periods in (0.8, 90.0):
        with pytest.raises(SloshPlanError, match=f"{periods:.1f} periods of the liquid, has no"):
            residual_free(MODE, periods * MODE.period)


def test_a_rectangle_is_shaped_for_both_sides_where_both_are_excited():
    tank = Model(Rectangle(0.08, 0.06, 0.07))
    along, across = np.eye(3)[:1], np.eye(3)[1:2]
    assert len(excited_modes(tank, along)) == len(excited_modes(tank, across)) == 1
    assert excited_modes(tank, along) == excited_modes(tank, across, 0.5 * math.pi)
    both = np.concatenate([along, across])
    one, other = excited_modes(tank, both)
    made = filter_for(tank, "zv", both)
    assert (made.name, len(made.times)) == ("zv", 4)
    assert max(made.residual(one), made.residual(other)) < 1e-12


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: filter_for(CUP, "zvx", np.ones((2, 3))), "filter 'zvx' is not one of zv, zvd"),
        (lambda: Damped(0.0, 0.1), "frequency = 0.0 rad/s"),
        (lambda: Damped(19.0, 1.0), "damping ratio = 1.0"),
    ],
)
def test_what_is_none_is_refused(make, text):
    with pytest.raises(SloshPlanError, match=text):
        make()
