"""Reads accelerations as the recorder does, for so many seconds; prints how many it misses."""

import sys
import time

import rclpy
from geometry_msgs.msg import AccelStamped
from rclpy.serialization import deserialize_message

from slosh_bag.nodes.topic_input import TopicInput
from slosh_msgs_py import topics
from slosh_msgs_py.stamps import to_nanoseconds

rclpy.init()
node = rclpy.create_node("reader")
while not node.count_publishers(topics.ACCEL):
    time.sleep(0.05)
entry = TopicInput(
    node, topics.ACCEL, "geometry_msgs/msg/AccelStamped", AccelStamped, time.monotonic()
)
received: list[bytes] = []
while not received:
    entry.take(lambda message: received.append(message.data))
    time.sleep(0.05)
print("reads", flush=True)
end = time.monotonic() + float(sys.argv[1])
while time.monotonic() < end:
    entry.take(lambda message: received.append(message.data))
    time.sleep(0.05)
numbers = [to_nanoseconds(deserialize_message(d, AccelStamped).header.stamp) for d in received]
print(numbers[-1] - numbers[0] + 1 - len(numbers), "missing of", len(numbers))
