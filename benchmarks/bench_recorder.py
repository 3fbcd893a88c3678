"""Compares the recorder's processor time with writing the same messages with mcap alone.

    tools/run python benchmarks/bench_recorder.py [--seconds 8] [--rounds 3]

AccelStamped at 1 kHz and 1280 x 720 images at 60 Hz, as mono8 and as JPEG, come over DDS from a
process of their own. Compared are, as processor time per time (user and system):

- `recorder`: the recorder node's process;
- `receive`: a process that takes the same messages the way the recorder does and drops them;
- `callbacks`: one whose executor calls a raw subscription for each message, and drops them;
- `core`: the recorder's queue and its writer's thread, fed from memory;
- `mcap`: mcap.writer.Writer with zstd and its default chunks, fed from memory;
- `mcap, same level`: the same with the recorder's level of zstd, which that writer does not offer:
  what is left is the price of the queue and the thread.

The goals are core <= 1.5 mcap for both, and recorder <= 1.5 mcap for the images as they are. JPEG
are so few bytes that receiving a thousand messages a second costs about as much as writing all.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import unittest.mock
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rclpy
import zstandard
from geometry_msgs.msg import AccelStamped
from mcap.writer import CompressionType, Writer
from measuring import parsed, with_own_modules
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Image

from slosh_bag.bag_writer import Qos
from slosh_bag.definitions import Definitions
from slosh_bag.mcap_files.mcap_file import FAST
from slosh_bag.nodes.recorder_node import TAKE_PERIOD
from slosh_bag.nodes.topic_input import TopicInput
from slosh_bag.reader import BagMessage, BagReader
from slosh_bag.recorder import Recorder
from slosh_bringup.processes import node_environment
from slosh_msgs_py import images, qos
from slosh_msgs_py.node.domain import own_domain
from slosh_msgs_py.node.run import make_executor
from slosh_msgs_py.stamps import to_time

GOAL = 1.5
NAMESPACE = "/bench"
TYPES = {
    "accel": ("geometry_msgs/msg/AccelStamped", AccelStamped),
    "raw": ("sensor_msgs/msg/Image", Image),
    "jpeg": ("sensor_msgs/msg/CompressedImage", CompressedImage),
}
ACCELERATIONS, IMAGES = 1000, 60  # Hz
WARM_UP = 2.0  # s
PATIENCE = 30.0
TICKS = os.sysconf("SC_CLK_TCK")


def pictures(count: int = 20) -> list[Any]:
    """Returns smooth grey images with camera noise, all of them different."""
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[0:720, 0:1280]
    smooth = 120.0 + 60.0 * np.sin(columns / 90.0) + 30.0 * np.cos(rows / 70.0)
    return [
        np.clip(np.roll(smooth, 9 * number, 1) + rng.normal(0.0, 2.0, smooth.shape), 0, 255)
        .astype(np.uint8)
        for number in range(count)
    ]  # fmt: skip


def send(kind: str) -> None:
    """Publishes accelerations and images until the process is killed."""
    rclpy.init()
    node = rclpy.create_node("source", namespace=NAMESPACE)
    if kind == "raw":
        messages = [images.image_message(p, "mono8", 0, "camera") for p in pictures()]
    else:
        encoded = [cv2.imencode(".jpg", p)[1].tobytes() for p in pictures()]
        messages = [CompressedImage(format="jpeg", data=data) for data in encoded]
    accel = node.create_publisher(AccelStamped, "accel", qos.STREAM_OUT)
    image = node.create_publisher(TYPES[kind][1], kind, qos.IMAGE_OUT)
    acceleration = AccelStamped()
    begin, number, shown = time.monotonic(), 0, 0
    while True:
        if (left := begin + number / ACCELERATIONS - time.monotonic()) > 0.0:
            time.sleep(left)
        acceleration.header.stamp = to_time(time.time_ns())
        accel.publish(acceleration)
        if number * IMAGES >= shown * ACCELERATIONS:
            image.publish(messages[shown % len(messages)])
            shown += 1
        number += 1


def receive(kind: str, batches: bool, mark: Path) -> None:
    """Receives accelerations and images and drops them, until the process is killed.

    Args:
        kind: what kind of images.
        batches: as the recorder does; otherwise by callbacks.
        mark: a file that is made when an image has come.
    """
    waiting = [kind]

    def drop(message: Any) -> None:
        # An image, as bytes or with its times: the accelerations are short.
        data = message if isinstance(message, bytes) else message.data
        if waiting and len(data) > 10_000:
            waiting.clear()
            mark.touch()

    rclpy.init()
    node = _Sink() if batches else Node("sink", namespace=NAMESPACE)
    for name in ("accel", kind):
        type_name, message_type = TYPES[name]
        topic = f"{NAMESPACE}/{name}"
        if isinstance(node, _Sink):
            node.inputs.append(TopicInput(node, topic, type_name, message_type, 0.0))
        else:
            node.create_subscription(message_type, topic, drop, qos.STREAM_OUT, raw=True)
    executor = make_executor()
    executor.add_node(node)
    while True:
        executor.spin_once(timeout_sec=TAKE_PERIOD if batches else 0.1)
        if isinstance(node, _Sink):
            for entry in node.inputs:
                entry.take(drop)


class _Sink(Node):
    """Node that polls its subscriptions as the recorder does, outside of the executor."""

    def __init__(self) -> None:
        self.inputs: list[TopicInput] = []
        super().__init__("sink", namespace=NAMESPACE)

    @property
    def subscriptions(self) -> Iterator[Any]:
        """Yields nothing, since the executor must not serve the subscriptions."""
        return iter(())


def processor_time(pid: int) -> float:
    """Returns the user and system time that a process has used so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


@contextmanager
def process(*command: str, end: int = signal.SIGKILL) -> Iterator[int]:
    """Runs a command in its own process inside a `with` block; yields its process id."""
    child = subprocess.Popen([sys.executable, *command])
    try:
        yield child.pid
    finally:
        child.send_signal(end)
        child.wait(PATIENCE)


def share(pid: int, seconds: float, ready: Callable[[], bool]) -> float:
    """Returns the share of a core that a process uses, after it has become ready."""
    deadline = time.monotonic() + PATIENCE
    while not ready():
        if time.monotonic() > deadline:
            raise SystemExit("nothing is received")
        time.sleep(0.05)
    time.sleep(WARM_UP)
    before, begin = processor_time(pid), time.monotonic()
    time.sleep(seconds)
    return (processor_time(pid) - before) / (time.monotonic() - begin)


def recorded(bag: Path) -> int:
    """Returns the size of a bag's files [bytes]."""
    return sum(file.stat().st_size for file in bag.glob("*.mcap"))


def fed(act: Callable[[], None]) -> float:
    """Returns the processor time that a function uses in this process [s]."""
    before = time.process_time()
    act()
    return time.process_time() - before


def with_mcap(messages: list[BagMessage], path: Path) -> None:
    """Writes the messages with the library mcap alone."""
    definitions = Definitions()
    channels: dict[str, int] = {}
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start("ros2")
        for number, message in enumerate(messages):
            if message.topic not in channels:
                text = definitions.text(message.message_type).encode()
                schema = writer.register_schema(message.message_type, "ros2msg", text)
                channels[message.topic] = writer.register_channel(message.topic, "cdr", schema)
            writer.add_message(
                channels[message.topic], message.log_ns, message.data, message.publish_ns, number
            )
        writer.finish()


@contextmanager
def same_level() -> Iterator[None]:
    """Makes mcap's writer use the recorder's compression level inside a `with` block."""
    compressor = zstandard.ZstdCompressor(level=FAST)
    with unittest.mock.patch("mcap.writer.zstandard.compress", compressor.compress):
        yield


def with_core(messages: list[BagMessage], folder: Path) -> None:
    """Writes the messages with the recorder's queue and thread, without ROS."""
    recorder = Recorder(folder)
    for name, message_type in {(m.topic, m.message_type) for m in messages}:
        recorder.add_topic(name, message_type, Qos())
    for message in messages:
        while recorder.status().waiting > 1000:
            time.sleep(0.02)
        recorder.add(message.topic, message.data, message.log_ns, message.publish_ns)
    recorder.close()
    status = recorder.status()
    if status.lost or sum(status.written.values()) != len(messages):
        raise SystemExit("the core lost messages")


def measure(kind: str, seconds: float, folder: Path) -> dict[str, float]:
    """Measures the processor shares of all methods, one after the other."""
    shares = {}
    with process(__file__, "--send", kind):
        for name in ("receive", "callbacks"):
            mark = folder / name
            with process(__file__, f"--{name}", kind, "--mark", str(mark)) as pid:
                shares[name] = share(pid, seconds, mark.exists)
        command = ["-m", "slosh_bag.nodes.recorder_node", "--ros-args", "-r", f"__ns:={NAMESPACE}"]
        parameters = ["-p", f"output:={folder / 'bag'}", "-p", f"topics:=^{NAMESPACE}"]
        with process(*command, *parameters, end=signal.SIGTERM) as pid:
            shares["recorder"] = share(pid, seconds, lambda: recorded(folder / "bag") > 2**20)
    messages = list(BagReader(folder / "bag").messages())
    rates = {}
    for topic, rate in (("accel", ACCELERATIONS), (kind, IMAGES)):
        stamps = [message.log_ns for message in messages if message.topic.endswith(f"/{topic}")]
        rates[topic] = 1e9 * (len(stamps) - 1) / (stamps[-1] - stamps[0])
        if rates[topic] < 0.9 * rate:
            print(f"{kind}: only {rates[topic]:.0f}/s of {topic} came", file=sys.stderr)
    covered = 1e-9 * (messages[-1].log_ns - messages[0].log_ns)
    shares["mcap"] = fed(lambda: with_mcap(messages, folder / "mcap.mcap")) / covered
    with same_level():
        alone = fed(lambda: with_mcap(messages, folder / "fast.mcap"))
    shares["mcap, same level"] = alone / covered
    shares["core"] = fed(lambda: with_core(messages, folder / "core")) / covered
    return shares


def main() -> int:
    """Prints the medians as JSON; returns 1 if the goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--kinds", nargs="+", choices=("raw", "jpeg"), default=["raw", "jpeg"])
    for hidden in ("send", "receive", "callbacks", "mark"):
        parser.add_argument(f"--{hidden}", help=argparse.SUPPRESS)
    given = parsed(parser, seconds=0.5, rounds=1, kinds=["raw"])
    if given.send:
        send(given.send)
    if given.receive or given.callbacks:
        receive(given.receive or given.callbacks, bool(given.receive), Path(given.mark))
    with own_domain() as domain:
        os.environ.update(with_own_modules(node_environment(domain)))
        return compare(given.kinds, given.rounds, given.seconds)


def compare(kinds: Sequence[str], count: int, seconds: float) -> int:
    """Prints the medians for each kind of image; returns 1 if the goal is missed."""
    reached = True
    for kind in kinds:
        rounds = []
        for _ in range(count):
            with tempfile.TemporaryDirectory() as folder:
                rounds.append(measure(kind, seconds, Path(folder)))
        shares = {name: statistics.median(r[name] for r in rounds) for name in rounds[0]}
        ratios = {
            f"{name}/mcap": statistics.median(r[name] / r["mcap"] for r in rounds)
            for name in ("recorder", "receive", "callbacks", "core")
        }
        ratios["core/mcap, same level"] = statistics.median(
            r["core"] / r["mcap, same level"] for r in rounds
        )
        print(json.dumps({"images": kind, **{k: round(v, 4) for k, v in shares.items()},
                          **{k: round(v, 2) for k, v in ratios.items()}}))  # fmt: skip
        reached &= ratios["core/mcap"] <= GOAL
        reached &= ratios["recorder/mcap"] <= GOAL or kind == "jpeg"
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
