"""Measures the processor time that comparing a second motion source adds to the estimator.

Two nodes receive AccelStamped at 1 kHz; poses of the same motion come at 125 Hz beside it. One has
`second_source: auto`, which takes the poses, the other `none`. They sit in the same executor and
take turns, as in bench_estimator_node.py. The ratio is that of the medians over the turns.

    tools/run python benchmarks/bench_second_source.py [--seconds 5] [--turns 5]
"""

from __future__ import annotations

import gc
import math
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import rclpy
from bench_estimator_node import MODEL, RATE, Meter, measure, run
from geometry_msgs.msg import AccelStamped, PoseStamped

from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_msgs_py import qos, topics
from slosh_testing.hearing_robot import Graph

GOAL = 1.3
ALONE, COMPARED = "/alone", "/compared"
POSE_EVERY = 8
REACH, SPEED = 0.2, 2.0 * math.pi
"""Way [m] and angular frequency [rad/s] of a motion of a second; then it rests for one."""


def send(namespace: str, count: int) -> None:
    """Publishes accelerations and poses of motions that each end with a judgement."""
    rclpy.init()
    node = rclpy.create_node("sender", namespace=namespace)
    accels = node.create_publisher(AccelStamped, topics.ACCEL, qos.STREAM_OUT)
    poses = node.create_publisher(PoseStamped, topics.POSE, qos.STREAM_OUT)
    while accels.get_subscription_count() == 0:
        time.sleep(0.01)
    accel, pose = AccelStamped(), PoseStamped()
    accel.header.frame_id = pose.header.frame_id = "world"
    begin = time.monotonic()
    for k in range(count):
        time.sleep(max(0.0, begin + k / RATE - time.monotonic()))
        accel.header.stamp = pose.header.stamp = node.get_clock().now().to_msg()
        angle = SPEED * min(k / RATE % 2.0, 1.0)
        # Position and acceleration of (1 - cos)², which begins and ends without a jump.
        place = 0.25 * REACH * (1.0 - math.cos(angle)) ** 2
        change = math.cos(angle) - math.cos(2.0 * angle)
        accel.accel.linear.x = 0.5 * REACH * SPEED * SPEED * change
        accels.publish(accel)
        if k % POSE_EVERY == 0:
            pose.pose.position.x = place
            poses.publish(pose)
    time.sleep(0.3)  # what is still on its way goes with the process
    rclpy.shutdown()


def compare(seconds: float, turns: int) -> dict[str, Any]:
    """Measures both nodes in turns; the first turn is not counted."""
    rclpy.init()
    graph = Graph()
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "model.yaml"
        model.write_text(MODEL, encoding="utf-8")
        nodes: dict[str, Any] = {
            name: graph.with_parameters(
                EstimatorNode, name, model=str(model), observer=False, second_source=wanted
            )
            for name, wanted in ((ALONE, "none"), (COMPARED, "auto"))
        }
    meters = {name: Meter(node) for name, node in nodes.items()}
    gc.collect()
    gc.freeze()
    costs: dict[str, list[float]] = {name: [] for name in meters}
    for turn in range(turns + 1):
        for name, meter in meters.items():
            cost, _ = measure(graph.executor, meter, name, seconds, __file__)
            if turn:
                costs[name].append(1e6 * cost)
    told = nodes[COMPARED]._second.facts()
    alone, compared = (statistics.median(costs[name]) for name in (ALONE, COMPARED))
    graph.close()
    rclpy.try_shutdown()
    return {
        "alone_us": round(alone, 1), "compared_us": round(compared, 1),
        "ratio": round(compared / alone, 3), "second_source": told, "goal": GOAL,
    }  # fmt: skip


def main() -> int:
    """Compares the estimator node with and without a second source."""
    return run(
        (__doc__ or "").splitlines()[0], compare, lambda found: found["ratio"] <= GOAL, send
    )


if __name__ == "__main__":
    sys.exit(main())
