"""Runs a cell under attack for minutes; checks its memory and the replay of its bag.

    tools/run python -m validation.long_runs.soak [--minutes 10] [-o out/soak]

The simulated cell plays a robot; a stranger on the same machine sends, every half minute, one of
the messages that ended or misled an earlier version, or stops the recorder for a moment. In the
end: what each node's memory did, what the bag replays to, how often the monitor was blind, how far
estimate and measurement were apart where it said OK, and whether the losses that the recorder
tells are those that the estimates' own numbers show.
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import AccelStamped
from rclpy.node import Node
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_bringup.processes import node_environment
from slosh_bringup.replay.by_journal import checked_by_journal
from slosh_motion.recorded.sources import mixed_topics
from slosh_msgs.msg import FreeSurface, PredictionOutcome, SloshComparison
from slosh_msgs.srv import LoadModel
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.domain import own_domain
from slosh_msgs_py.stamps import to_time
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import replay_bag
from slosh_testing.live_processes import nodes_of
from validation.long_runs.long_cell import long_cell, sizes

EVERY = 30.0  # s
PORT = 8798  # of the page
SAMPLED = 5.0  # s; how often memory is looked at
ALIASES = "a0: &a0 [1, 1]\n" + "".join(
    f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 40)
)
CUP = "container: {shape: cylinder, radius: %s, fill_height: 0.07}\n"


class Stranger:
    """Publishes the malicious messages that a cell must survive."""

    def __init__(self, node: Node, recorder: int | None = None) -> None:
        self._node, self._recorder = node, recorder
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
            ("a height of 1e308 m", lambda: self._measure(time.time_ns() // 10**9, 1e308)),
            ("the recorder stopped for 0.3 s, five times", self._stop_recorder),
            ("2000 names of nodes in the diagnostics", self._names),
            ("a second source of accelerations for a second", self._rival),
            ("one image 30 times in a second", self._old_images),
            ("an outcome of a prediction that cannot be", self._outcome),
        ]

    def _stop_recorder(self) -> None:
        if self._recorder is None:
            return
        for _ in range(5):
            os.kill(self._recorder, signal.SIGSTOP)
            time.sleep(0.3)
            os.kill(self._recorder, signal.SIGCONT)
            time.sleep(0.2)

    def _names(self) -> None:
        publisher = self._node.create_publisher(DiagnosticArray, "/diagnostics", qos.DIAGNOSTICS)
        for number in range(2000):
            status = DiagnosticStatus(name=f"/slosh/stranger_{number}: health", message="well")
            message = DiagnosticArray(status=[status])
            message.header.stamp = to_time(time.time_ns())
            publisher.publish(message)
            time.sleep(0.001)

    def _rival(self) -> None:
        for _ in range(200):
            self._sample(0.0)
            time.sleep(0.005)

    def _old_images(self) -> None:
        seen: list[Image] = []
        taken = self._node.create_subscription(Image, topics.IMAGE, seen.append, qos.STREAM_IN)
        deadline = time.monotonic() + 5.0
        while not seen and time.monotonic() < deadline:
            rclpy.spin_once(self._node, timeout_sec=0.1)
        for image in seen[:1] * 30:
            image.header.stamp = to_time(time.time_ns())
            self._image.publish(image)
            time.sleep(0.03)
        self._node.destroy_subscription(taken)

    def _outcome(self) -> None:
        publisher = self._node.create_publisher(
            PredictionOutcome, topics.PREDICTION_OUTCOME, qos.EVENT
        )
        publisher.publish(PredictionOutcome(count=9, sigma=1e9, epsilon=-7.0))

    def _sample(self, ax: float, ahead: float = 0.0) -> None:
        message = AccelStamped()
        message.header.frame_id = "world"
        message.header.stamp = to_time(time.time_ns() + round(ahead * 1e9))
        message.accel.linear.x = ax
        self._accel.publish(message)

    def _measure(self, second: int, msh: float = 0.001) -> None:
        message = FreeSurface(msh=msh)
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
    """Runs the test; returns 1 if a node grew, the replay differs or the cell ended."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/soak"))
    given = parser.parse_args()
    with own_domain() as domain:
        os.environ.update(node_environment(domain))
        return soak(60.0 * given.minutes, given.output)


def soak(seconds: float, output: Path) -> int:
    """Runs the cell under attack for a time [s], reports and returns the exit code."""
    robot = {"motion": "l", "repeat": "100", "fps": "15.0"}
    # Ten minutes are replayed in the end, on a machine with load.
    with long_cell(output, robot, 600.0, ["--watch", str(PORT)]) as cell:
        ended, memory, states, sent, apart = attack(cell.process, seconds)
    print(f"OK at most {1e3 * apart:.1f} mm apart")
    return report(output, ended, cell.code, memory, states, sent)


def attack(
    cell: subprocess.Popen[bytes], seconds: float
) -> tuple[bool, dict[str, list[float]], Counter[int], Counter[str], float]:
    """Attacks the cell for a time [s]; returns memory, states and the attacks made.

    Returns:
        whether the cell ended; memory by node [MB]; states; attacks; how far the sides were apart
        at most where the state was OK [m].
    """
    rclpy.init()
    node = rclpy.create_node("stranger", namespace="/slosh")
    states: Counter[int] = Counter()
    apart = 0.0

    def compare(message: SloshComparison) -> None:
        nonlocal apart
        states.update([message.state])
        if message.state == SloshComparison.STATE_OK and math.isfinite(message.residual_nonlinear):
            apart = max(apart, abs(message.residual_nonlinear))

    node.create_subscription(SloshComparison, topics.COMPARISON, compare, qos.STREAM_IN)
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
            sent[visit(next(order), nodes_of(cell.pid))] += 1
    ended = cell.poll() is not None
    node.destroy_node()
    rclpy.shutdown()
    return ended, memory, states, sent, apart


def visit(number: int, nodes: Mapping[str, int]) -> str:
    """Sends one kind of attack from a short-lived node; returns the attack's name.

    Two publishers for longer than seconds would make the monitor blind, as they should.
    """
    node = rclpy.create_node("stranger_once", namespace="/slosh")
    stranger = Stranger(node, nodes.get("recorder"))
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
    """Prints attacks, memory and the replay's result; returns the exit code."""
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
    exact, lines = replayed(bag)
    for line in lines:
        print(line)
    facts = BagReader(bag).metadata()
    lost = int(facts.get("messages_lost", "0"))
    missing = missing_estimates(bag)
    print(f"messages lost {lost}, of which estimates at least {missing} by their own numbers")
    print(f"the cell ended by itself: {ended}; exit code {code}")
    # The stranger's samples are mixed with the cell's, which the cell tells in the end, too.
    wrong = lost > 0 or bool(mixed_topics(facts))
    return int(ended or grown or not exact or missing > lost or code != int(wrong))


def replayed(bag: Path) -> tuple[bool, tuple[str, ...]]:
    """Replays a bag; returns whether it was reproduced, and lines about differences."""
    try:
        run = RecordedRun(bag)
        verification = checked_by_journal(replay_bag(run), run).verification
    except SloshBagError as error:
        return False, (f"not replayed: {error}",)
    if verification is None:
        return False, ("no estimates",)
    return verification.exact, tuple(verification.lines())


def missing_estimates(bag: Path) -> int:
    """Returns the number of published estimates that the bag lacks, by their counters."""
    reader = BagReader(bag)
    topic = f"/slosh/{topics.ESTIMATE}"
    used = np.concatenate([
        reader.columns(block, ["samples_used"])["samples_used"].astype(np.int64)
        for block in reader.blocks([topic])
    ])  # fmt: skip
    steps = np.diff(used)
    return int((steps[steps > 1] - 1).sum())


if __name__ == "__main__":
    sys.exit(main())
