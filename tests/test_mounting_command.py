"""Tests that `slosh mounting` finds from a bag how a sensor is mounted."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bringup.cli.main import main
from slosh_motion.inputs.robot import available
from slosh_testing.joint_driver import (
    JOINTS,
    RAIL_URDF,
    acceleration,
    cup_position,
    felt_on_cup,
    quaternion,
    swung,
)

BEGIN = 1_700_000_000_000_000_000
TIMES = np.arange(-0.8, 3.5, 0.004)
QUARTER = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Sensor <- cup."""
STATE, IMU, POSE = (
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/Imu",
    "geometry_msgs/msg/PoseStamped",
)
TEXT, ACCEL = "std_msgs/msg/String", "geometry_msgs/msg/AccelStamped"
TREE = "tf2_msgs/msg/TFMessage"
needs_pinocchio = pytest.mark.skipif(
    not available(), reason="no Pinocchio (requirements/joints.txt)"
)
Message = tuple[str, str, int, Any]


class Recording:
    """Writes a bag of messages, given by their fields."""

    def __init__(self) -> None:
        self._definitions = Definitions()
        for kind in (STATE, IMU, POSE, TEXT, ACCEL, TREE):
            self._definitions.hash(kind)
        self._types = self._definitions.typestore.types
        self._rows: list[Message] = []

    def make(self, kind: str, *fields: Any) -> Any:
        return self._types[kind](*fields)

    def vector(self, row: Any, kind: str = "Vector3") -> Any:
        return self.make(f"geometry_msgs/msg/{kind}", *(float(one) for one in row))

    def header(self, t: float, frame: str) -> Any:
        stamp = BEGIN + round(t * 1e9)
        time = self.make("builtin_interfaces/msg/Time", stamp // 10**9, stamp % 10**9)
        return self.make("std_msgs/msg/Header", time, frame)

    def add(self, topic: str, kind: str, t: float, message: Any) -> None:
        self._rows.append((topic, kind, BEGIN + round(t * 1e9), message))

    def joints(self) -> "Recording":
        self.add("/robot_description", TEXT, -1.0, self.make(TEXT, RAIL_URDF))
        none = np.empty(0)
        for t in TIMES.tolist():
            state = self.make(STATE, self.header(t, ""), list(JOINTS), swung(t), none, none)
            self.add("/joint_states", STATE, t, state)
        return self

    def poses(self, scale: float = 1.0) -> "Recording":
        for t in TIMES.tolist():
            rail, *angles = swung(t).tolist()
            place = scale * cup_position(rail, *angles)
            pose = self.make(
                "geometry_msgs/msg/Pose", self.vector(place, "Point"),
                self.vector(quaternion(*angles), "Quaternion"),
            )  # fmt: skip
            self.add("/slosh/pose", POSE, t, self.make(POSE, self.header(t, "world"), pose))
        return self

    def imu(
        self, rotation: np.ndarray, gain: float = 1.0, frame: str = "imu", late: float = 0.0
    ) -> "Recording":
        force, rate = (values @ rotation.T for values in felt_on_cup(TIMES - late))
        none, straight = np.zeros(9), self.vector((0, 0, 0, 1), "Quaternion")
        for t, f, w in zip(TIMES.tolist(), gain * force, rate, strict=True):
            message = self.make(
                IMU, self.header(t, frame), straight, none, self.vector(w), none, self.vector(f),
                none,
            )  # fmt: skip
            self.add("/slosh/imu", IMU, t, message)
        return self

    def accel(self, rotation: np.ndarray) -> "Recording":
        for t, a in zip(TIMES.tolist(), acceleration(TIMES) @ rotation.T, strict=True):
            moved = self.make("geometry_msgs/msg/Accel", self.vector(a), self.vector((0, 0, 0)))
            self.add("/slosh/accel", ACCEL, t, self.make(ACCEL, self.header(t, "world"), moved))
        return self

    def mounted(self) -> "Recording":
        """Adds a fixed transform from the sensor to the container, a quarter turn about z."""
        half = np.sqrt(0.5)
        transform = self.make(
            "geometry_msgs/msg/Transform", self.vector((0, 0, 0)),
            self.vector((0, 0, half, half), "Quaternion"),
        )  # fmt: skip
        link = self.make(
            "geometry_msgs/msg/TransformStamped", self.header(0.0, "container"), "imu", transform
        )
        self.add("/tf_static", TREE, -1.0, self.make(TREE, [link]))
        return self

    def write(self, folder: Path) -> str:
        with BagWriter(folder, self._definitions, {}) as writer:
            for topic, kind, log_ns, message in sorted(self._rows, key=lambda row: row[2]):
                writer.add_topic(topic, kind)
                data = self._definitions.typestore.serialize_cdr(message, kind)
                writer.write(topic, bytes(data), log_ns)
        return str(folder)


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str]]:
    def run(*words: str) -> tuple[int, str]:
        code = main(["mounting", *words])
        out, err = capsys.readouterr()
        return code, out + err

    return run


@needs_pinocchio
def test_a_turned_sensor_is_named_and_the_remedy_is_right(tmp_path, said):
    bag = Recording().joints().imu(QUARTER).write(tmp_path / "bag")
    code, text = said(bag, "--tool-frame", "cup")
    assert code == 1
    remedy = "its x, y, z point along the container's +y, -x, +z"
    assert f"wrong: imu: {remedy}" in text
    assert "set sensor_rotation to [0.0000, 0.0000, 1.5708]" in text
    code, text = said(bag, "--tool-frame", "cup", "--sensor-rotation", "0", "0", "90deg")
    assert (code, "right: axes, signs and units" in text) == (0, True)


def test_unit_and_lag_against_poses_for_programs(tmp_path, said):
    bag = Recording().poses().imu(np.eye(3), 1.0 / 9.81, late=0.08).write(tmp_path / "bag")
    code, text = said(bag, "--json")
    found = json.loads(text)
    assert code == 1
    assert found["reference"] == {"kind": "pose", "topic": "/slosh/pose"}
    assert found["wrong"] == ["it is in g: publish m/s² (9.81 times as much)"]
    assert found["lag"] == pytest.approx(0.08, abs=0.005)
    assert any("80 ± " in one and "ms late" in one for one in found["remarks"])
    assert found["gain"] == pytest.approx(1.0 / 9.81, rel=0.02)
    assert found["angular_velocity_gain"] == pytest.approx(1.0, abs=0.03)


def test_an_acceleration_in_other_axes_is_named(tmp_path, said):
    bag = Recording().poses().accel(QUARTER).write(tmp_path / "bag")
    code, text = said(bag)
    assert code == 1
    assert "wrong: accel: its x, y, z point along the container's +y, -x, +z" in text


def test_a_fixed_transform_says_how_the_sensor_is_mounted(tmp_path, said):
    bag = Recording().poses().imu(QUARTER).mounted().write(tmp_path / "bag")
    code, text = said(bag)
    assert (code, "right: axes, signs and units" in text) == (0, True)


def test_a_sensor_alone_tells_what_gravity_tells(tmp_path, said):
    code, text = said(Recording().imu(QUARTER).write(tmp_path / "right"))
    assert code == 0
    assert "not compared with a motion: the bag holds no pose, joints, tf or odometry" in text
    assert "not seen: a turn about the vertical" in text
    half_turn = np.diag([1.0, -1.0, -1.0])
    code, text = said(Recording().imu(half_turn).write(tmp_path / "down"))
    assert code == 1
    assert "z down, as in NED" in text
    assert "if the container stands upright, set sensor_rotation to [" in text


def test_a_motion_in_another_unit_is_told_as_its_own_fault(tmp_path, said):
    bag = Recording().poses(1000.0).imu(np.eye(3)).write(tmp_path / "bag")
    code, text = said(bag)
    assert code == 1
    assert "wrong: pose: the pose moves at" in text
    assert "are its positions in mm" in text


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--sensor", "accel"], "holds no message of accel"),
        (["--sensor-rotation", "90", "0", "0"], "did you mean 90 deg"),
        (["--reference", "odometry"], "holds no message of odometry"),
    ],
)
def test_a_wrong_request_is_one_line(tmp_path, words, line, capsys):
    bag = Recording().imu(np.eye(3)).write(tmp_path / "bag")
    try:
        code = main(["mounting", bag, *words])
    except SystemExit as error:
        code = error.code
    said = capsys.readouterr().err.strip().splitlines()
    assert code == 2
    assert line in said[-1]


def test_no_sensor_is_one_line(tmp_path, said):
    code, text = said(Recording().poses().write(tmp_path / "bag"))
    assert code == 2
    assert "holds no message of imu or accel to check" in text
