"""Publishes joint states of the robot in examples/robot.urdf over ROS."""

from __future__ import annotations

import time

import rclpy
from sensor_msgs.msg import JointState

from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_time
from slosh_testing.rail_robot import JOINTS, swung

LISTENERS = 2
"""Estimator and recorder."""
PLAYED, INTERVAL, STROKE = 12.0, 0.004, 6.0  # s


def play_joints(last: str) -> None:
    """Publishes joint states: standstill until a subscriber exists, then seconds of motion.

    Args:
        last: is printed when the motion is over.
    """
    rclpy.init()
    node = rclpy.create_node("driver")
    publisher = node.create_publisher(JointState, topics.JOINT_STATES, qos.STREAM_OUT)
    begun = 0.0
    while not begun or time.monotonic() < begun + PLAYED:
        if not begun and publisher.get_subscription_count() >= LISTENERS:
            begun = time.monotonic()
        # To and fro, with a rest before and behind each stroke.
        t = (time.monotonic() - begun) % STROKE - 0.5 if begun else 0.0
        message = JointState(name=list(JOINTS), position=swung(min(t, 5.0 - t)).tolist())
        message.header.stamp = to_time(time.time_ns())
        publisher.publish(message)
        time.sleep(INTERVAL)
    node.destroy_node()
    rclpy.shutdown()
    print(last, flush=True)
