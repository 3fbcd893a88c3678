"""Measures the scan of time scales, and the round trip of the predictor's service.

    tools/run python benchmarks/bench_predict.py [--rounds 7]

The scan of 1,000 scales of a 5 s motion at 1 kHz is timed beside a loop of single simulations of
the same scales, in turns. The round trip of `predict` with that motion is timed beside an empty
call of the same size: a request with the same arrays, which is refused at once. The claims are the
ratios and, for the scan, half a second: each is the median over the rounds.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import rclpy
from measuring import parsed, timed
from rclpy.node import Node

from slosh_model import Cylinder, Model, format_model, simulate
from slosh_model.motion_profiles import quintic
from slosh_msgs.srv import PredictSlosh
from slosh_msgs_py import topics
from slosh_msgs_py.node.domain import own_domain
from slosh_plan import HeightLimits, Trajectory, safe_scales
from slosh_plan.heights import usual_horizon

SECONDS, RATE, STROKE = 5.0, 1000.0, 4.0
LIMITS = HeightLimits(0.015, 0.002)
SCALES = 1000
GOAL = 0.5
EVERY = 20
"""Of the loop one simulation in so many is run, and counted so often."""
MODEL = Model(Cylinder(0.05, 0.07)).with_effect("vertical_acceleration").nonlinear()


def motion() -> Trajectory:
    """Returns a straight rest-to-rest motion of 4 m."""
    t = np.linspace(0.0, SECONDS, round(SECONDS * RATE) + 1)
    _, _, acceleration = quintic(t / SECONDS)
    return Trajectory(t, np.outer(acceleration, [STROKE / SECONDS**2, 0.0, 0.0]))


def scan_beside_loop(rounds: int) -> tuple[float, float]:
    """Returns the median times of the scan and of a loop of single simulations [s]."""
    one, horizon = motion(), usual_horizon(MODEL)
    found = safe_scales(MODEL, one, LIMITS)  # compiled, and warm
    print(f"safe from {found.safe_from:.4f}, islands {found.islands}")
    scales = np.geomspace(found.fastest, found.slowest, SCALES)[::EVERY]

    def loop() -> None:
        for scale in scales:
            response, _ = simulate(MODEL, one.scaled(float(scale)).inputs(horizon))
            response.msh.max()

    scans, loops = [], []
    for _ in range(rounds):
        scans.append(timed(lambda: safe_scales(MODEL, one, LIMITS)))
        loops.append(EVERY * timed(loop))
    return statistics.median(scans), statistics.median(loops)


def request(*, empty: bool = False, scales: bool = False) -> PredictSlosh.Request:
    """Creates a prediction request; with `empty`, one of equal size that is refused at once."""
    one = motion()
    made = PredictSlosh.Request(limit=0.015, residual_limit=0.002, no_time_scales=not scales)
    made.time = one.t.tolist()
    made.acceleration_x, made.acceleration_y, made.acceleration_z = one.acceleration.T.tolist()
    if empty:
        made.model_path = "/nowhere"
    return made


def round_trips(rounds: int) -> dict[str, float]:
    """Returns the median time of each kind of service call [s]."""
    with tempfile.TemporaryDirectory() as folder, own_domain() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        model = Path(folder) / "model.yaml"
        model.write_text(format_model(MODEL))
        words = [
            "-m",
            "slosh_plan.nodes.predictor_node",
            "--ros-args",
            "-p",
            f"model:={model}",
        ]
        with subprocess.Popen([sys.executable, *words], stderr=subprocess.DEVNULL) as process:
            rclpy.init()
            asking = Node("asking")
            client = asking.create_client(PredictSlosh, topics.PREDICT)
            try:
                if not client.wait_for_service(60.0):
                    raise SystemExit("the predictor did not start")
                kinds = {
                    "empty": request(empty=True),
                    "peak": request(),
                    "peak and scales": request(scales=True),
                }
                times: dict[str, list[float]] = {name: [] for name in kinds}
                for number in range(rounds + 1):
                    for name, one in kinds.items():
                        seconds = timed(partial(call, asking, client, one))
                        times[name] += [seconds] if number else []
            finally:
                asking.destroy_node()
                rclpy.try_shutdown()
                process.terminate()
    return {name: statistics.median(values) for name, values in times.items()}


def call(node: Node, client: object, one: PredictSlosh.Request) -> None:
    """Calls the prediction service and waits for its response."""
    future = client.call_async(one)  # type: ignore[attr-defined]
    rclpy.spin_until_future_complete(node, future, timeout_sec=30.0)
    if future.result() is None:
        raise SystemExit("no answer")


def main() -> int:
    """Measures and prints the times; returns 1 if the scan misses its goal."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parsed(parser, rounds=1).rounds
    scan, loop = scan_beside_loop(rounds)
    print(f"scan of {SCALES} scales of a {SECONDS:g} s motion: {scan:.3f} s (goal {GOAL:g} s)")
    print(f"loop of single simulations: {loop:.2f} s, {loop / scan:.1f} times as long")
    trips = round_trips(rounds)
    for name, seconds in trips.items():
        ratio = seconds / trips["empty"]
        print(f"predict, {name}: {1e3 * seconds:.1f} ms, {ratio:.2f} of an empty call of its size")
    return 0 if scan <= GOAL and math.isfinite(trips["peak"]) else 1


if __name__ == "__main__":
    sys.exit(main())
