"""Compares the estimator node's processor time for a tray of four cups and for one cup.

Both receive AccelStamped at 1 kHz and answer each; they sit in the same executor and take turns,
as in bench_estimator_node.py. The ratio is that of the medians over the turns.

    tools/run python benchmarks/bench_tray.py [--seconds 5] [--turns 5]
"""

from __future__ import annotations

import gc
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

import rclpy
from bench_estimator_node import MODEL, Meter, measure, run, send

from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_testing.hearing_robot import Graph

GOAL = 1.2
ONE, FOUR = "/one", "/four"
PLACES = ((0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1))


def compare(seconds: float, turns: int) -> dict[str, Any]:
    """Measures the nodes for one cup and for four cups in turns."""
    rclpy.init()
    graph = Graph()
    with tempfile.TemporaryDirectory() as folder:
        cup, tray = Path(folder) / "cup.yaml", Path(folder) / "tray.yaml"
        cup.write_text(MODEL, encoding="utf-8")
        entries = [
            f"- {{name: cup_{k}, model: cup.yaml, place: [{x}, {y}, 0.0]}}\n"
            for k, (x, y) in enumerate(PLACES)
        ]
        tray.write_text("containers:\n" + "".join(entries), encoding="utf-8")
        meters = {
            name: Meter(graph.with_parameters(EstimatorNode, name, model=str(path)))
            for name, path in ((ONE, cup), (FOUR, tray))
        }
    gc.collect()
    gc.freeze()
    costs: dict[str, list[float]] = {name: [] for name in meters}
    answered = 1.0
    for _ in range(turns):
        for name, meter in meters.items():
            cost, share = measure(graph.executor, meter, name, seconds)
            costs[name].append(1e6 * cost)
            answered = min(answered, share)
    one, four = (statistics.median(costs[name]) for name in (ONE, FOUR))
    graph.close()
    rclpy.try_shutdown()
    return {
        "one_us": round(one, 1),
        "four_us": round(four, 1),
        "ratio": round(four / one, 3),
        "answered": round(answered, 4),
        "goal": GOAL,
    }


def main() -> int:
    """Compares the estimator node for one cup and for a tray of four."""
    return run(
        (__doc__ or "").splitlines()[0], compare, lambda found: found["ratio"] <= GOAL, send
    )


if __name__ == "__main__":
    sys.exit(main())
