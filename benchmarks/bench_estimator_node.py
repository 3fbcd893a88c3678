"""Measures the estimator node's processor time per message, against a pass-through node.

Both receive AccelStamped at 1 kHz, from a process of its own, and publish SloshEstimate; a third,
the estimator with its observer, receives FreeSurface at 60 Hz, too. They sit in the same executor
and take turns, several times, so that a busy machine disturbs all alike. The ratios are those of
the medians over the turns.

    tools/run python benchmarks/bench_estimator_node.py [--seconds 5] [--turns 5]
"""

from __future__ import annotations

import argparse
import gc
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import AccelStamped
from measuring import parsed
from rclpy.node import Node

from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_msgs.msg import FreeSurface, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_testing.hearing_robot import Graph

RATE = 1000
GOAL, OBSERVER_GOAL = 1.3, 1.5
WARM_UP = 300
PATIENCE = 30.0
PLAIN, FULL, OBSERVING = "/plain", "/full", "/observing"
IMAGE_EVERY = 17
MODEL = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07, rim_height: 0.1}\n\
effects: [{name: vertical_acceleration}]\n"


class PassThrough(Node):
    """The simplest node that receives accelerations and publishes estimates."""

    def __init__(self) -> None:
        super().__init__("pass_through", namespace=PLAIN)
        self._message = SloshEstimate()
        for answer in (self._message.linear, self._message.nonlinear):
            answer.model = "3D-L"
            answer.modal_position = answer.modal_velocity = [0.0, 0.0]
        self._publisher = self.create_publisher(SloshEstimate, topics.ESTIMATE, qos.STREAM_OUT)
        self.create_subscription(AccelStamped, topics.ACCEL, self._on_accel, qos.STREAM_IN)

    def _on_accel(self, message: AccelStamped) -> None:
        self._message.header.stamp = message.header.stamp
        self._publisher.publish(self._message)


def send(namespace: str, count: int) -> None:
    """Publishes accelerations at a fixed rate on an absolute schedule."""
    rclpy.init()
    node = Node("sender", namespace=namespace)
    publisher = node.create_publisher(AccelStamped, topics.ACCEL, qos.STREAM_OUT)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.01)
    message = AccelStamped()
    message.header.frame_id = "world"
    surface = FreeSurface(msh_stddev=1e-4, azimuth_right=1.0, slope_angle=float("nan"))
    surfaces = None
    if namespace == OBSERVING:
        surfaces = node.create_publisher(FreeSurface, topics.FREE_SURFACE, qos.STREAM_OUT)
    begin = time.monotonic()
    for k in range(count):
        time.sleep(max(0.0, begin + k / RATE - time.monotonic()))
        now = node.get_clock().now().to_msg()
        message.header.stamp = now
        message.accel.linear.x = 3.0 if k % 400 < 200 else -3.0
        publisher.publish(message)
        if surfaces is not None and k % IMAGE_EVERY == 0:
            surface.header.stamp = now
            surfaces.publish(surface)
    # What is still on its way goes with the process.
    time.sleep(0.3)
    rclpy.shutdown()


class Meter:
    """Counts the messages that a node publishes, by wrapping its publisher."""

    def __init__(self, node: Any) -> None:
        self.count = 0
        publisher = node._publisher
        publish = publisher.publish

        def counted(message: Any) -> None:
            self.count += 1
            publish(message)

        publisher.publish = counted


def measure(
    executor: Any, meter: Meter, namespace: str, seconds: float, script: str = __file__
) -> tuple[float, float]:
    """Returns the processor time per answered message [s], and the share answered.

    `script` is the benchmark that sends; see `run`.
    """
    total = round(seconds * RATE) + WARM_UP
    sender = subprocess.Popen([sys.executable, script, "--send", namespace, "--count", str(total)])
    first = meter.count + WARM_UP
    deadline = time.monotonic() + PATIENCE
    while meter.count < first and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.1)
    begin, at = time.process_time(), meter.count
    while sender.poll() is None and meter.count - at < total - WARM_UP:
        executor.spin_once(timeout_sec=0.1)
    spent, answered = time.process_time() - begin, meter.count - at
    sender.wait(PATIENCE)
    if not answered:
        raise SystemExit(f"{namespace}: no message was answered")
    return spent / answered, answered / (total - WARM_UP)


def compare(seconds: float, turns: int) -> dict[str, Any]:
    """Measures pass-through and estimator nodes in turns; returns times and ratios."""
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "model.yaml"
        model.write_text(MODEL, encoding="utf-8")
        rclpy.init()
        graph = Graph("bench")
        nodes: dict[str, Any] = {PLAIN: graph.add(PassThrough())}
        for name, observer in ((FULL, False), (OBSERVING, True)):
            nodes[name] = graph.with_parameters(
                EstimatorNode, name, model=str(model), observer=observer
            )
    executor = graph.executor
    meters = {name: Meter(node) for name, node in nodes.items()}
    gc.collect()
    gc.freeze()
    costs: dict[str, list[float]] = {name: [] for name in nodes}
    shares: dict[str, list[float]] = {name: [] for name in nodes}
    for _ in range(turns):
        for name in nodes:
            cost, share = measure(executor, meters[name], name, seconds)
            costs[name].append(1e6 * cost)
            shares[name].append(share)
    plain, full, observing = (statistics.median(costs[name]) for name in nodes)
    ratios = [b / a for a, b in zip(costs[PLAIN], costs[FULL], strict=True)]
    rclpy.try_shutdown()
    return {
        "executor": type(executor).__name__,
        "pass_through_us": round(plain, 1),
        "estimator_us": round(full, 1),
        "ratio": round(full / plain, 3),
        "ratio_least": round(min(ratios), 3),
        "ratio_greatest": round(max(ratios), 3),
        "observing_us": round(observing, 1),
        "observer_ratio": round(observing / full, 3),
        "answered": round(min(share for found in shares.values() for share in found), 4),
        "goals": (GOAL, OBSERVER_GOAL),
    }


def run(
    description: str,
    compare: Callable[[float, int], dict[str, Any]],
    kept: Callable[[dict[str, Any]], bool],
    send: Callable[[str, int], None],
) -> int:
    """Prints the result of a comparison as JSON; returns 1 if its goals are not kept.

    Args:
        description: of the benchmark.
        compare: makes the result from the seconds of a turn and the number of turns.
        kept: whether a result keeps the goals.
        send: publishes a number of inputs in a namespace; the process that `measure` starts.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--seconds", type=float, default=5.0, help="duration of a turn [s]")
    parser.add_argument("--turns", type=int, default=5, help="number of turns")
    parser.add_argument("--send", metavar="NAMESPACE", help=argparse.SUPPRESS)
    parser.add_argument("--count", type=int, default=0, help=argparse.SUPPRESS)
    given = parsed(parser, seconds=0.2, turns=1)
    if given.send:
        send(given.send, given.count)
        return 0
    result = compare(given.seconds, given.turns)
    print(json.dumps(result))
    return int(not kept(result))


def main() -> int:
    """Compares the estimator node with the simplest node."""
    return run(
        (__doc__ or "").splitlines()[0], compare,
        lambda found: found["ratio"] <= GOAL and found["observer_ratio"] <= OBSERVER_GOAL, send,
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
