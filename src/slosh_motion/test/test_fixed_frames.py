"""Tests the mounting of a sensor by fixed transforms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_motion.inputs.frames import (
    FixedFrames,
    SensorTransform,
    Transform,
    sensor_from_container,
)

ANGLE, LENGTH = st.floats(-3.1, 3.1), st.floats(-2.0, 2.0)


def link(parent, child, mount):
    """Returns the transform of a child frame from roll, pitch, yaw and position."""
    x, y, z, w = sensor_from_container(mount)
    return Transform(parent, child, 0, mount.to_origin, (-x, -y, -z, w))


def matrix(mount):
    return np.array(mount.matrix)


@given(ANGLE, st.floats(-1.5, 1.5), ANGLE, LENGTH, LENGTH)
def test_a_sensor_on_the_flange_is_mounted_as_the_chain_says(roll, pitch, yaw, x, z):
    cup, imu = (
        SensorTransform(0.3, -0.2, 1.1, (0.1, z, 0.2)),
        SensorTransform(roll, pitch, yaw, (x, 0.3, -0.1)),
    )
    frames = FixedFrames()
    frames.take([link("flange", "container", cup), link("flange", "imu_link", imu)])
    found = frames.mounting("container", "imu_link")
    inverse = matrix(cup).T
    assert matrix(found) == pytest.approx(inverse @ matrix(imu), abs=1e-9)
    place = inverse @ (np.array(imu.to_origin) - np.array(cup.to_origin))
    assert found.to_origin == pytest.approx((-place).tolist(), abs=1e-9)


@pytest.mark.parametrize("pitch", [0.5 * math.pi, -0.5 * math.pi])
def test_a_sensor_that_is_mounted_upright(pitch):
    frames = FixedFrames()
    mount = SensorTransform(0.4, pitch, -0.7)
    frames.take([link("container", "imu", mount)])
    assert matrix(frames.mounting("container", "imu")) == pytest.approx(matrix(mount), abs=1e-7)


def test_frames_that_nothing_connects_have_no_mounting():
    frames = FixedFrames()
    frames.take([link("flange", "container", SensorTransform())])
    assert frames.mounting("container", "imu_link") is None
    frames.take([link("a", "b", SensorTransform()), link("b", "a", SensorTransform())])
    assert frames.mounting("container", "a") is None
    assert frames.mounting("container", "container") == SensorTransform(0.0, 0.0, 0.0)
