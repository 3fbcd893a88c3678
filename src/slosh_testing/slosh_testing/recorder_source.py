"""Publishes accelerations at 1 kHz and images at 60 Hz, and stores their sending times.

    python -m slosh_testing.recorder_source NAMESPACE FOLDER

The seconds of a message's stamp are its number. FOLDER/accel and FOLDER/image hold the system
times of sending in the same order, int64 [ns].
"""

import array
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from geometry_msgs.msg import AccelStamped
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Image

ACCELERATIONS, IMAGES = 1000, 60  # Hz
SHAPE = (720, 1280)
# The middleware repeats what it lost on a busy machine, for as long as its history reaches back.
DEPTHS = {"accel": 20_000, "image": 600}


def main() -> None:
    """Publishes the messages until the process is killed."""
    namespace, folder = sys.argv[1], Path(sys.argv[2])
    rclpy.init()
    node = rclpy.create_node("source", namespace=namespace)
    publishers = {
        name: node.create_publisher(kind, name, QoSProfile(depth=DEPTHS[name]))
        for name, kind in (("accel", AccelStamped), ("image", Image))
    }
    rng = np.random.default_rng(0)
    smooth = 128.0 + 60.0 * np.sin(np.arange(SHAPE[1]) / 90.0) + np.zeros(SHAPE)
    picture = np.clip(smooth + rng.normal(0.0, 2.0, SHAPE), 0, 255).astype(np.uint8)
    image = Image(height=SHAPE[0], width=SHAPE[1], step=SHAPE[1], encoding="mono8")
    image.data = array.array("B", picture.tobytes())
    messages = {"accel": AccelStamped(), "image": image}
    sent = {"accel": 0, "image": 0}
    with (folder / "accel").open("wb", 0) as accel, (folder / "image").open("wb", 0) as pictures:
        notes = {"accel": accel, "image": pictures}
        begin = time.monotonic()
        while True:
            if (left := begin + sent["accel"] / ACCELERATIONS - time.monotonic()) > 0.0:
                time.sleep(left)
            names = ["accel"]
            if sent["accel"] * IMAGES >= sent["image"] * ACCELERATIONS:
                names.append("image")
            for name in names:
                messages[name].header.stamp.sec = sent[name]
                notes[name].write(np.int64(time.time_ns()).tobytes())
                publishers[name].publish(messages[name])
                sent[name] += 1


if __name__ == "__main__":
    main()
