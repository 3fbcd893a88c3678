"""Tests which topics are recorded, and the reasons for the others."""

import pytest

from slosh_bag.errors import SloshBagError
from slosh_bag.recorded_topics import GRACE, TopicChoice

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
RAW, SMALL = "/robot/camera/image_raw", "/robot/camera/image_raw/compressed"
GRAPH = {
    "/slosh/accel": "geometry_msgs/msg/AccelStamped",
    "/slosh/estimate": "slosh_msgs/msg/SloshEstimate",
    "/slosh/camera/points": "sensor_msgs/msg/PointCloud2",
    "/other/estimate": "slosh_msgs/msg/SloshEstimate",
    "/robot/imu": "sensor_msgs/msg/Imu",
    "/plc/state": "std_msgs/msg/String",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/clock": "rosgraph_msgs/msg/Clock",
    "/rosout": "rcl_interfaces/msg/Log",
    "/slosh/plan_motion/_action/status": "action_msgs/msg/GoalStatusArray",
}


def choose(choice, graph=GRAPH, used=("/robot/imu",), silent=(), now=0.0):
    return choice.choose(graph, used, lambda topic: int(topic not in silent), now)


def test_by_default_the_cells_own_and_what_its_nodes_use():
    found = choose(TopicChoice("/slosh", exclude="^/rosout$|/_"))
    own = {"/slosh/accel", "/slosh/estimate", "/robot/imu", "/tf", "/clock"}
    assert set(found.recorded) == own
    assert not found.left_out
    assert set(found.others) == {"/slosh/camera/points", "/other/estimate", "/plc/state"}
    # A node that has ended may come back.
    choice = TopicChoice("/slosh")
    choose(choice)
    assert "/robot/imu" in choose(choice, used=()).recorded


def test_a_cell_in_the_root():
    found = choose(TopicChoice("/"), {"/accel": "x", "/slosh/accel": "x"}, used=())
    assert set(found.recorded) == {"/accel"}


def test_patterns_add_and_leave_out():
    found = choose(TopicChoice("/slosh", "/state$", "estimate"))
    assert "/plc/state" in found.recorded
    assert found.left_out == {"/slosh/estimate": "excluded by the parameter exclude"}
    assert set(choose(TopicChoice("/slosh", ".*")).recorded) == set(GRAPH)
    assert "/slosh/accel" not in choose(TopicChoice("/slosh"), silent=["/slosh/accel"]).recorded
    with pytest.raises(SloshBagError, match=r"parameter exclude = '\('"):
        TopicChoice("/slosh", "", "(")


class Images:
    """A topic selection while image publishers appear and disappear."""

    def __init__(self, **given):
        self.choice = TopicChoice("/slosh", **given)

    def at(self, now, *topics):
        graph = {RAW: IMAGE, SMALL: COMPRESSED}
        silent = graph.keys() - set(topics)
        return set(choose(self.choice, graph, [RAW], silent, now).recorded)


def test_raw_images_wait_for_compressed_ones_and_give_way_to_them():
    images = Images()
    assert images.at(0.0, RAW) == set()
    assert images.at(0.9 * GRACE, RAW) == set()
    assert images.at(GRACE, RAW) == {RAW}
    assert images.at(GRACE + 1.0, RAW, SMALL) == {SMALL}
    assert images.at(GRACE + 2.0, RAW) == set()
    assert images.at(2.0 * GRACE + 2.0, RAW) == {RAW}
    # A driver that starts anew waits again.
    assert images.at(10.0) == set()
    assert images.at(11.0, RAW) == set()
    assert images.at(11.1, RAW, SMALL) == {SMALL}


@pytest.mark.parametrize(
    ("topic", "kind", "one"),
    [
        ("/slosh/accel", "geometry_msgs/msg/AccelStamped", True),
        ("/elsewhere", "slosh_msgs/msg/SloshEstimate", True),
        ("/robot/imu", "sensor_msgs/msg/Imu", True),
        ("/another/imu", "sensor_msgs/msg/Imu", False),
        ("/slosh/settings", "slosh_msgs/msg/NodeSettings", False),
        ("/tf", "tf2_msgs/msg/TFMessage", False),
        ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", False),
    ],
)
def test_topics_of_one_publisher(topic, kind, one):
    choice = TopicChoice("/slosh")
    choose(choice)
    assert choice.has_one_publisher(topic, kind) is one
