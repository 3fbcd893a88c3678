"""Publishes accelerations at 1 kHz for so many seconds, numbered in their stamps."""

import sys
import time

import rclpy
from geometry_msgs.msg import AccelStamped

from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_time

rclpy.init()
publisher = rclpy.create_node("source").create_publisher(
    AccelStamped, topics.ACCEL, qos.STREAM_OUT
)
message = AccelStamped()
begun, sent = time.monotonic(), 0
while (passed := time.monotonic() - begun) < float(sys.argv[1]):
    for number in range(sent, round(1000.0 * passed)):
        message.header.stamp = to_time(number)
        publisher.publish(message)
    sent = round(1000.0 * passed)
    time.sleep(0.002)
