"""Tests that wrong mountings of a sensor are reported and right ones are not."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_motion.mounting.columns import axis_rotations, nearest, roll_pitch_yaw
from slosh_motion.mounting.verdict import Expected, MountingVerdict
from slosh_motion.mounting.watch import MountingWatch

RATE, UP = 200, np.array([0.0, 0.0, 9.81])
UNITS = {"m/s²": 1.0, "g": 1.0 / 9.81, "mm/s²": 1000.0}
QUARTER = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Sensor <- container, a quarter of a turn about z."""
YAW, LEAN = 0.6, 0.15


class Moved:
    """A container that moves to and fro, yaws and tilts, with rests before and after.

    Args:
        along: share of the motion along x, y and z [m/s²].
        turns: whether it yaws and leans.
        seconds: of the motion.
    """

    def __init__(self, along=(3.0, 2.0, 1.0), *, turns=True, seconds=2.0, before=1.0):
        self.t = np.arange(-before, seconds + 1.5, 1.0 / RATE)
        s = np.clip(self.t / seconds, 0.0, 1.0)
        bump = np.sin(np.pi * s) ** 4
        wave = np.stack([np.sin(2 * np.pi * k * s) for k in (1, 2, 3)], axis=1) * bump[:, None]
        self.acceleration = wave * np.array(along)
        share = turns * np.sin(np.pi * s) ** 4
        angles = np.stack([LEAN * share, 0.0 * share, YAW * share * np.sin(2 * np.pi * s)], axis=1)
        roll, _, yaw = angles.T
        cr, sr, cy, sy = np.cos(roll), np.sin(roll), np.cos(yaw), np.sin(yaw)
        zero, one = 0.0 * roll, 0.0 * roll + 1.0
        about_z = np.stack([cy, -sy, zero, sy, cy, zero, zero, zero, one], -1).reshape(-1, 3, 3)
        about_x = np.stack([one, zero, zero, zero, cr, -sr, zero, sr, cr], -1).reshape(-1, 3, 3)
        self.turn = about_z @ about_x
        half_z, half_x = 0.5 * yaw, 0.5 * roll
        self.quaternion = np.stack(
            [
                np.cos(half_z) * np.sin(half_x), np.sin(half_z) * np.sin(half_x),
                np.sin(half_z) * np.cos(half_x), np.cos(half_z) * np.cos(half_x),
            ],
            axis=1,
        )  # fmt: skip
        droll, dyaw = np.gradient(roll, self.t), np.gradient(yaw, self.t)
        self.rate = np.stack([droll, sr * dyaw, cr * dyaw], axis=1)
        self.turning = np.gradient(self.rate, self.t, axis=0)

    @property
    def force(self):
        return np.einsum("nij,ni->nj", self.turn, self.acceleration + UP)

    @property
    def weight(self):
        return np.einsum("nij,ni->nj", self.turn, np.tile(UP, (len(self.t), 1)))


def compared(
    moved,
    force,
    rate=None,
    *,
    imu=True,
    said=None,
    place=(0.0, 0.0, 0.0),
    late=0.0,
    noise=0.02,
    rough=0.0,
) -> MountingVerdict | None:
    random = np.random.default_rng(1)
    expected = Expected(np.eye(3) if said is None else said, np.array(place), imu, imu)
    watch = MountingWatch(expected, in_world=not imu)
    scale = np.abs(force).max() / 10.0
    noisy = force + random.normal(0.0, noise * scale, force.shape)
    rates = [None] * len(force) if rate is None else [tuple(row) for row in rate.tolist()]
    for t, row, w in zip(moved.t.tolist(), noisy.tolist(), rates, strict=True):
        watch.take_sensor(round((t + late + 100.0) * 1e9), tuple(row), w)
    poses = np.hstack([moved.quaternion, moved.rate, moved.turning])
    told = moved.acceleration + random.normal(0.0, rough, moved.acceleration.shape)
    for t, a, pose in zip(moved.t.tolist(), told.tolist(), poses, strict=True):
        watch.take_motion(round((t + 100.0) * 1e9), tuple(a), pose.tolist())
    watch.look(finished=True)
    return watch.verdict


MOVED = Moved()


def test_a_right_sensor_is_right():
    found = compared(MOVED, MOVED.force, MOVED.rate)
    assert found is not None
    assert (found.wrong, found.remarks, found.unseen) == ((), (), ())
    assert found.fit.gain == pytest.approx(1.0, abs=0.01)
    assert found.fit.gravity == pytest.approx(1.0, abs=0.01)
    assert found.fit.lag == pytest.approx(0.0, abs=0.002)
    assert found.fit.explained > 0.99


EVERY = list(itertools.product(range(24), UNITS, (True, False)))
FEW = [(5, "m/s²", True), (14, "g", False), (23, "mm/s²", True)]


def check_named(number, unit, gravity, kind):
    rotation = axis_rotations()[number]
    if kind == "imu":
        force = MOVED.force - (0.0 if gravity else MOVED.weight)
    else:
        force = MOVED.acceleration + (UP if gravity else 0.0)
    degrees = number % 2 == 1
    rate = MOVED.rate @ rotation.T * (np.degrees(1.0) if degrees else 1.0)
    found = compared(
        MOVED, UNITS[unit] * force @ rotation.T, rate if kind == "imu" else None, imu=kind == "imu"
    )
    assert found is not None
    said = "; ".join(found.wrong)
    turned = not np.array_equal(rotation, np.eye(3))
    assert ("set sensor_rotation to" in said) == turned
    if turned:
        angles = "[{:.4f}, {:.4f}, {:.4f}]".format(*roll_pitch_yaw(rotation.T))
        assert angles.replace("-0.0000", "0.0000") in said
    assert (f"it is in {unit}" in said) == (unit != "m/s²")
    left_out, contained = "gravity is left out" in said, "gravity is contained" in said
    assert (left_out, contained) == ((not gravity, False) if kind == "imu" else (False, gravity))
    assert ("in degrees/s" in said) == (degrees and kind == "imu")
    assert "left-handed" not in said


@pytest.mark.parametrize("kind", ["imu", "accel"])
@pytest.mark.parametrize(("number", "unit", "gravity"), FEW)
def test_a_few_wrong_mountings_are_named_with_the_remedy(number, unit, gravity, kind):
    check_named(number, unit, gravity, kind)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["imu", "accel"])
@pytest.mark.parametrize(("number", "unit", "gravity"), EVERY)
def test_every_wrong_mounting_is_named_with_the_remedy(number, unit, gravity, kind):
    check_named(number, unit, gravity, kind)


@pytest.mark.first(3)
@pytest.mark.parametrize("number", range(24))
def test_a_turned_sensor_that_is_said_to_be_turned_is_right(number):
    rotation = axis_rotations()[number]
    found = compared(MOVED, MOVED.force @ rotation.T, MOVED.rate @ rotation.T, said=rotation.T)
    assert found is not None
    assert found.wrong == ()


@pytest.mark.parametrize("axis", range(3))
def test_a_mirrored_axis_is_named(axis):
    flip = np.diag([-1.0 if one == axis else 1.0 for one in range(3)])
    found = compared(MOVED, MOVED.force @ flip, MOVED.rate @ flip)
    assert found is not None
    assert found.wrong == (f"its axes are left-handed: reverse the sign of its {'xyz'[axis]}",)


def test_gravity_of_the_other_sign_is_named():
    found = compared(MOVED, MOVED.force - 2.0 * MOVED.weight)
    assert found is not None
    assert len(found.wrong) == 1
    assert "gravity has the wrong sign against the motion" in found.wrong[0]


def test_gravity_that_was_subtracted_from_a_sensor_in_g_is_named():
    found = compared(MOVED, (MOVED.acceleration + UP) / 9.81 - UP, imu=False)
    assert found is not None
    said = "; ".join(found.wrong)
    assert "it is in g" in said
    assert "9.81 was subtracted from it in that unit" in said


def test_a_gyroscope_with_other_axes_is_named():
    found = compared(MOVED, MOVED.force, MOVED.rate @ QUARTER.T)
    assert found is not None
    assert any("other axes than its acceleration: x, y, z along the container's +y, -x, +z" in one
               for one in found.wrong)  # fmt: skip


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9),
    st.floats(0.5, 2.0),
    st.floats(-0.1, 0.1),
)
@settings(max_examples=15, deadline=None)
def test_any_rotation_gain_and_lag_is_measured(numbers, gain, late):
    matrix = np.array(numbers).reshape(3, 3)
    if abs(np.linalg.det(matrix)) < 0.05:
        return
    rotation = nearest(matrix)
    found = compared(
        MOVED, gain * MOVED.force @ rotation.T, MOVED.rate @ rotation.T, late=late, said=rotation.T
    )
    assert found is not None
    assert np.allclose(found.fit.rotation, rotation, atol=0.02)
    assert found.fit.gain == pytest.approx(gain, rel=0.02)
    assert found.fit.lag == pytest.approx(late, abs=0.003)
    assert bool(found.wrong) == (abs(gain - 1.0) > 0.1 + 1e-3) or abs(gain - 1.0) < 0.12


def test_the_place_of_a_sensor_is_measured_where_the_container_turns():
    place = np.array([0.1, -0.2, 0.05])
    spin = np.cross(MOVED.rate, np.cross(MOVED.rate, place))
    force = MOVED.force + np.cross(MOVED.turning, place) + spin
    found = compared(MOVED, force, MOVED.rate, noise=0.002)
    assert found is not None
    assert found.wrong == ()
    assert any("sensor_to_origin is about" in one for one in found.remarks)
    assert np.all(np.abs(found.fit.arm - place) < 0.02 + 3.0 * found.fit.arm_error)
    told = compared(MOVED, force, MOVED.rate, place=-place, noise=0.002)
    assert told is not None
    assert told.remarks == ()


def test_what_a_motion_along_one_axis_does_not_show_is_told():
    line = Moved((3.0, 0.0, 0.0), turns=False)
    found = compared(line, line.acceleration, imu=False)
    assert found is not None
    assert found.wrong == ()
    assert any("a turn about the container's x" in one for one in found.unseen)
    turned = compared(line, line.acceleration @ QUARTER.T, imu=False)
    assert turned is not None
    assert "set sensor_rotation to [0.0000, 0.0000, 1.5708]" in turned.wrong[0]


def test_a_sensor_of_another_body_is_named():
    found = compared(
        MOVED,
        Moved((0.5, -3.0, 0.0), seconds=1.1).force[: len(MOVED.t)].repeat(2, 0)[: len(MOVED.t)],
    )
    assert found is not None
    assert "another body" in found.wrong[0]


def test_a_sensor_that_stands_still_while_the_container_moves_is_named():
    found = compared(MOVED, np.tile(UP, (len(MOVED.t), 1)))
    assert found is not None
    assert "another body" in found.wrong[0]


@pytest.mark.parametrize("rough", [0.5, 2.0, 5.0, 15.0])
def test_noise_of_the_motion_accuses_no_sensor(rough):
    found = compared(MOVED, MOVED.force, MOVED.rate, rough=rough)
    assert found is not None
    assert found.wrong == ()


def test_a_wrong_unit_is_named_in_spite_of_some_noise_of_the_motion():
    found = compared(MOVED, MOVED.force / 9.81, MOVED.rate, rough=0.5)
    assert found is not None
    assert found.wrong == ("it is in g: publish m/s² (9.81 times as much)",)


def test_a_robot_that_stands_with_a_noisy_tracker_is_not_compared():
    still = Moved((0.0, 0.0, 0.0), turns=False, seconds=3.0)
    found = compared(still, still.force, np.zeros_like(still.force), rough=2.0)
    assert found is None or found.wrong == ()
    assert found is None or "too small for its noise" in found.unseen[0]


def test_nothing_is_said_without_a_motion():
    still = Moved((0.1, 0.0, 0.0), turns=False)
    assert compared(still, still.force) is None


def test_values_that_cannot_be_and_time_that_goes_back_do_no_harm():
    watch = MountingWatch(Expected(np.eye(3), np.zeros(3), True))
    for stamp in (5, 10, 7, 10, 10**19, 3):
        for value in (np.nan, np.inf, -1e300, 0.0):
            watch.take_sensor(stamp, (value, 0.0, 9.81), (0.0, value, 0.0))
        watch.take_motion(stamp, (1.0, 0.0, 0.0), None)
        watch.look()
    assert watch.verdict is None


def test_a_sensor_that_slips_is_named_by_the_next_motion():
    expected = Expected(np.eye(3), np.zeros(3), True)
    watch = MountingWatch(expected)
    answers = []
    for number, rotation in enumerate((np.eye(3), QUARTER, QUARTER, np.eye(3))):
        begin = 100.0 + 10.0 * number
        force, rate = MOVED.force @ rotation.T, MOVED.rate @ rotation.T
        poses = np.hstack([MOVED.quaternion, MOVED.rate, MOVED.turning])
        for k, t in enumerate(MOVED.t.tolist()):
            stamp = round((begin + t) * 1e9)
            watch.take_sensor(stamp, tuple(force[k]), tuple(rate[k]))
            watch.take_motion(stamp, tuple(MOVED.acceleration[k]), poses[k].tolist())
            if k % 100 == 0:
                watch.look()
        watch.look()
        assert watch.verdict is not None
        answers.append(bool(watch.verdict.wrong))
    assert answers == [False, True, True, False]
    assert watch.motions == 4
