"""Kills readers of images in the middle of messages; checks that other readers still receive.

    tools/run python -m validation.long_runs.killed_readers [--rounds 40] [--without]

A writer sends images at 60 per second and accelerations at 1 kHz; four processes read the
accelerations, one of them the images, too, and one reads the images alone. This one is stopped,
let go, and killed a moment later, when it has a queue of messages before it: what happens to one
kill in some dozens otherwise happens to every tenth. It is started again, and whoever hears
nothing in the last second of a round is printed. The dead port is held as `slosh cell` does, or
not at all (--without).
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from signal import SIGCONT, SIGKILL, SIGSTOP
from typing import Any
from unittest.mock import patch

import rclpy
from geometry_msgs.msg import AccelStamped
from rclpy.node import Node
from sensor_msgs.msg import Image

from slosh_bringup.processes import node_environment
from slosh_msgs_py import qos
from slosh_msgs_py.node.dead_ports import DeadPorts
from slosh_msgs_py.node.domain import own_domain
from slosh_msgs_py.node.run import initialise, make_heard

KILLED = "images"
READERS = {KILLED: ("image",), "both": ("image", "accel")} | {
    f"accel {number}": ("accel",) for number in range(3)
}
KINDS: dict[str, tuple[Any, Any]] = {
    "image": (Image, qos.IMAGE_RELIABLE_IN),
    "accel": (AccelStamped, qos.STREAM_IN),
}
FPS = 60.0
ROUND = 5.0
"""A process starts in one second, and a dead port is found out within some more [s]."""
LONGEST = 60.0
"""Nobody waits longer [s]."""


def main() -> int:
    """Runs the test; returns 1 if a reader no longer received messages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument(
        "--without", action="store_true", help="do not lock killed processes' ports"
    )
    parser.add_argument("--role", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.role == "writer":
        return write()
    if given.role:
        return read(given.role, given.without)
    with own_domain() as domain:
        os.environ.update(node_environment(domain))
        return kill(given.rounds, given.without)


def write() -> int:
    """Publishes images and accelerations until the process is killed."""
    rclpy.init()
    node = Node("writer")
    images = node.create_publisher(Image, "image", qos.IMAGE_OUT)
    accelerations = node.create_publisher(AccelStamped, "accel", qos.STREAM_OUT)
    image = Image(height=480, width=640, step=640, encoding="mono8", data=bytes(640 * 480))

    def film() -> None:
        begun = time.monotonic()
        for number in range(sys.maxsize):
            time.sleep(max(0.0, begun + number / FPS - time.monotonic()))
            images.publish(image)

    threading.Thread(target=film, daemon=True).start()
    while True:
        accelerations.publish(AccelStamped())
        time.sleep(0.001)


def read(name: str, without: bool) -> int:
    """Prints once a second how many messages of each topic were received."""
    if without:
        patch("slosh_msgs_py.node.run.hold_dead_ports").start()
    initialise([])
    node = make_heard(lambda: Node("reader"))
    heard = dict.fromkeys(READERS[name], 0)

    def count(topic: str) -> Any:
        def on_message(message: Any) -> None:
            heard[topic] += 1

        return on_message

    for topic in heard:
        kind, profile = KINDS[topic]
        node.create_subscription(kind, topic, count(topic), profile)

    def tell() -> None:
        print(*heard.values(), flush=True)
        heard.update(dict.fromkeys(heard, 0))

    node.create_timer(1.0, tell)
    rclpy.spin(node)
    return 0


class Reader:
    """A process that receives messages, and its newest message counts."""

    def __init__(self, name: str, options: list[str]) -> None:
        self._command = [sys.executable, __file__, "--role", name, *options]
        self.start()

    def start(self) -> None:
        """Starts the reader's process, or restarts a killed one."""
        self.told: tuple[int, ...] = ()
        self.process = subprocess.Popen(
            self._command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        threading.Thread(target=self._listen, args=(self.process,), daemon=True).start()

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            with suppress(ValueError):
                self.told = tuple(map(int, line.split()))

    def kill_amid_messages(self) -> None:
        """Kills the reader while it processes messages that were queued while it was paused."""
        self.process.send_signal(SIGSTOP)
        time.sleep(0.3)
        self.process.send_signal(SIGCONT)
        time.sleep(random.uniform(0.0, 0.004))
        self.process.send_signal(SIGKILL)
        self.process.wait()


@contextmanager
def running(options: list[str]) -> Iterator[dict[str, Reader]]:
    """Runs the writer and all readers inside a `with` block."""
    writer = subprocess.Popen([sys.executable, __file__, "--role", "writer"])
    readers = {name: Reader(name, options) for name in READERS}
    try:
        yield readers
    finally:
        writer.kill()
        for reader in readers.values():
            reader.process.kill()


def kill(rounds: int, without: bool) -> int:
    """Kills the image reader repeatedly, and prints which readers receive nothing."""
    lasted, dead_ports = [], DeadPorts()
    with running(["--without"] if without else []) as readers:
        time.sleep(2 * ROUND)
        for number in range(1, rounds + 1):
            readers[KILLED].kill_amid_messages()
            if not without:
                dead_ports.look(close=True)
            readers[KILLED].start()
            begun = time.monotonic()
            time.sleep(ROUND)
            deaf = deaf_ones(readers)
            if deaf:
                while deaf_ones(readers) and time.monotonic() < begun + LONGEST:
                    time.sleep(0.5)
                lasted.append(time.monotonic() - begun)
                print(f"kill {number}: {', '.join(deaf)} deaf for {lasted[-1]:.0f} s", flush=True)
    print(f"{rounds} kills, after {len(lasted)} of them somebody heard nothing 5 s later, "
          f"for {max(lasted, default=0.0):.0f} s at most ({LONGEST:.0f} s: for ever)")  # fmt: skip
    return int(bool(lasted))


def deaf_ones(readers: Mapping[str, Reader]) -> list[str]:
    """Returns the readers that received nothing on one of their topics in the last second."""
    return [name for name, reader in readers.items() if not (reader.told and all(reader.told))]


if __name__ == "__main__":
    sys.exit(main())
