"""Compares `map_files` with a process pool and one process: speed and memory.

Each item is a fixed amount of computing. The engine, a `multiprocessing.Pool` and a single process
take turns over the same items; the limit is the single process's time divided by the cores. Then
two runs of their own, one with twenty times the items of the other, tell their greatest memory.

    tools/run python benchmarks/bench_many_files.py [--items 200] [--work 0.05] [--turns 3]
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import psutil
from measuring import parsed

from slosh_bringup.many_files import map_files

GOAL_POOL = 1.25
"""Time per item of 50 ms, against the pool's, without the start of either."""
GOAL_MEMORY = 1.1
"""Greatest memory with twenty times the items, against once."""
TIMES = 20
MEMORY_ITEMS = 100
SAMPLE_PERIOD = 0.05


def work(rounds: int) -> dict[str, float]:
    """Computes for a fixed number of rounds; returns a few numbers, as a file's result."""
    total = 0.0
    for k in range(rounds):
        total += k % 7 * 1e-3
    return {"sigma": total, "epsilon": -total}


def rounds_for(seconds: float) -> int:
    """Returns how many rounds of computing take a given time [s] on this machine."""
    probe = 200_000
    taken = []
    for _ in range(20):
        begin = time.perf_counter()
        work(probe)
        taken.append(time.perf_counter() - begin)
    return max(1, round(probe * seconds / min(taken)))


def take(outcomes: Iterator[Any], count: int) -> float:
    """Consumes outcomes; returns the time per item [s] without the first, which starts up."""
    next(outcomes)
    begin = time.perf_counter()
    taken = sum(1 for _ in outcomes)
    if taken != count - 1:
        raise SystemExit(f"{taken} of {count - 1} items came back")
    return (time.perf_counter() - begin) / taken


def compare(count: int, seconds: float, turns: int) -> dict[str, Any]:
    """Returns items per second of each method, as medians over several turns."""
    cores = len(os.sched_getaffinity(0))
    rounds = [rounds_for(seconds)] * count

    def pool() -> float:
        with multiprocessing.get_context("spawn").Pool(cores) as processes:
            return take(processes.imap_unordered(work, rounds), count)

    ways: dict[str, Callable[[], float]] = {
        "single": lambda: take(map(work, rounds), count),
        "pool": pool,
        "engine": lambda: take(map_files(work, rounds, jobs=max(2, cores)), count),
    }
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(turns):
        for name, way in ways.items():
            spent[name].append(way())
    best = {name: statistics.median(values) for name, values in spent.items()}
    return {
        "items": count,
        "cores": cores,
        "single_ms": round(1e3 * best["single"], 2),
        "pool_ms": round(1e3 * best["pool"], 2),
        "engine_ms": round(1e3 * best["engine"], 2),
        "engine_to_pool": round(best["engine"] / best["pool"], 3),
        "pool_share_of_limit": round(best["single"] / cores / best["pool"], 3),
        "engine_share_of_limit": round(best["single"] / cores / best["engine"], 3),
    }


def start_seconds() -> float:
    """Returns the time from calling `map_files` to its first outcome [s]."""
    begin = time.perf_counter()
    next(map_files(work, [1] * 4, jobs=2))
    return time.perf_counter() - begin


class MemoryWatch(threading.Thread):
    """Thread that samples the peak memory of this process and its largest child [MiB]."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.client = self.worker = 0.0
        self._end = threading.Event()

    def run(self) -> None:
        """Samples the memory until `finish` is called."""
        us = psutil.Process()
        while not self._end.wait(SAMPLE_PERIOD):
            self.client = max(self.client, us.memory_info().rss / 2**20)
            for child in us.children(recursive=True):
                try:
                    self.worker = max(self.worker, child.memory_info().rss / 2**20)
                except psutil.Error:
                    continue

    def finish(self) -> None:
        """Stops the sampling and waits for the thread's end."""
        self._end.set()
        self.join()


def memory(count: int) -> dict[str, float]:
    """Returns the peak memory [MiB] of a run over a number of items that each use some MiB."""
    watch = MemoryWatch()
    watch.start()
    for _ in map_files(allocate, range(count), jobs=2):
        pass
    watch.finish()
    return {"client": round(watch.client, 1), "worker": round(watch.worker, 1)}


def allocate(number: int) -> dict[str, float]:
    """Uses a few MiB of memory, as reading a file does, and returns one number."""
    return {"sum": float(np.full(500_000, number, dtype=float).sum())}


def grown() -> dict[str, Any]:
    """Compares the peak memory of runs with one and with twenty times the items."""
    runs = [
        json.loads(
            subprocess.run(
                [sys.executable, __file__, "--memory", str(count)],
                check=True,
                capture_output=True,
                text=True,
            ).stdout
        )
        for count in (MEMORY_ITEMS, TIMES * MEMORY_ITEMS)
    ]
    ratios = {name: round(runs[1][name] / runs[0][name], 3) for name in runs[0]}
    return {"memory_1x_mib": runs[0], f"memory_{TIMES}x_mib": runs[1], "memory_ratio": ratios}


def main() -> int:
    """Prints the result as JSON; returns 1 if a required speed or memory is not reached."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--items", type=int, default=200)
    parser.add_argument("--work", type=float, default=0.05, help="computing per item [s]")
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--memory", type=int, default=0, help=argparse.SUPPRESS)
    given = parsed(parser, items=2, work=0.01, turns=1)
    if given.memory:
        print(json.dumps(memory(given.memory)))
        return 0
    result = compare(given.items, given.work, given.turns)
    result |= {"start_s": round(start_seconds(), 2), **grown()}
    result |= {"goal_pool": GOAL_POOL, "goal_memory": GOAL_MEMORY}
    print(json.dumps(result))
    met = result["engine_to_pool"] <= GOAL_POOL
    return 0 if met and max(result["memory_ratio"].values()) <= GOAL_MEMORY else 1


if __name__ == "__main__":
    sys.exit(main())
