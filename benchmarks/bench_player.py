"""Measures how exactly `slosh play` keeps publishing times, against a bare sleeping loop.

A bag with accelerations at 1 kHz and images at 60 Hz is played at rate 1 to a subscriber in a
process of its own. The bare loop publishes the same bytes, all in memory beforehand, on the same
schedule with the same publishers: what it is late is the machine's own. Both take turns. Lateness
is from when a message is due to when it is handed to rclpy.

    tools/run python benchmarks/bench_player.py [--seconds 5] [--turns 3]
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import AccelStamped
from measuring import parsed
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock

from slosh_bag.bag_writer import BagWriter, Qos
from slosh_bag.nodes.player_node import playable, profile
from slosh_bag.nodes.player_thread import PlayerThread
from slosh_bag.playing.play_plan import CLOCK, STREAM_DEPTH, PlayPlan, PlayRequest, make_plan
from slosh_msgs_py import images, qos, topics
from slosh_msgs_py.conversions import find_type
from slosh_msgs_py.node.domain import own_domain
from slosh_msgs_py.node.run import make_executor
from slosh_msgs_py.stamps import to_time

RATE, FPS = 1000, 60
WIDTH, HEIGHT = 640, 480
GOAL_MS = 1.0
"""What the player's 99th percentile may be later than the bare loop's [ms]."""
PERCENTILES = (50.0, 99.0, 99.9, 100.0)
PATIENCE = 30.0


def write_bag(folder: Path, seconds: float) -> None:
    """Writes a bag with accelerations and noisy images (4 of 8 bits are noise)."""
    noise = np.random.default_rng(1)
    with BagWriter(folder) as writer:
        writer.add_topic("/slosh/accel", "geometry_msgs/msg/AccelStamped")
        writer.add_topic("/slosh/camera/image_raw", "sensor_msgs/msg/Image")
        begin, next_frame = 1_700_000_000_000_000_000, 0
        for k in range(round(seconds * RATE)):
            stamp = begin + k * 1_000_000
            message = AccelStamped()
            message.header.stamp, message.header.frame_id = to_time(stamp), "world"
            writer.write("/slosh/accel", serialize_message(message), stamp)
            if k * FPS >= next_frame * RATE:
                pixels = noise.integers(0, 16, (HEIGHT, WIDTH)).astype(np.uint8)
                image = images.image_message(pixels, "mono8", stamp, "camera_optical")
                writer.write("/slosh/camera/image_raw", serialize_message(image), stamp)
                next_frame += 1


def listen() -> None:
    """Receives all messages until the process is killed."""
    rclpy.init()
    node = Node("listener", namespace=topics.NAMESPACE)
    executor = make_executor()
    executor.add_node(node)
    heard: list[int] = []
    for kind, topic, reader in (
        ("geometry_msgs/msg/AccelStamped", topics.ACCEL, qos.STREAM_IN),
        ("sensor_msgs/msg/Image", topics.IMAGE, qos.IMAGE_RELIABLE_IN),
    ):
        node.create_subscription(
            find_type(kind), topic, lambda data: heard.append(len(data)), reader, raw=True
        )
    while True:
        executor.spin_once(timeout_sec=0.1)


class Meter:
    """Publisher wrapper that records when messages are published."""

    def __init__(self, publisher: Any, times: list[int]) -> None:
        self._publisher = publisher
        self._times = times
        self.get_subscription_count = publisher.get_subscription_count
        self.wait_for_all_acked = publisher.wait_for_all_acked

    def publish(self, message: Any) -> None:
        """Records the time and publishes the message."""
        self._times.append(time.monotonic_ns())
        self._publisher.publish(message)


def publishers(node: Node, plan: PlayPlan, times: list[int]) -> dict[str, Meter]:
    """Creates a recording publisher for each topic, as the player node does."""
    plan, kinds = playable(plan)
    return {
        topic: Meter(node.create_publisher(kinds[topic], entry.name, profile(entry.qos)), times)
        for topic, entry in plan.topics.items()
    }


def run_player(node: Node, plan: PlayPlan) -> tuple[int, list[int]]:
    """Runs the player's thread; returns its start time and all publishing times [ns]."""
    times: list[int] = []
    clock = node.create_publisher(Clock, CLOCK, profile(Qos(depth=STREAM_DEPTH)))
    thread = PlayerThread(plan, publishers(node, plan, times), clock, print)
    thread.start(2, PATIENCE)
    while not thread.finished:
        time.sleep(0.1)
    thread.stop()
    if thread.failure:
        raise SystemExit(thread.failure)
    return thread.began_ns, times


def run_bare(node: Node, plan: PlayPlan) -> tuple[int, list[int]]:
    """Publishes in a bare loop; returns its start time and all publishing times [ns]."""
    times: list[int] = []
    meters = publishers(node, plan, times)
    due = [
        (step.wall_ns, meters[step.message.topic], step.message.data)
        for step in plan.steps()
        if step.message is not None
    ]
    while sum(meter.get_subscription_count() for meter in meters.values()) < 2:
        time.sleep(0.05)
    time.sleep(0.5)
    begin = time.monotonic_ns()
    for wall_ns, meter, data in due:
        left = begin + wall_ns - time.monotonic_ns()
        if left > 0:
            time.sleep(left * 1e-9)
        meter.publish(data)
    return begin, times


def measure(way: str, bag: Path) -> dict[str, Any]:
    """Returns the lateness of one method [ms], and the share of a core that it uses."""
    rclpy.init()
    node = Node("bench")
    plan = make_plan(PlayRequest(bag))
    due = [step.wall_ns for step in plan.steps() if step.message is not None]
    gc.collect()
    gc.freeze()
    spent, wall = time.process_time(), time.monotonic()
    begin, times = (run_player if way == "player" else run_bare)(node, plan)
    share = (time.process_time() - spent) / (time.monotonic() - wall)
    late = (np.array(times) - begin - np.array(due)) * 1e-6
    rclpy.try_shutdown()
    return {
        "late_ms": [round(float(value), 3) for value in np.percentile(late, PERCENTILES)],
        "processor": round(share, 3),
    }


def compare(seconds: float, turns: int) -> dict[str, Any]:
    """Measures player and bare loop in turns, each in its own process."""
    runs: dict[str, list[dict[str, Any]]] = {"bare": [], "player": []}
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        write_bag(bag, seconds)
        for _ in range(turns):
            for way, results in runs.items():
                listener = subprocess.Popen([sys.executable, __file__, "--listen"])
                try:
                    done = subprocess.run(
                        [sys.executable, __file__, "--way", way, "--bag", str(bag)],
                        check=True,
                        capture_output=True,
                        text=True,
                    )
                finally:
                    listener.kill()
                    listener.wait()
                results.append(json.loads(done.stdout.splitlines()[-1]))
    result: dict[str, Any] = {"percentiles": PERCENTILES}
    for way, results in runs.items():
        late = np.median([entry["late_ms"] for entry in results], axis=0)
        result[f"{way}_late_ms"] = [round(float(value), 3) for value in late]
        result[f"{way}_processor"] = float(np.median([entry["processor"] for entry in results]))
    return result


def main() -> int:
    """Prints the result as JSON; returns 1 if the goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--listen", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--way", help=argparse.SUPPRESS)
    parser.add_argument("--bag", type=Path, help=argparse.SUPPRESS)
    given = parsed(parser, seconds=0.3, turns=1)
    if given.listen:
        listen()
    if given.way:
        print(json.dumps(measure(given.way, given.bag)))
        return 0
    with own_domain() as domain:
        os.environ.setdefault("ROS_DOMAIN_ID", str(domain))
        result = compare(given.seconds, given.turns)
    behind = result["player_late_ms"][1] - result["bare_late_ms"][1]
    result |= {"p99_behind_bare_ms": round(behind, 3), "goal_ms": GOAL_MS}
    print(json.dumps(result))
    return 0 if behind <= GOAL_MS else 1


if __name__ == "__main__":
    sys.exit(main())
