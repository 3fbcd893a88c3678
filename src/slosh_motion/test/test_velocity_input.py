"""Tests odometry and twists against motions whose derivatives are known."""

import math

import numpy as np
import pytest

from slosh_motion.inputs.frames import SensorTransform
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.inputs import ODOMETRY, TWIST, InputSettings
from slosh_motion.inputs.velocity_input import Twist

BEGIN = 1_700_000_000_000_000_000
ARM = (0.3, 0.1, 0.2)


def vehicle(t):
    """Returns x, y and yaw of a vehicle on a curve, and their first two derivatives."""
    x, y, yaw = 0.8 * np.sin(1.3 * t), 0.5 * np.cos(2.1 * t), 0.7 * np.sin(1.7 * t)
    return np.stack([x, y, yaw])


def derivative(t, order=1, step=1e-4):
    if order == 1:
        return (vehicle(t + step) - vehicle(t - step)) / (2.0 * step)
    return (vehicle(t + step) - 2.0 * vehicle(t) + vehicle(t - step)) / step**2


def truth(t):
    """Returns the acceleration (N, 3) [m/s²] of a point at ARM on the vehicle."""
    (ax, ay, turning), (_, _, rate), (_, _, yaw) = derivative(t, 2), derivative(t), vehicle(t)
    c, s = np.cos(yaw), np.sin(yaw)
    rx, ry = c * ARM[0] - s * ARM[1], s * ARM[0] + c * ARM[1]
    return np.column_stack(
        [ax - turning * ry - rate**2 * rx, ay + turning * rx - rate**2 * ry, 0.0 * t]
    )


def twist_at(t, kind, frame="", own=True):
    """Returns the velocity message of a vehicle, in its own axes or in the world's."""
    (vx, vy, rate), yaw = derivative(t), float(vehicle(t)[2])
    c, s = math.cos(yaw), math.sin(yaw)
    linear = (c * vx + s * vy, c * vy - s * vx, 0.0) if own else (vx, vy, 0.0)
    turn = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)) if kind == ODOMETRY else None
    return Twist(BEGIN + round(t * 1e9), linear, (0.0, 0.0, rate), turn, frame)


def reader_of(kind, **more):
    settings = InputSettings(kind, GateSettings(), SensorTransform(to_origin=ARM), checks=True)
    return settings._replace(**more).reader(kind)


@pytest.mark.parametrize(
    ("kind", "frame", "own"),
    [(ODOMETRY, "", True), (TWIST, "base_link", True), (TWIST, "world", False)],
)
@pytest.mark.parametrize("rate", [50, 200])
def test_the_acceleration_of_the_container_follows(kind, frame, own, rate):
    reader, found = reader_of(kind), []
    for t in np.arange(0.0, 3.0, 1.0 / rate).tolist():
        found += reader.update_twist(twist_at(t, kind, frame, own))
    at = np.array([(one.stamp_ns - BEGIN) * 1e-9 for one in found])
    measured, true = np.array([one[1:4] for one in found]), truth(at)
    assert np.abs(measured - true).max() < 0.01 * np.abs(true).max()
    yaw = np.array([one.yaw for one in found])
    assert yaw == pytest.approx(vehicle(at)[2], abs=2e-3)
    assert not any(one.doubtful for one in found)


def test_the_window_of_velocities_is_shorter_and_less_noisy_than_that_of_poses():
    rng, kinds = np.random.default_rng(3), {}
    for kind in (ODOMETRY, "pose"):
        reader, found = reader_of(kind), []
        for t in np.arange(0.0, 3.0, 0.008).tolist():
            noise = rng.normal(0.0, 1e-4, 3)
            stamp = BEGIN + round(t * 1e9)
            if kind == ODOMETRY:
                moved = tuple(noise.tolist())
                found += reader.update_twist(
                    Twist(stamp, moved, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
                )
            else:
                found += reader.update(stamp, tuple(noise.tolist()), (0.0, 0.0, 0.0, 1.0))
        kinds[kind] = reader.delay, np.std([one.ax for one in found])
    assert kinds[ODOMETRY][0] <= kinds["pose"][0]
    assert kinds[ODOMETRY][1] < 0.1 * kinds["pose"][1]


def test_a_reader_goes_on_with_the_memory_of_another():
    whole, other, found = reader_of(TWIST), reader_of(TWIST), []
    for k, t in enumerate(np.arange(0.0, 2.0, 0.01).tolist()):
        one = twist_at(t, TWIST, "base_link")
        expected = whole.update_twist(one)
        if k == 100:
            other.take_up(one.stamp_ns, whole.memory)
        if k > 100:
            found.append(other.update_twist(one) == expected)
    assert all(found)
    assert len(found) > 90


@pytest.mark.parametrize("speed", [math.nan, 25.0, math.inf])
def test_velocities_that_cannot_be_are_dropped(speed):
    reader = reader_of(TWIST)
    one = twist_at(0.0, TWIST, "base_link")._replace(linear=(speed, 0.0, 0.0))
    assert reader.update_twist(one) == []
    assert reader.gate.dropped == 1


def test_a_rate_that_is_too_low_is_flagged():
    reader, found = reader_of(TWIST, modes=((1, 21.0),)), []
    for t in np.arange(0.0, 4.0, 0.045).tolist():
        found += reader.update_twist(twist_at(t, TWIST, "base_link"))
    assert found[-1].slow
    assert "velocities arrive at 22.2 Hz" in reader.sampling.sentence()


def told(reader, rows):
    """Returns what a reader says of stamps [s] with velocities along x [m/s]."""
    for t, speed in rows:
        stamp = BEGIN + round(t * 1e9)
        reader.update_twist(Twist(stamp, (speed, 0.0, 0.0), (0.0, 0.0, 0.0), None, "world"))
    return " ".join(doubt.text for doubt in reader.message_doubts())


def speed(t):
    """Returns the speed of strokes of 0.4 m there and back [m/s]."""
    found = 0.0
    for begin, sign in ((1.0, 1.0), (3.5, -1.0)):
        s = min(max((t - begin) / 0.8, 0.0), 1.0)
        found += sign * 15.0 * s**2 * (1.0 - s) ** 2
    return found


@pytest.mark.parametrize(("rate", "other"), [(100, 50), (125, 125), (250, 50)])
@pytest.mark.parametrize("late", [0.04, 0.1])
def test_velocities_of_a_second_publisher_that_is_late_are_named(rate, other, late):
    rows = [(k / rate, speed(k / rate)) for k in range(6 * rate)]
    rows += [(k / other + 0.002, speed(k / other - late)) for k in range(6 * other)]
    assert "several publishers" in told(reader_of(TWIST), sorted(rows))


@pytest.mark.parametrize("rate", [20, 100, 250])
@pytest.mark.parametrize("noise", [0.0, 0.005, 0.05])
def test_one_publisher_with_noise_and_slip_is_not_two(rate, noise):
    draw = np.random.default_rng(rate)
    rows = [
        ((k + draw.uniform(0.0, 0.5)) / rate, speed(k / rate) * draw.normal(1.0, 0.05))
        for k in range(6 * rate)
    ]
    noisy = [(t, value + draw.normal(0.0, noise)) for t, value in rows]
    assert "publishers" not in told(reader_of(TWIST), noisy)


def test_stairs_of_a_twist_are_seen_while_the_frame_turns():
    reader = reader_of(ODOMETRY)
    for k in range(300):
        held = (speed(0.01 * (k - k % 5)), 0.0, 0.0)
        reader.update_twist(twist_at(0.01 * k, ODOMETRY)._replace(linear=held))
    assert "renewed at 20 Hz" in " ".join(doubt.text for doubt in reader.message_doubts())


def test_odometry_read_by_its_pose_has_no_remark_about_frames():
    reader = reader_of(ODOMETRY, odometry="pose")
    for k in range(100):
        x, y, yaw = vehicle(0.01 * k).tolist()
        twist = twist_at(0.01 * k, ODOMETRY)
        assert twist.attitude == (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        reader.update_twist(twist._replace(position=(x, y, 0.0)))
    assert reader.remark() is None
    assert reader.message_doubts() == ()
