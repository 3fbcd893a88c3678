"""Tests the simulated cell's motion tables, sensors and reference liquid."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from slosh_base.files.errors import SloshFileError
from slosh_bringup.cell.motion_source import load_motion, motion_from_table
from slosh_bringup.cell.motions import LEVELS, MOTIONS, VERTICAL_LEVELS, CellMotion, make_motion
from slosh_bringup.cell.truth import Push, integrate_truth, read_sensors
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.processes import config_folder
from slosh_model.constants import GRAVITY
from slosh_model.model_text import read_model
from slosh_motion.tables.motion_table import MotionTable, write_motion_table

TRUTH = read_model(config_folder() / "truth.yaml")


def tilted(angle, t):
    """Returns the motion of a container at rest that is tilted about x."""
    quaternion = Rotation.from_euler("x", angle).as_quat()
    rest = np.zeros((len(t), 3))
    return CellMotion("tilt", t, rest, rest, np.tile(quaternion, (len(t), 1)))


def test_a_tables_motion_is_the_one_that_was_written(tmp_path):
    motion = make_motion("e3", 200.0)
    path = tmp_path / "motion.csv.gz"
    write_motion_table(path, MotionTable(motion.t + 5.0, motion.acceleration))
    played = load_motion(str(path), 1000.0)
    assert played.name == "motion.csv.gz"
    assert played.t[0] == 0.0
    assert played.duration == pytest.approx(motion.duration, abs=0.001)
    assert played.acceleration[::5] == pytest.approx(motion.acceleration[: len(played.t[::5])])
    assert played.position[::5] == pytest.approx(motion.position, abs=1e-3)
    assert played.attitude is played.angular_velocity is None


def test_attitude_is_sampled_as_a_rotation_and_gives_the_turning():
    t = np.linspace(0.0, 1.0, 11)
    turn = Rotation.from_rotvec(np.outer(2.0 * t, (0.0, 0.0, 1.0)))
    quaternions = turn.as_quat() * np.where(np.arange(11) % 2, -1.0, 1.0)[:, np.newaxis]
    motion = motion_from_table("x", MotionTable(t, np.zeros((11, 3)), quaternions), 100.0)
    assert np.linalg.norm(motion.attitude, axis=1) == pytest.approx(1.0)
    expected = np.outer(2.0 * motion.t, (0.0, 0.0, 1.0))
    assert Rotation.from_quat(motion.attitude).as_rotvec() == pytest.approx(expected)
    assert motion.angular_velocity == pytest.approx(np.tile((0.0, 0.0, 2.0), (101, 1)))


def test_tables_that_are_no_motion_are_refused(tmp_path):
    rest = np.zeros((2, 3))
    with pytest.raises(SloshBringupError, match=r"x: lasts less than two samples at 10 Hz"):
        motion_from_table("x", MotionTable(np.array([0.0, 0.05]), rest), 10.0)
    with pytest.raises(SloshBringupError, match=r"rate = -1"):
        motion_from_table("x", MotionTable(np.array([0.0, 1.0]), rest), -1.0)
    quaternion = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
    with pytest.raises(SloshBringupError, match=r"x: qx, qy, qz, qw: all zero at t = 1 s"):
        motion_from_table("x", MotionTable(np.array([0.0, 1.0]), rest, quaternion), 10.0)
    with pytest.raises(SloshFileError, match=r"none\.csv"):
        load_motion(str(tmp_path / "none.csv"))


def test_an_accelerometer_at_rest_feels_gravity_upwards_in_its_own_axes():
    motion = tilted(0.3, np.arange(3) / 10.0)
    expected = GRAVITY * np.array([0.0, np.sin(0.3), np.cos(0.3)])
    assert motion.specific_force() == pytest.approx(np.tile(expected, (3, 1)))
    upright = make_motion("c", 100.0)
    assert upright.specific_force()[0] == pytest.approx((0.0, 0.0, GRAVITY))


def test_sensor_noise_has_its_size_repeats_with_its_seed_and_differs_between_sensors():
    motion = make_motion("c3")
    readings, again = read_sensors(motion, 0.02, 3), read_sensors(motion, 0.02, 3)
    other = read_sensors(motion, 0.02, 4)
    accel = readings.acceleration - motion.acceleration
    force = readings.specific_force - motion.specific_force()
    assert accel.std() == pytest.approx(0.02, rel=0.02)
    assert force.std() == pytest.approx(0.02, rel=0.02)
    assert abs(np.corrcoef(accel.ravel(), force.ravel())[0, 1]) < 0.02
    assert np.array_equal(readings.acceleration, again.acceleration)
    assert not np.array_equal(readings.acceleration, other.acceleration)
    assert not readings.angular_velocity.any()
    assert np.array_equal(readings.attitude[-1], (0.0, 0.0, 0.0, 1.0))


def test_a_tilt_and_the_acceleration_that_feels_the_same_move_the_liquid_alike():
    t = np.arange(2000) / 1000.0
    angle = 0.1
    felt = GRAVITY * np.array([0.0, np.sin(angle), np.cos(angle) - 1.0])
    pushed = CellMotion("push", t, np.zeros((2000, 3)), np.tile(felt, (2000, 1)))
    by_tilt = integrate_truth(TRUTH, tilted(angle, t))
    by_push = integrate_truth(TRUTH, pushed)
    assert by_tilt.sh_y == pytest.approx(by_push.sh_y, abs=1e-9)
    assert np.abs(by_tilt.sh_y).max() > 0.005


# The simulated cell's motions.


@pytest.mark.first(8)
@pytest.mark.parametrize("name", MOTIONS)
def test_motions_start_and_end_at_rest_and_move_as_they_accelerate(name):
    motion = make_motion(name)
    velocity = cumulative_simpson(motion.acceleration, x=motion.t, axis=0, initial=0)
    position = cumulative_simpson(velocity, x=motion.t, axis=0, initial=0)
    assert velocity[-1] == pytest.approx(np.zeros(3), abs=1e-4)
    assert position == pytest.approx(motion.position, abs=1e-3)
    assert not motion.acceleration[motion.t < 0.99].any()
    assert not motion.acceleration[motion.t > motion.t[-1] - 2.9].any()


@pytest.mark.parametrize("path", LEVELS)
def test_levels_are_those_of_the_paper(path):
    for level in LEVELS[path]:
        a = make_motion(f"{path}-{level}").acceleration
        assert np.hypot(a[:, 0], a[:, 1]).max() == pytest.approx(level, rel=1e-3)
        assert not a[:, 2].any()
    for vertical in VERTICAL_LEVELS:
        a = make_motion(f"{path}3-{vertical}").acceleration
        assert np.abs(a[:, 2]).max() == pytest.approx(vertical, rel=1e-3)
        assert np.hypot(a[:, 0], a[:, 1]).max() == pytest.approx(LEVELS[path][1], rel=1e-3)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_a_rate_that_is_none_is_refused(rate):
    with pytest.raises(SloshBringupError, match="must be positive"):
        make_motion("c", rate)


def test_a_push_gives_the_liquid_its_speed_and_no_sensor_tells_it():
    motion = load_motion("l", 1000.0)
    push = Push(0.1, 0.05)
    given = push.acceleration(motion.t)
    assert np.trapezoid(given[:, 0], motion.t) == pytest.approx(-0.05, rel=1e-3)
    pushed, alone = (integrate_truth(TRUTH, motion, one) for one in (push, None))
    before, after = motion.t < 0.1, (motion.t > 0.2) & (motion.t < 0.5)
    assert np.array_equal(pushed.sh_x[before], alone.sh_x[before])
    assert np.abs(pushed.sh_x - alone.sh_x)[after].max() > 1e-3
