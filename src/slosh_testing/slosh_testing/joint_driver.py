"""Publishes joint states of the robot in examples/robot.urdf over ROS."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from sensor_msgs.msg import JointState

from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_time

UPPER, FORE, CUP = 0.5, 0.4, 0.1
JOINTS = ("rail", "shoulder", "elbow", "wrist")
RAIL_URDF = (Path(__file__).resolve().parents[3] / "examples" / "robot.urdf").read_text(
    encoding="utf-8"
)

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


def cup_position(rail: Any, shoulder: Any, elbow: Any, wrist: Any = 0.0) -> Any:
    """Returns the position of the cup (N, 3) [m] for given joint positions."""
    toward = shoulder + elbow
    side, up = -CUP * np.sin(wrist), CUP * np.cos(wrist)
    return np.stack(
        [
            UPPER * np.cos(shoulder) + FORE * np.cos(toward) - side * np.sin(toward),
            rail + UPPER * np.sin(shoulder) + FORE * np.sin(toward) + side * np.cos(toward),
            up + 0.0 * toward,
        ],
        axis=-1,
    )


def swung(t: Any, seconds: float = 2.0) -> Any:
    """Returns joint positions (N, 4) at times t [s] of one move that lasts `seconds`."""
    x = np.clip(np.asarray(t) / seconds, 0.0, 1.0)
    ease = x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)
    return np.stack([0.5 * ease, 0.9 * ease - 0.4, 0.3 - 1.2 * ease, 0.0 * ease], axis=-1)


def acceleration(t: Any, step: float = 1e-4) -> Any:
    """Returns the acceleration of the cup (N, 3) [m/s²], by differences of positions."""
    places = [cup_position(*swung(np.asarray(t) + k * step).T) for k in (-1, 0, 1)]
    return (places[0] - 2.0 * places[1] + places[2]) / step**2


def quaternion(shoulder: float, elbow: float, wrist: float) -> tuple[float, float, float, float]:
    """Returns the attitude of the cup as a quaternion, world ← cup."""
    yaw, half = 0.5 * (shoulder + elbow), 0.5 * wrist
    return (
        math.cos(yaw) * math.sin(half), math.sin(yaw) * math.sin(half),
        math.sin(yaw) * math.cos(half), math.cos(yaw) * math.cos(half),
    )  # fmt: skip


def felt_on_cup(t: Any, step: float = 1e-4) -> tuple[Any, Any]:
    """Returns specific force [m/s²] and angular velocity [rad/s] on the cup, (N, 3) each."""
    yaws = [swung(np.asarray(t) + k * step)[..., 1:3].sum(axis=-1) for k in (-1, 0, 1)]
    c, s, (ax, ay, _) = np.cos(yaws[1]), np.sin(yaws[1]), acceleration(t).T
    rate, zero = (yaws[2] - yaws[0]) / (2.0 * step), 0.0 * c
    force = np.stack([c * ax + s * ay, c * ay - s * ax, zero + 9.81], axis=-1)
    return force, np.stack([zero, zero, rate], axis=-1)
