"""Fills the simulated cell's messages as robot and camera drivers would."""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import AccelStamped, PoseStamped, WrenchStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, Imu
from std_msgs.msg import String

from slosh_base.types import Array
from slosh_camera.optics.calibration import Calibration
from slosh_msgs.msg import FreeSurface
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled

WORLD_FRAME = "world"
IMU_FRAME = "imu"
FORCE_FRAME = "force_sensor"
CAMERA_FRAME = "camera_optical"
PUBLISHED = (
    (topics.ACCEL, AccelStamped, qos.STREAM_OUT),
    (topics.IMU, Imu, qos.STREAM_OUT),
    (topics.POSE, PoseStamped, qos.STREAM_OUT),
    (topics.FORCE, WrenchStamped, qos.STREAM_OUT),
    (topics.IMAGE, Image, qos.IMAGE_OUT),
    (topics.IMAGE_COMPRESSED, CompressedImage, qos.IMAGE_OUT),
    (topics.CAMERA_INFO, CameraInfo, qos.IMAGE_OUT),
    (topics.TRUTH, FreeSurface, qos.STREAM_OUT),
    (topics.SUMMARY, String, qos.EVENT),
)
"""Topic, type and quality of service of everything that the cell publishes."""


def accel_message(stamp: Any, acceleration: Array) -> AccelStamped:
    """Returns an AccelStamped with an acceleration in world axes, gravity excluded [m/s²]."""
    message = AccelStamped()
    message.header.stamp, message.header.frame_id = stamp, WORLD_FRAME
    linear = message.accel.linear
    linear.x, linear.y, linear.z = acceleration.tolist()
    return message


def imu_message(stamp: Any, force: Array, turning: Array) -> Imu:
    """Returns an Imu with specific force [m/s²] and angular velocity [rad/s] in sensor axes."""
    message = Imu()
    message.header.stamp, message.header.frame_id = stamp, IMU_FRAME
    linear, angular = message.linear_acceleration, message.angular_velocity
    linear.x, linear.y, linear.z = force.tolist()
    angular.x, angular.y, angular.z = turning.tolist()
    message.orientation_covariance[0] = -1.0
    return message


def pose_message(stamp: Any, position: Array, attitude: Array) -> PoseStamped:
    """Returns a PoseStamped of the container from a position [m] and a quaternion x, y, z, w."""
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = stamp, WORLD_FRAME
    place, turn = message.pose.position, message.pose.orientation
    place.x, place.y, place.z = position.tolist()
    turn.x, turn.y, turn.z, turn.w = attitude.tolist()
    return message


def force_message(stamp: Any, force: Array) -> WrenchStamped:
    """Creates a WrenchStamped message with a force in the sensor's axes [N]."""
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = stamp, FORCE_FRAME
    to = message.wrench.force
    to.x, to.y, to.z = force.tolist()
    return message


def camera_info(calibration: Calibration) -> CameraInfo:
    """Returns the CameraInfo message of a camera calibration."""
    camera = calibration.view.camera
    k = camera.matrix
    info = CameraInfo(
        width=camera.width,
        height=camera.height,
        distortion_model=camera.distortion_model,
        d=[float(value) for value in camera.distortion],
        k=k.ravel(),
        r=np.eye(3).ravel(),
        p=np.hstack((k, np.zeros((3, 1)))).ravel(),
    )
    info.header.frame_id = CAMERA_FRAME
    return info


def truth_message(stamp_ns: int, sh_x: float, sh_y: float) -> FreeSurface:
    """Returns a FreeSurface message with the exact simulated heights."""
    azimuth = float(np.arctan2(sh_y, sh_x))
    height = float(np.hypot(sh_x, sh_y))
    return filled(
        FreeSurface,
        stamp_ns=stamp_ns,
        frame_id="container",
        msh=height,
        msh_stddev=0.0,
        azimuth=azimuth,
        fitted_msh=height,
        fitted_azimuth=azimuth,
    )
