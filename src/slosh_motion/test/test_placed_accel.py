"""Tests accelerations of a sensor anywhere on the robot against the container's true ones."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slosh_motion.inputs.frames import FixedFrames, Transform
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.inputs import APART, PLACED, InputSettings

MS = 1_000_000
ARM = np.array([0.12, -0.08, 0.05])
"""From the sensor to the container, in the tool's axes [m]."""
STEP = 1e-4
SETTINGS = InputSettings(gate=GateSettings(), modes=((1, 21.0),))


def tool(t):
    """Returns position and attitude of the tool that carries container and sensor."""
    turn = Rotation.from_euler("zyx", [0.9 * math.sin(5.0 * t), 0.3 * math.sin(7.0 * t), 0.1])
    return np.array([0.2 * math.sin(3.0 * t), 0.1 * math.cos(4.0 * t), 0.5]), turn


def place(t, arm):
    position, turn = tool(t)
    return position + turn.apply(arm)


def acceleration(t, arm):
    """Returns acceleration in world axes by finite differences of positions."""
    return (place(t - STEP, arm) - 2.0 * place(t, arm) + place(t + STEP, arm)) / STEP**2


def link(parent, child, t, position, turn=None):
    x, y, z, w = (Rotation.identity() if turn is None else turn).as_quat().tolist()
    return Transform(parent, child, round(t * 1e9), tuple(map(float, position)), (x, y, z, w))


MOUNTED = Rotation.from_euler("xyz", [math.pi, 0.0, 0.4])
STATIC = [link("tool", "container", 0.0, ARM), link("tool", "sensor", 0.0, (0, 0, 0), MOUNTED)]


def placed(rate=125.0, accel_rate=500.0, seconds=2.0, moving=True):
    """Returns the converted accelerations of a sensor, with transforms at another rate."""
    how = SETTINGS.with_mounting({PLACED: "sensor"})
    poses = how.poses("accel")
    poses.take_transforms(STATIC, fixed=True)
    found, next_tf = [], 0.0
    for t in np.arange(0.0, seconds, 1.0 / accel_rate).tolist():
        while moving and next_tf <= t:
            found += poses.take_transforms([link("world", "tool", next_tf, *tool(next_tf))])
            next_tf += 1.0 / rate
        felt = (tool(t)[1] * MOUNTED).inv().apply(acceleration(t, np.zeros(3)))
        found += poses.take(round(t * 1e9), tuple(felt.tolist()))
    return poses, found


@pytest.mark.parametrize(
    ("ahead", "wrong"), [(0.0, None), (0.1, True), (-0.1, False)], ids=["alike", "ahead", "late"]
)
def test_transforms_with_another_clock_than_the_sensors_are_named(ahead, wrong):
    poses = SETTINGS.with_mounting({PLACED: "sensor"}).poses("accel")
    poses.take_transforms(STATIC, fixed=True)
    for k in range(1000):
        t, at_ns = 0.002 * k, (2 * k + 1) * MS
        if k % 4 == 0:
            moved = link("world", "tool", t + ahead, *tool(t))
            poses.take_transforms([moved], at_ns=at_ns)
        poses.take(2 * k * MS, (0.0, 0.0, 0.0), at_ns)
    doubt = poses.clock_doubt()
    if wrong is None:
        assert doubt is None
        return
    assert doubt.wrong == wrong
    told = "99 ms ahead of their arrival" if wrong else "arrive 101 ms after their stamps"
    assert doubt.text.startswith(f"the transforms of 'tool' {'are stamped ' * wrong}{told}")
    assert "the accelerations" in doubt.text


@pytest.mark.parametrize("rate", [60.0, 125.0, 500.0])
def test_rotation_and_lever_arm_come_from_transforms_at_any_rate(rate):
    _, found = placed(rate)
    assert len(found) > 800
    t = np.array([one.stamp_ns * 1e-9 for one in found])
    true = np.array([acceleration(moment, ARM) for moment in t])
    got = np.array([one.vector for one in found])
    sensors = np.array([acceleration(moment, np.zeros(3)) for moment in t])
    arm = np.abs(true - sensors).max()
    assert arm > 2.0  # m/s²: it matters
    assert np.abs(got - true).max() < 0.05 * arm
    for moment, one in zip(t[::50], found[::50], strict=True):
        apart = Rotation.from_quat(one.pose[:4]) * tool(moment)[1].inv()
        assert apart.magnitude() < 0.01


def test_each_acceleration_is_answered_once_in_order():
    _, found = placed(125.0)
    stamps = [one.stamp_ns for one in found]
    assert (np.diff(stamps) == 2 * MS).all()


def test_without_transforms_it_says_what_is_missing():
    poses, found = placed(seconds=3.0, moving=False)
    assert not found
    assert "accelerations in the frame 'sensor' wait for moving transforms" in poses.trouble()
    poses = SETTINGS.with_mounting({PLACED: "sensor"}).poses("accel")
    for k in range(60):
        poses.take_transforms([link("odom", "tool", 0.01 * k, *tool(0.01 * k))])
    assert "do not connect 'world' with 'container'" in poses.trouble()


def test_a_gap_of_the_transforms_leaves_the_accelerations_in_it_out():
    how = SETTINGS.with_mounting({PLACED: "sensor"})
    poses = how.poses("accel")
    poses.take_transforms(STATIC, fixed=True)
    found = []
    for k in range(1500):
        t = 0.002 * k
        if not 1.0 < t < 1.5 and k % 4 == 0:
            found += poses.take_transforms([link("world", "tool", t, *tool(t))])
        found += poses.take(round(t * 1e9), (0.0, 0.0, 0.0))
    moments = [one.stamp_ns * 1e-9 for one in found]
    assert not [t for t in moments if 1.02 < t < 1.48]
    assert len([t for t in moments if t > 1.6]) > 400


def fixed_frames(*links):
    frames = FixedFrames()
    frames.take(links)
    return frames


ON_CUP = fixed_frames(*STATIC)
AT_CUP = fixed_frames(link("container", "sensor", 0.0, (0, 0, 0), MOUNTED))
IN_WORLD = fixed_frames(link("world", "base", 0.0, (1.0, 2.0, 0.0), MOUNTED))


@pytest.mark.parametrize(
    ("fixed", "frame", "moving", "found"),
    [
        (ON_CUP, "forearm", True, {PLACED: "forearm"}),
        (ON_CUP, "forearm", False, None),
        (ON_CUP, "world", True, {}),
        (ON_CUP, "container", True, {}),
    ],
)
def test_how_a_frame_is_mounted(fixed, frame, moving, found):
    assert SETTINGS.mounted("accel", frame, fixed, moving=moving) == found


def test_a_frame_fixed_beside_the_container_tells_its_mounting_for_the_second_source():
    how = SETTINGS.with_mounting(SETTINGS.mounted("accel", "sensor", ON_CUP, moving=True))
    assert how.placed == "sensor"
    expected, in_world = how.expected("accel", "sensor")
    assert not in_world
    assert expected.rotation == pytest.approx(MOUNTED.as_matrix(), abs=1e-9)
    assert expected.to_origin == pytest.approx(ARM)
    sample = how.reader("accel").update(MS, "world", 1.0, 2.0, 3.0)  # placed already
    assert sample[1:4] == (1.0, 2.0, 3.0)


def test_a_frame_at_the_container_or_in_the_world_gives_its_axes():
    for fixed, frame in ((AT_CUP, "sensor"), (IN_WORLD, "base")):
        told = SETTINGS.mounted("accel", frame, fixed, moving=True)
        reader = SETTINGS.with_mounting(told).reader("accel")
        sample = reader.update(MS, frame, 1.0, 2.0, 3.0)
        assert sample[1:4] == pytest.approx(MOUNTED.apply([1.0, 2.0, 3.0]))


def test_an_arm_whose_turning_nothing_tells_is_refused_in_one_line():
    told = SETTINGS.mounted("accel", "sensor", ON_CUP, moving=False)
    assert told[APART]
    reader = SETTINGS.with_mounting(told).reader("accel")
    assert reader.update(MS, "sensor", 1.0, 2.0, 3.0) is None
    assert reader.warning() == (
        "accelerations in frame 'sensor', 0.153 m from the container, are dropped: nothing tells "
        "how it turns; publish transforms from the world to the container, or use the input imu "
        "or pose"
    )
