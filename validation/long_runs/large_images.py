"""Publishes 3840 x 2160 images at 60 per second; checks the camera node's heights and delays.

    tools/run python -m validation.long_runs.large_images [--seconds 30] [--fps 60] [--height 2160]

A wave that goes round the cup, drawn beforehand, comes as JPEG pictures by a process of its own.
Printed: how many were measured, their delay, how far the heights are from those that were drawn,
what the node tells of the others, and its memory.
"""

from __future__ import annotations

import argparse
import cmath
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage

from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.processes import NodeGroup, NodeProcess, config_folder, node_environment
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_msgs.msg import FreeSurface
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.domain import own_domain
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from validation.long_runs.long_cell import resident

PHASES = 24
"""Pictures of one turn of the wave."""
HEIGHT = 0.008
"""Of the wave [m]."""
QUALITY = 85
PATIENCE = 30.0
"""A camera node starts within [s]."""


def main() -> int:
    """Runs the test; returns 1 if no height was measured or one is wrong by over 1 mm."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--fps", type=float, default=60.0)
    parser.add_argument(
        "--height", type=int, default=2160, help="image rows; the width is 16/9 of them"
    )
    parser.add_argument("--send", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.send:
        return send(given.send, given.fps)
    with own_domain() as domain, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        draw(folder, given.height)
        return run(folder, domain, given)


def draw(folder: Path, rows: int) -> None:
    """Writes the calibration of a camera with a number of image rows, and its images."""
    camera = yaml.safe_load((config_folder() / "camera.yaml").read_text())
    scale = rows / camera["image_height"]
    camera["image_height"], camera["image_width"] = rows, rows * 16 // 9
    focal = camera["camera_matrix"]["data"][0] * scale
    middle = ((camera["image_width"] - 1) / 2, (rows - 1) / 2)
    camera["camera_matrix"]["data"] = [focal, 0.0, middle[0], 0.0, focal, middle[1], 0.0, 0.0, 1.0]
    del camera["still_image"]
    (folder / "camera.yaml").write_text(yaml.safe_dump(camera))
    cup = CupRenderer(read_calibration(folder / "camera.yaml").view)
    for phase in range(PHASES):
        turn = 2.0 * math.pi * phase / PHASES
        pixels = cup.render(HEIGHT * math.cos(turn), HEIGHT * math.sin(turn))
        cv2.imwrite(str(folder / f"{phase:02}.jpg"), pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def send(folder: Path, fps: float) -> int:
    """Publishes the images repeatedly until killed; each frame id names the image."""
    pictures = [path.read_bytes() for path in sorted(folder.glob("*.jpg"))]
    rclpy.init()
    node = rclpy.create_node("lens", namespace="/slosh")
    publisher = node.create_publisher(CompressedImage, topics.IMAGE_COMPRESSED, qos.STREAM_OUT)
    begun, sent = time.monotonic(), 0
    while True:
        message = CompressedImage(format="jpeg", data=pictures[sent % PHASES])
        # The stamp's last digits are the picture's number.
        stamp = time.time_ns()
        message.header.stamp = to_time(stamp - stamp % 100 + sent % PHASES)
        message.header.frame_id = "camera"
        publisher.publish(message)
        sent += 1
        time.sleep(max(0.0, begun + sent / fps - time.monotonic()))


class Listener(Node):
    """ROS node that receives the heights and diagnostics of the camera node.

    Attributes:
        found: moment of arrival [ns] and what was measured.
        health: values of the camera's last report.
    """

    def __init__(self) -> None:
        super().__init__("listener", namespace="/slosh")
        self.found: list[tuple[int, FreeSurface]] = []
        self.health: dict[str, str] = {}
        self.create_subscription(FreeSurface, topics.FREE_SURFACE, self._take, qos.STREAM_IN)
        self.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, self._look, qos.DIAGNOSTICS)

    def _take(self, message: FreeSurface) -> None:
        self.found.append((time.time_ns(), message))

    def _look(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "/slosh/camera":
                self.health = {"": status.message} | {one.key: one.value for one in status.values}


def run(folder: Path, domain: int, given: argparse.Namespace) -> int:
    """Runs camera node, image source and listener for a time; prints the results."""
    environment = node_environment(domain)
    rclpy.init(domain_id=domain)
    listener = Listener()
    words = [sys.executable, __file__, "--send", str(folder)]
    root = str(Path(__file__).resolve().parents[2])
    with NodeGroup("/slosh", folder / "logs", environment) as group:
        own = {"calibration": str(folder / "camera.yaml"), "transport": "compressed"}
        group.start(NodeProcess("camera", (), own))
        spin(listener, lambda: bool(listener.health), PATIENCE)
        lens = subprocess.Popen(
            [*words, "--fps", str(given.fps)], env={**environment, "PYTHONPATH": root}
        )
        try:
            spin(listener, lambda: len(listener.found) > PHASES, PATIENCE)
            listener.found.clear()
            before, begun = resident(group.pid("camera"), own=True), time.monotonic()
            spin(listener, lambda: time.monotonic() > begun + given.seconds, 2 * given.seconds)
            after = resident(group.pid("camera"), own=True)
        finally:
            lens.kill()
            lens.wait()
    rclpy.shutdown()
    print(f"camera's memory {before:.0f} MB at first, {after:.0f} MB in the end")
    return report(listener, given.seconds, given.fps)


def spin(listener: Listener, condition: Any, patience: float) -> None:
    """Runs the listener until a condition holds; raises an error after a timeout.

    Raises:
        RuntimeError: it does not happen.
    """
    end = time.monotonic() + patience
    while not condition():
        if time.monotonic() > end:
            raise RuntimeError(f"what was awaited did not come: {listener.health}")
        rclpy.spin_once(listener, timeout_sec=0.05)


def report(listener: Listener, seconds: float, fps: float) -> int:
    """Prints image rate, delays and height errors; returns the exit code."""
    ages = [(at - to_nanoseconds(one.header.stamp)) * 1e-6 for at, one in listener.found]
    middle, late, worst = np.percentile(ages, (50, 99, 100))
    print(
        f"{len(ages) / seconds:.1f} of {fps:.0f} images a second measured; delay "
        f"{middle:.0f} ms in the middle, {late:.0f} ms for 99 %, {worst:.0f} ms at most"
    )
    errors = []
    for _, one in listener.found:
        turn = 2.0 * math.pi * (one.header.stamp.nanosec % 100) / PHASES
        drawn = HEIGHT * cmath.exp(1j * turn)
        errors.append(abs(cmath.rect(one.fitted_msh, one.fitted_azimuth) - drawn))
    rms = math.sqrt(np.mean(np.square(errors)))
    print(f"heights as vectors: {1e3 * rms:.3f} mm rms, {1e3 * max(errors):.3f} mm at most")
    flagged = sum(bool(one.flags) for _, one in listener.found)
    print(f"flagged: {flagged} of {len(errors)}")
    for name, value in sorted(listener.health.items()):
        print(f"  {name or 'camera'}: {value}")
    return int(not max(errors) < 1e-3)


if __name__ == "__main__":
    sys.exit(main())
