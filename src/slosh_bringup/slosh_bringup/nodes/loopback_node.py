"""Sends one message to itself over the ROS middleware; used by `slosh doctor`."""

from __future__ import annotations

import os
import sys
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor

from slosh_bringup.doctor import NOTHING_BACK
from slosh_msgs.msg import FreeSurface
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.node.run import EXIT_WRONG_INPUT, initialise

TOPIC = f"/slosh_loopback_{os.getpid()}"
TIMEOUT = 15.0  # discovery alone takes a second or two on a busy machine


def main() -> int:
    """Returns 0 if the message is received, NOTHING_BACK after a timeout, 2 without ROS."""
    try:
        initialise([])
    except SloshMessageError as error:
        print(error, file=sys.stderr)
        return EXIT_WRONG_INPUT
    node = rclpy.create_node("loopback")
    received: list[float] = []
    node.create_subscription(FreeSurface, TOPIC, lambda message: received.append(message.msh), 10)
    publisher = node.create_publisher(FreeSurface, TOPIC, 10)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    started = time.monotonic()
    while not received and time.monotonic() - started < TIMEOUT:
        publisher.publish(FreeSurface(msh=0.001))
        executor.spin_once(timeout_sec=0.1)
    rclpy.shutdown()
    if received != [0.001] * len(received) or not received:
        print(f"no message came back within {TIMEOUT:.0f} s", file=sys.stderr)
        return NOTHING_BACK
    print(f"a FreeSurface came back after {1e3 * (time.monotonic() - started):.0f} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
