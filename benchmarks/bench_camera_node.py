"""Measures how many images per second the camera node processes beside the estimator.

    tools/run python benchmarks/bench_camera_node.py [--seconds 10] [--rates 60 120]

Camera node and estimator node are processes of their own, as in a cell; the estimator gets
AccelStamped at 1 kHz from a third one. This process publishes 1280 x 720 images of the moving
liquid and hears the heights, all over DDS. At 60 images per second none should be missing; a rate
that is too high shows what the node can do, and that it drops images rather than lags behind.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rclpy
from bench_camera_detector import rendered
from bench_estimator_node import MODEL, send
from diagnostic_msgs.msg import DiagnosticArray
from measuring import parsed, with_own_modules
from rclpy.node import Node
from sensor_msgs.msg import Image

from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_camera.calibrate.camera_file import format_calibration
from slosh_msgs.msg import FreeSurface
from slosh_msgs_py import images, qos, topics
from slosh_msgs_py.node.domain import own_domain
from slosh_msgs_py.node.readiness import READY, STATE
from slosh_msgs_py.node.run import make_executor
from slosh_msgs_py.stamps import to_nanoseconds, to_time

GOAL = 60.0
"""Images per second, at the best of the rates."""
NAMESPACE = "/bench"
FRAMES = 60
PATIENCE = 30.0
WARM_UP = 1.0
ACCELERATIONS = 1000


class Rig(Node):
    """ROS node that publishes images and receives heights and diagnostics."""

    def __init__(self) -> None:
        super().__init__("bench", namespace=NAMESPACE)
        self.camera = self.create_publisher(Image, topics.IMAGE, qos.IMAGE_OUT)
        self.heard: dict[int, int] = {}
        self.facts: dict[str, dict[str, str]] = {}
        self.create_subscription(FreeSurface, topics.FREE_SURFACE, self._on_height, qos.STREAM_IN)
        self.create_subscription(
            DiagnosticArray, topics.DIAGNOSTICS, self._on_report, qos.DIAGNOSTICS
        )

    def now(self) -> int:
        """Returns the present ROS time [ns]."""
        return int(self.get_clock().now().nanoseconds)

    def _on_height(self, message: FreeSurface) -> None:
        self.heard[to_nanoseconds(message.header.stamp)] = self.now()

    def _on_report(self, message: DiagnosticArray) -> None:
        for status in message.status:
            facts = {pair.key: pair.value for pair in status.values}
            self.facts[status.name.rsplit("/", 1)[-1]] = facts


def play(rig: Rig, executor: Any, messages: list[Image], rate: float, seconds: float) -> list[int]:
    """Publishes images at a fixed rate on an absolute schedule; returns their stamps [ns]."""
    stamps = []
    begin = time.monotonic()
    for number in range(round(seconds * rate)):
        due = begin + number / rate
        while (left := due - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)
        message = messages[number % len(messages)]
        stamps.append(rig.now())
        message.header.stamp = to_time(stamps[-1])
        rig.camera.publish(message)
    wait(executor, lambda: False, 1.2)  # the last heights, and one more report
    return stamps


def wait(executor: Any, condition: Any, patience: float) -> bool:
    """Runs callbacks until a condition holds or a timeout ends; returns whether it holds."""
    deadline = time.monotonic() + patience
    while not condition() and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.05)
    return bool(condition())


def measure(
    rig: Rig, executor: Any, messages: list[Image], rate: float, seconds: float
) -> dict[str, Any]:
    """Publishes images at a rate; returns rates, latencies and losses of the camera node."""
    play(rig, executor, messages, rate, WARM_UP)
    before = int(rig.facts["camera"]["dropped images"])
    begin = time.monotonic()
    stamps = play(rig, executor, messages, rate, seconds)
    took = time.monotonic() - begin - 1.2
    late = [1e-6 * (rig.heard[stamp] - stamp) for stamp in stamps if stamp in rig.heard]
    if not late:
        raise SystemExit("no image was measured")
    dropped = int(rig.facts["camera"]["dropped images"]) - before
    estimator = {
        key: value for key, value in rig.facts.get("estimator", {}).items() if "[Hz]" in key
    }
    return {
        "published [Hz]": round(len(stamps) / took, 1),
        "measured [Hz]": round(len(late) / took, 1),
        "published": len(stamps),
        "measured": len(late),
        "dropped": dropped,
        "unaccounted for": len(stamps) - len(late) - dropped,
        "latency, median [ms]": round(float(np.median(late)), 1),
        "latency, greatest [ms]": round(max(late), 1),
        "estimator": estimator,
    }


def run(kind: str, rates: list[float], seconds: float) -> list[dict[str, Any]]:
    """Starts camera and estimator node, and measures at each image rate."""
    calibration, (still, *pictures) = rendered(kind, FRAMES)
    encoding = "mono8" if kind == "grey" else "bgr8"
    messages = [images.image_message(picture, encoding, 0, "camera") for picture in pictures]
    with own_domain() as domain, tempfile.TemporaryDirectory() as name:
        os.environ.update(with_own_modules(node_environment(domain)))
        folder = Path(name)
        (folder / "camera.yaml").write_text(format_calibration(calibration), encoding="utf-8")
        (folder / "model.yaml").write_text(MODEL, encoding="utf-8")
        cv2.imwrite(str(folder / "still.png"), still)
        files = {"calibration": "camera.yaml", "still_image": "still.png"}
        camera = {key: str(folder / value) for key, value in files.items()}
        total = round(ACCELERATIONS * (seconds + WARM_UP + 4.0) * len(rates) + PATIENCE * 1000)
        with NodeGroup(NAMESPACE, folder / "logs", dict(os.environ)) as group:
            group.start(NodeProcess("camera", parameters=camera))
            group.start(NodeProcess("estimator", parameters={"model": str(folder / "model.yaml")}))
            sender = subprocess.Popen([sys.executable, __file__, "--send", str(total)])
            try:
                return measured_at(rates, seconds, messages, group)
            finally:
                sender.kill()
                sender.wait()


def measured_at(
    rates: list[float], seconds: float, messages: list[Image], group: NodeGroup
) -> list[dict[str, Any]]:
    """Waits until both nodes are ready; returns the results at each image rate."""
    rclpy.init()
    rig, executor = Rig(), make_executor()
    executor.add_node(rig)

    def ready() -> bool:
        group.check()
        states = [rig.facts.get(name, {}).get(STATE) for name in ("camera", "estimator")]
        return states == [READY, READY]

    if not wait(executor, ready, PATIENCE):
        raise SystemExit("the nodes did not get ready")
    results = [measure(rig, executor, messages, rate, seconds) for rate in rates]
    rclpy.try_shutdown()
    return results


def main() -> int:
    """Prints the results as JSON; returns 1 if the required image rate is not reached."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rates", type=float, nargs="+", default=[60.0, 120.0])
    parser.add_argument("--kind", choices=("grey", "colour"), default="grey")
    parser.add_argument("--send", type=int, help=argparse.SUPPRESS)
    given = parsed(parser, seconds=0.5, rates=[10.0])
    if given.send:
        send(NAMESPACE, given.send)
        return 0
    results = run(given.kind, given.rates, given.seconds)
    for result in results:
        print(json.dumps({"images": given.kind, **result}))
    best = max(result["measured [Hz]"] for result in results)
    return 0 if best >= GOAL else 1


if __name__ == "__main__":
    sys.exit(main())
