"""Tests that the topic table is complete and matches the installed message types."""

import subprocess
import sys

import pytest

from slosh_msgs_py import topics
from slosh_msgs_py.conversions import find_type

SERVICES = (*topics.SERVICES, *topics.ACTIONS)


def test_every_constant_is_a_row_and_no_name_stands_twice():
    constants = {
        value
        for name, value in vars(topics).items()
        if name.isupper() and isinstance(value, str) and name != "NAMESPACE"
        and not name.startswith("_")
    }  # fmt: skip
    names = [*(row.name for row in topics.TOPICS), *(row.name for row in SERVICES)]
    assert set(names) == constants
    assert len(names) == len(constants)


@pytest.mark.parametrize("row", [*topics.TOPICS, *SERVICES], ids=lambda row: row.name)
def test_types_exist(row):
    package = row.type.partition("/")[0]
    if package in ("tf2_msgs", "control_msgs"):
        pytest.importorskip(package)
    assert find_type(row.type).__name__ == row.type.rpartition("/")[2]


@pytest.mark.parametrize(
    ("topic", "kind", "expected"),
    [
        ("/slosh/estimator_state", "", ("/slosh", "estimator_state")),
        ("/a/b/planned_trajectory", "", ("/a/b", "planned_trajectory")),
        ("/x/camera/image_raw/compressed", "", ("/x", "camera/image_raw/compressed")),
        ("/x/camera/points", "sensor_msgs/msg/PointCloud2", ("/x", "camera/points")),
        ("/accel", "geometry_msgs/msg/AccelStamped", ("", "accel")),
        ("/plc/settings", "std_msgs/msg/String", None),
        ("/tf", "", None),
        ("/slosh/acceleration", "", None),
    ],
)
def test_a_name_is_that_of_a_cell_or_not(topic, kind, expected):
    found = topics.cell_name(topic, kind)
    assert (found and found[:2]) == expected


def test_inputs_are_what_the_robot_its_planner_and_its_camera_publish():
    inputs = {
        row.name
        for row in topics.TOPICS
        if not row.is_absolute and topics.cell_name(f"/slosh/{row.name}").is_input
    }
    assert inputs == {
        "accel", "imu", "pose", "twist", "planned_trajectory", "desired_twist", "desired_pose",
        "desired_joints", "desired_joint_trajectory", "desired_joint_values",
        "force", "level", "level_point",
        "camera/image_raw", "camera/image_raw/compressed", "camera/camera_info",
    }  # fmt: skip
    assert topics.cell_name("/slosh/camera/points").is_input
    assert not topics.cell_name("/slosh/cell/other").is_input


ONE_ROW = """
from slosh_msgs_py import topics
role = topics.TopicRole.ANSWER
topics.TOPICS += (
    topics.Topic("toy", "std_msgs/msg/Header", role, remappable=True, page=True),
)
from slosh_bag.playing.play_plan import renamed
from slosh_bag.recorded_topics import TopicChoice
from slosh_bringup.live.cell_setup import REMAPPABLE
from slosh_bringup.watch.recording import HEIGHTS
assert renamed("/slosh/toy", "/other") == "/other/toy"
assert TopicChoice("/slosh").wants("/slosh/toy")
assert TopicChoice("/slosh").has_one_publisher("/slosh/toy", "std_msgs/msg/Header")
assert "toy" in REMAPPABLE
assert HEIGHTS["toy"] == "std_msgs/msg/Header"
"""


def test_a_new_topic_is_one_row():
    """Player, recorder, cell file and web page derive their topics from the one table."""
    subprocess.run([sys.executable, "-c", ONE_ROW], check=True, timeout=120)
