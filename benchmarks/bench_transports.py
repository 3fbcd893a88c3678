"""Compares image transport by shared memory with transport by loopback UDP only.

    tools/run python benchmarks/bench_transports.py [--seconds 8]

UDP alone would spare the cell what a killed process leaves in shared memory
(docs/results/hostile_input.md). A process sends bgr8 images, another reads them as the camera node
does where they are offered reliable, and as sensor data. Printed are the share that arrived and
both processes' time per image that arrived [ms]. The goal: shared memory brings 0.95 of the
smallest,
of which a robot's camera sends no fewer.
"""

from __future__ import annotations

import argparse
import array
import json
import os
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import NamedTuple

import rclpy
from measuring import parsed, with_own_modules
from rclpy.node import Node
from sensor_msgs.msg import Image

from slosh_bringup.processes import node_environment
from slosh_msgs_py import qos
from slosh_msgs_py.node import network
from slosh_msgs_py.node.domain import own_domain
from slosh_msgs_py.node.network import PROFILES

GOAL = 0.95
SPACE = {"dds": "http://www.eprosima.com"}
PROFILE = Path(network.__file__).parent / "profiles" / "this_machine.xml"
READERS = {"reliable": qos.IMAGE_RELIABLE_IN, "sensor data": qos.IMAGE_IN}
SILENCE = 3.0
"""Nothing has come for so long [s]: it is over."""
PATIENCE = 30.0
"""A process starts within [s]."""


class Stream(NamedTuple):
    """Size and rate of the images to send: rows, columns, images per second."""

    height: int
    width: int
    fps: float


STREAMS = (Stream(480, 640, 60.0), Stream(1080, 1920, 30.0), Stream(2160, 3840, 15.0))


def main() -> int:
    """Prints results by image size, transport and reader; returns 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--role", nargs=6, help=argparse.SUPPRESS)
    given = parsed(parser, seconds=0.5)
    if given.role:
        role, kind, height, width, fps, seconds = given.role
        stream = Stream(int(height), int(width), float(fps))
        return send(stream, float(seconds)) if role == "send" else read(kind)
    with own_domain() as domain, tempfile.TemporaryDirectory() as folder:
        environments = {"shared memory": with_own_modules(node_environment(domain))}
        environments["UDP"] = environments["shared memory"] | udp_alone(Path(folder))
        return compare(environments, given.seconds)


def udp_alone(folder: Path) -> dict[str, str]:
    """Returns environment variables for DDS without shared memory, but else the cell's profile."""
    ElementTree.register_namespace("", SPACE["dds"])
    profile = ElementTree.parse(PROFILE)
    for used in profile.iterfind(".//dds:userTransports", SPACE):
        for transport in used.findall("dds:transport_id", SPACE):
            if transport.text == "shared_memory":
                used.remove(transport)
    path = folder / "udp.xml"
    profile.write(path)
    return dict.fromkeys(PROFILES, str(path))


def compare(environments: dict[str, dict[str, str]], seconds: float) -> int:
    """Prints which share of images arrives; returns 1 if shared memory misses the goal."""
    reached = True
    for stream in STREAMS:
        for kind in READERS:
            for transport, environment in environments.items():
                share, cost = measure(stream, kind, environment, seconds)
                print(json.dumps({
                    "images": f"{stream.width} x {stream.height}, {stream.fps:g}/s",
                    "reader": kind, "transport": transport, "arrived": round(share, 2),
                    "ms per image": round(cost, 1),
                }), flush=True)  # fmt: skip
                reached &= transport == "UDP" or stream != STREAMS[0] or share >= GOAL
    return int(not reached)


def measure(
    stream: Stream, kind: str, environment: dict[str, str], seconds: float
) -> tuple[float, float]:
    """Returns the share of images that arrive, and processor time per arrived image [ms]."""
    ends = [
        subprocess.Popen(
            [sys.executable, __file__, "--role", role, kind, *map(str, stream), str(seconds)],
            env={**os.environ, **environment}, stdout=subprocess.PIPE, text=True,
        )
        for role in ("send", "read")
    ]  # fmt: skip
    (sent, sending), (got, reading) = (
        map(float, end.communicate(timeout=seconds + 3 * PATIENCE)[0].split()) for end in ends
    )
    return got / sent, 1e3 * (sending + reading) / max(got, 1.0)


def send(stream: Stream, seconds: float) -> int:
    """Sends the images; prints their number and the processor time used [s]."""
    rclpy.init()
    publisher = Node("sends").create_publisher(Image, "image", qos.IMAGE_OUT)
    row = 3 * stream.width
    image = Image(height=stream.height, width=stream.width, step=row, encoding="bgr8")
    image.data = array.array("B", bytes(row * stream.height))
    patience = time.monotonic() + PATIENCE
    while not publisher.get_subscription_count() and time.monotonic() < patience:
        time.sleep(0.05)
    time.sleep(1.0)
    begun, spent = time.monotonic(), time.process_time()
    for number in range(count := round(stream.fps * seconds)):
        time.sleep(max(0.0, begun + number / stream.fps - time.monotonic()))
        publisher.publish(image)
    print(count, time.process_time() - spent)
    time.sleep(SILENCE)  # what is offered reliable is sent again
    return 0


def read(kind: str) -> int:
    """Receives images until none comes any more; prints their number and processor time [s]."""
    rclpy.init()
    node = Node("reads")
    got = 0

    def count(_: Image) -> None:
        nonlocal got
        got += 1

    node.create_subscription(Image, "image", count, READERS[kind])
    last, seen, spent = time.monotonic(), 0, time.process_time()
    while time.monotonic() < last + (SILENCE if got else PATIENCE):
        rclpy.spin_once(node, timeout_sec=0.5)
        if got > seen:
            last, seen = time.monotonic(), got
    print(got, time.process_time() - spent)
    return 0


if __name__ == "__main__":
    sys.exit(main())
