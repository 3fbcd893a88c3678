"""Tests messages from plain values and as plain values."""

import array

import pytest
from builtin_interfaces.msg import Time
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import Imu, PointCloud2
from std_msgs.msg import UInt8
from trajectory_msgs.msg import JointTrajectory

from slosh_msgs.srv import ChangeContainer
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.plain_fields import plain_fields, set_fields


def test_fields_get_exactly_the_declared_types():
    request = ChangeContainer.Request()
    set_fields(request, {
        "stamp": {"sec": 3.0, "nanosec": 4}, "empty": True, "name": 12, "fill_height": 1,
        "standing": [1, 2.5],
    })  # fmt: skip
    assert request.stamp == Time(sec=3, nanosec=4)
    assert request.empty is True
    assert request.name == "12"
    assert isinstance(request.fill_height, float)
    assert request.standing == array.array("d", [1.0, 2.5])
    assert plain_fields(request) == {
        "stamp": {"sec": 3, "nanosec": 4}, "empty": True, "tray_place": "", "name": "12",
        "model": "", "fill_height": 1.0, "limit": 0.0, "standing": [1.0, 2.5],
    }  # fmt: skip


def test_lists_of_messages_are_filled_and_given():
    request = SetParameters.Request()
    value = {"type": 3, "double_value": 0.015}
    set_fields(request, {"parameters": [{"name": "limit", "value": value}]})
    assert request.parameters[0].value.double_value == 0.015
    trajectory = JointTrajectory()
    set_fields(trajectory, {"joint_names": ["a"], "points": [{"positions": [1]}]})
    again = JointTrajectory()
    set_fields(again, plain_fields(trajectory))
    assert again == trajectory


@pytest.mark.parametrize(
    ("kind", "fields", "told"),
    [
        (ChangeContainer.Request, {"nam": "a"}, "nam: there is no such field; did you mean name"),
        (ChangeContainer.Request, {7: "a"}, "7: there is no such field; fields: stamp, empty"),
        (ChangeContainer.Request, {"empty": 1}, "empty: 1 is not true or false"),
        (ChangeContainer.Request, {"limit": "10mm"}, "limit: '10mm' is not a number"),
        (ChangeContainer.Request, {"limit": True}, "limit: True is not a number"),
        (ChangeContainer.Request, {"limit": None}, "limit: None is not a number"),
        (ChangeContainer.Request, {"name": ["a"]}, r"name: \['a'\] is not a text"),
        (ChangeContainer.Request, {"standing": 1.0}, "standing: 1.0 is not a list"),
        (ChangeContainer.Request, {"standing": [1, "x"]}, r"standing\[1\]: 'x' is not a number"),
        (ChangeContainer.Request, {"stamp": 3}, "stamp: 3 is not a dictionary of Time's fields"),
        (ChangeContainer.Request, {"stamp": {"sec": 2**31}}, "stamp.sec: 2147483648 is not a wh"),
        (ChangeContainer.Request, {"stamp": {"sec": 0.5}}, "stamp.sec: 0.5 is not a whole"),
        (ChangeContainer.Request, {"stamp": {"nanosec": -1}}, "nanosec: -1 is not .* from 0 to"),
        (UInt8, {"data": 256}, "data: 256 is not a whole number from 0 to 255"),
        (Imu, {"orientation_covariance": [0.0]}, "a list of 9 values"),
        (PointCloud2, {"data": [300]}, r"data\[0\]: 300 is not"),
    ],
)
def test_what_does_not_fit_is_named(kind, fields, told):
    with pytest.raises(SloshMessageError, match=told):
        set_fields(kind(), fields)
