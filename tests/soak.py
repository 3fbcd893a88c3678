"""A cell under attack for minutes: memory, and whether its recording replays bit for bit.

    tools/run python -m tests.soak [--minutes 10] [-o out/soak]

The simulated cell plays a robot; a stranger on the same machine sends, every half minute, one of
the messages that ended or misled an earlier version. In the end: what each node's memory did, what
the bag replays to, and how often the monitor was blind.
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import rclpy
from geometry_msgs.msg import AccelStamped
from rclpy.node import Node
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from slosh_bag.reader import BagReader
from slosh_bringup.processes import node_environment
from slosh_msgs.msg import FreeSurface, SloshComparison
from slosh_msgs.srv import LoadModel
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.domain import own_domain
from slosh_msgs_py.stamps import to_time
from slosh_replay.replay import replay_bag
from tests.long_cell import long_cell, sizes

EVERY = 30.0  # s
SAMPLED = 5.0  # s; how often memory is looked at
ALIASES = "a0: &a0 [1, 1]\n" + "".join(
    f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 40)
)
CUP = "container: {shape: cylinder, radius: %s, fill_height: 0.07}\n"


class Stranger:
    """Sends what a cell must bear."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._accel = node.create_publisher(AccelStamped, topics.ACCEL, qos.STREAM_OUT)
        self._surface = node.create_publisher(FreeSurface, topics.FREE_SURFACE, qos.STREAM_OUT)
        self._image = node.create_publisher(Image, topics.IMAGE, qos.STREAM_OUT)
        self._load = node.create_client(LoadModel, topics.LOAD_MODEL)
        self._reset = node.create_client(Trigger, topics.RESET)
        self.attacks: list[tuple[str, Callable[[], object]]] = [
            ("a spike of 200 m/s²", lambda: self._sample(200.0)),
            ("a model of radius 1e-300", lambda: self._text(CUP % "1e-300")),
            ("a sample 0.15 s ahead", lambda: self._sample(0.0, 0.15)),
            ("the file /etc/passwd as a model", lambda: self._path("/etc/passwd")),
            ("numbers that are none", lambda: self._sample(math.nan)),
            ("a model that refers to itself forty times", lambda: self._text(ALIASES)),
            ("an image of another encoding", self._broken_image),
            ("a measurement of the year 1970", lambda: self._measure(0)),
            ("the file /dev/zero as a model", lambda: self._path("/dev/zero")),
            ("1.7e308 m/s²", lambda: self._sample(1.7e308)),
            ("a measurement of the year 2038", lambda: self._measure(2**31 - 1)),
            ("a reset in motion", lambda: self._reset.call_async(Trigger.Request())),
            ("a sample 5 s ahead", lambda: self._sample(0.0, 5.0)),
        ]

    def _sample(self, ax: float, ahead: float = 0.0) -> None:
        message = AccelStamped()
        message.header.frame_id = "world"
        message.header.stamp = to_time(time.time_ns() + round(ahead * 1e9))
        message.accel.linear.x = ax
        self._accel.publish(message)

    def _measure(self, second: int) -> None:
        message = FreeSurface(msh=0.001)
        message.header.stamp.sec = second
        self._surface.publish(message)

    def _broken_image(self) -> None:
        message = Image(encoding="mono17", height=2, width=2, step=2, data=[0, 0, 0, 0])
        message.header.stamp = to_time(time.time_ns())
        self._image.publish(message)

    def _text(self, text: str) -> None:
        self._load.call_async(LoadModel.Request(text=text))

    def _path(self, path: str) -> None:
        self._load.call_async(LoadModel.Request(path=path))


def main() -> int:
    """Runs the soak; 1 where a node grew, the replay differs, or the cell ended by itself."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/soak"))
    given = parser.parse_args()
    with own_domain() as domain:
        os.environ.update(node_environment(domain))
        return soak(60.0 * given.minutes, given.output)


def soak(seconds: float, output: Path) -> int:
    """See main."""
    robot = {"motion": "l", "repeat": "100", "fps": "15.0"}
    # Ten minutes are replayed in the end, on a machine with load.
    with long_cell(output, robot, patience=600.0) as cell:
        ended, memory, states, sent = attack(cell.process, seconds)
    return report(output, ended, cell.code, memory, states, sent)


def attack(
    cell: subprocess.Popen[bytes], seconds: float
) -> tuple[bool, dict[str, list[float]], Counter[int], Counter[str]]:
    """Attacks for so long [s]; whether the cell ended, memory by node, states, attacks."""
    rclpy.init()
    node = rclpy.create_node("stranger", namespace="/slosh")
    states: Counter[int] = Counter()
    node.create_subscription(
        SloshComparison,
        topics.COMPARISON,
        lambda message: states.update([message.state]),
        qos.STREAM_IN,
    )
    sent: Counter[str] = Counter()
    memory: dict[str, list[float]] = {}
    begun, end = time.monotonic(), time.monotonic() + seconds
    due, look = begun + EVERY, begun + SAMPLED
    order = itertools.count()
    while time.monotonic() < end and cell.poll() is None:
        rclpy.spin_once(node, timeout_sec=0.05)
        if time.monotonic() >= look:
            look += SAMPLED
            for (name, _), size in sizes(cell.pid).items():
                memory.setdefault(name, []).append(size)
        if time.monotonic() >= due:
            due += EVERY
            sent[visit(next(order))] += 1
    ended = cell.poll() is not None
    node.destroy_node()
    rclpy.shutdown()
    return ended, memory, states, sent


def visit(number: int) -> str:
    """A stranger comes, sends and goes; returns what it sent.

    Two publishers for longer than seconds would make the monitor blind, as they should.
    """
    node = rclpy.create_node("stranger_once", namespace="/slosh")
    stranger = Stranger(node)
    name, send = stranger.attacks[number % len(stranger.attacks)]
    for _ in range(10):
        rclpy.spin_once(node, timeout_sec=0.1)
    send()
    for _ in range(3):
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_node()
    return name


def report(
    output: Path,
    ended: bool,
    code: int,
    memory: dict[str, list[float]],
    states: Counter[int],
    sent: Counter[str],
) -> int:
    """Prints what came of it."""
    for name, count in sent.items():
        print(f"{count} x {name}")
    grown = False
    for name, values in sorted(memory.items()):
        # The first quarter fills buffers and reads code.
        settled = values[len(values) // 4 :]
        half = len(settled) // 2
        early, late = (sum(part) / max(len(part), 1) for part in (settled[:half], settled[half:]))
        grown |= late > 1.05 * early + 5.0
        print(f"{name:<10} memory {values[0]:7.1f} MB at first, {early:7.1f}, then {late:7.1f}")
    bag = output / "latest" / "bag"
    names = {0: "OK", 1: "WARN", 2: "ERROR", 3: "STALE", 4: "BLIND"}
    print(
        "states     " + ", ".join(f"{names[key]} {count}" for key, count in sorted(states.items()))
    )
    verification = replay_bag(bag).verification
    exact = verification is not None and verification.exact
    for line in verification.lines() if verification else ("no estimates",):
        print(line)
    lost = BagReader(bag).metadata().get("messages_lost", "0")
    print(f"messages lost {lost}; the cell ended by itself: {ended}; exit code {code}")
    return int(ended or grown or not exact or code != 0)


if __name__ == "__main__":
    sys.exit(main())
