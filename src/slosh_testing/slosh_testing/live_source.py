"""Publishes accelerations along x until killed; arguments: TOPIC RATE VALUE [SKIP].

SKIP messages are published on another topic's worth of numbers first: the publisher has run for
some time before anybody listens.
"""

import sys
import time

import rclpy
from geometry_msgs.msg import AccelStamped, PoseStamped
from sensor_msgs.msg import Imu

from slosh_msgs_py import qos
from slosh_msgs_py.stamps import to_time

topic, rate, value = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
kind = {"accel": AccelStamped, "imu": Imu, "pose": PoseStamped}[topic]
rclpy.init()
node = rclpy.create_node("source", namespace="/slosh")
publisher = node.create_publisher(kind, topic, qos.STREAM_OUT)
message = kind()
message.header.frame_id = "world" if topic != "imu" else "imu"
if topic == "accel":
    message.accel.linear.x = value
elif topic == "imu":
    message.linear_acceleration.x, message.linear_acceleration.z = value, 9.81
else:
    message.pose.position.x, message.pose.orientation.w = value, 1.0
if len(sys.argv) > 4:
    for _ in range(int(sys.argv[4])):  # before anybody is known to listen
        publisher.publish(message)
begun = time.monotonic()
for number in range(10**9):
    time.sleep(max(begun + number / rate - time.monotonic(), 0.0))
    message.header.stamp = to_time(time.time_ns())
    publisher.publish(message)
