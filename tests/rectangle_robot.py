"""A process with a linear drive, a rectangular tank and a camera, which publishes over DDS.

    python tests/rectangle_robot.py

Publishes a motion along x and pictures of what the liquid does, and ends with the motion.
The liquid is TM20's pendulum; the pictures are drawn by other means than the camera node's.
"""

import time
from pathlib import Path

import numpy as np
import yaml

from slosh_model import Inputs, Model, Rectangle, simulate
from slosh_testing.side_view_scene import Liquid, Look, Setup, draw

ROOT = Path(__file__).resolve().parents[1]

SETUP = Setup(columns=320, rows=260, focal=1000.0, elevation=-0.02)
TANK = Rectangle(SETUP.width, SETUP.depth, SETUP.fill_height)
TRUTH = Model(TANK, damping_ratio=0.03).nonlinear()
RATE, EVERY = 250, 25  # samples a second, samples per image
REST, MOVING = 1.5, 2.5  # s


def motion() -> Inputs:
    """Returns a motion: rest, oscillation at 0.8 of the natural frequency, rest."""
    t = np.arange(round((2.0 * REST + MOVING) * RATE)) / RATE
    share = np.clip((t - REST) / MOVING, 0.0, 1.0)
    push = 1.6 * np.sin(np.pi * share) ** 2 * np.sin(0.8 * TANK.natural_frequency(1) * t)
    return Inputs(t, np.column_stack([push, 0.0 * t, 0.0 * t]))


def write_camera(path: Path) -> None:
    """Writes the camera.yaml of the camera that renders the images."""
    rotation, translation = SETUP.pose()
    document = {
        "image_width": SETUP.columns,
        "image_height": SETUP.rows,
        "camera_name": "side",
        "camera_matrix": {"rows": 3, "cols": 3, "data": SETUP.matrix().ravel().tolist()},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.0] * 5},
        "container": {
            "shape": "rectangle",
            "width": SETUP.width,
            "depth": SETUP.depth,
            "fill_height": SETUP.fill_height,
            "rim_height": SETUP.rim_height,
            "wall_thickness": SETUP.wall_thickness,
        },
        "pose": {"rotation": rotation.ravel().tolist(), "translation": translation.tolist()},
    }
    path.write_text(yaml.safe_dump(document))


def main() -> None:
    """Publishes the motion in real time, with exact stamps even if messages are sent late."""
    import rclpy
    from geometry_msgs.msg import AccelStamped
    from rclpy.node import Node
    from sensor_msgs.msg import Image

    from slosh_msgs_py import qos
    from slosh_msgs_py.stamps import to_time

    inputs = motion()
    heights = simulate(TRUTH, inputs)[0].sh_x
    pictures = [
        draw(SETUP, Liquid(slope=2.0 * height / SETUP.width), Look(noise=2.0), seed=k)
        for k, height in enumerate(heights[::EVERY].tolist())
    ]
    rclpy.init()
    node = Node("robot")
    accel = node.create_publisher(AccelStamped, "/slosh/accel", qos.STREAM_OUT)
    images = node.create_publisher(Image, "/slosh/camera/image_raw", qos.STREAM_OUT)
    while not (accel.get_subscription_count() > 1 and images.get_subscription_count() > 0):
        time.sleep(0.05)
    begin = node.get_clock().now().nanoseconds + 200_000_000
    for k, (second, row) in enumerate(zip(inputs.t, inputs.acceleration, strict=True)):
        stamp = begin + round(float(second) * 1e9)
        time.sleep(max(stamp - node.get_clock().now().nanoseconds, 0) / 1e9)
        message = AccelStamped()
        message.header.stamp, message.header.frame_id = to_time(stamp), "world"
        message.accel.linear.x = float(row[0])
        accel.publish(message)
        if k % EVERY == 0:
            picture = pictures[k // EVERY]
            image = Image(height=SETUP.rows, width=SETUP.columns, encoding="mono8")
            image.header.stamp, image.header.frame_id = to_time(stamp), "camera_optical"
            image.step, image.data = SETUP.columns, picture.tobytes()
            images.publish(image)
    time.sleep(1.0)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
