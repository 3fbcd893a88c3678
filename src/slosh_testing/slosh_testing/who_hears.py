"""Counts received estimates and calls the reset service, in its own network namespace.

    python -m slosh_testing.who_hears robot|stranger SECONDS

Prints {"heard": N, "answered": whether reset was} as soon as it has heard enough and reset was
answered, or when so many seconds have passed. The robot sends accelerations, until it is ended.
"""

import json
import sys
import time

import rclpy
from geometry_msgs.msg import AccelStamped
from rclpy.node import Node
from std_srvs.srv import Trigger

from slosh_msgs.msg import SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_time

ENOUGH = 50  # estimates: no chance message


def send_at_rest(node: Node) -> None:
    """Publishes accelerations of a robot at rest, 100 per second."""
    publisher = node.create_publisher(AccelStamped, topics.ACCEL, qos.STREAM_OUT)
    message = AccelStamped()
    message.header.frame_id = "world"

    def send() -> None:
        message.header.stamp = to_time(time.time_ns())
        publisher.publish(message)

    node.create_timer(0.01, send)


def main(role: str, seconds: float) -> None:
    """Counts the received estimates for at most a number of seconds."""
    rclpy.init()
    node = rclpy.create_node(role, namespace="/slosh")
    heard: list[SloshEstimate] = []
    node.create_subscription(SloshEstimate, topics.ESTIMATE, heard.append, qos.STREAM_IN)
    client = node.create_client(Trigger, topics.RESET)
    if role == "robot":
        send_at_rest(node)
    answer, end = None, time.monotonic() + seconds
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.05)
        if answer is None and client.service_is_ready():
            answer = client.call_async(Trigger.Request())
        if len(heard) > ENOUGH and answer and answer.done():
            break
    told = {"heard": len(heard), "answered": bool(answer and answer.done())}
    print(json.dumps(told), flush=True)
    if role == "robot":
        rclpy.spin(node)


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
