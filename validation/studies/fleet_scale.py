"""Measures ingest, replay and discovery of many bags on a Dask cluster.

The bags are generated: the messages of shipped recordings with their stamps moved in time.
One and two workers take turns; more are simulated with the measured cost of a task.

    tools/run python validation/studies/fleet_scale.py [-o out/fleet] [--bags 1000] [--docs]
"""

from __future__ import annotations

import argparse
import heapq
import os
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import with_tools  # noqa: F401
from distributed import Client, LocalCluster
from fleet_bags import (
    discover_one,
    ingest_one,
    make_bag,
    nothing,
    processor_time,
    replay_one,
    resident,
)
from result_tables import fill

from slosh_bringup.cli.progress import say
from slosh_bringup.many_files import IN_FLIGHT, map_files
from slosh_bringup.task_batches import Batches

ROOT: Final = Path(__file__).resolve().parents[2]
PAGE: Final = ROOT / "docs" / "robot.md"
SIMULATED: Final = (1, 2, 4, 8, 16, 32, 64)
SIMULATED_BAGS: Final = 200
"""Bags for each of the most simulated workers."""


class Run(NamedTuple):
    """Times and sizes of one run over all bags.

    Attributes:
        seconds: from the first task to the last outcome, without the start of the workers.
        processor: processor time of scheduler, client and workers meanwhile [s].
        first_memory, last_memory: largest of a worker after a tenth of the bags, and after all
            [MiB].
    """

    seconds: float
    processor: float
    first_memory: float
    last_memory: float


@contextmanager
def cluster(workers: int) -> Iterator[Client]:
    """Starts local worker processes with one computing thread each, as on a cluster."""
    os.environ["NUMBA_NUM_THREADS"] = "1"
    with (
        LocalCluster(
            n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
        ) as local,
        Client(local) as client,
    ):
        yield client


def run_all(
    work: Callable[[Any], float], items: Sequence[Any], client: Client, apart: bool = False
) -> Run:
    """Processes all items on a Dask cluster and measures the run.

    Args:
        work: of one item.
        items: paths of bags, or numbers.
        client: of the cluster.
        apart: whether each item is a task; otherwise several are where they are short.

    Raises:
        RuntimeError: an item failed.
    """
    memory: list[float] = []
    spent = -_processor(client)
    begin = time.perf_counter()
    outcomes = map_files(
        work, items, scheduler=client.scheduler.address,
        sizes=None if apart else [1.0] * len(items),
    )  # fmt: skip
    for taken, outcome in enumerate(outcomes, 1):
        if outcome.value is None:
            raise RuntimeError(f"{outcome.item}: {outcome.error}")
        if taken in (-(-len(items) // 10), len(items)):
            memory.append(max(client.run(resident).values()))
    seconds = time.perf_counter() - begin
    return Run(seconds, spent + _processor(client), memory[0], memory[-1])


def _processor(client: Client) -> float:
    return time.process_time() + float(sum(client.run(processor_time).values()))


def task_cost(count: int) -> float:
    """Returns the processor time that scheduler and client need for a task [s].

    Both run in this process, and the workers have nothing to do: its processor time is the cost.
    """
    with cluster(2) as client:
        run_all(nothing, range(20), client, apart=True)
        begin = time.process_time()
        run_all(nothing, range(count), client, apart=True)
        return (time.process_time() - begin) / count


def simulated(durations: Sequence[float], workers: int, cost: float, apart: bool = False) -> float:
    """Simulates the speed of a number of workers, as a fraction of linear scaling.

    Scheduler and client serve one task at a time. A worker has IN_FLIGHT tasks, so that it goes on
    while it waits for the next one.

    Args:
        durations: of the items [s].
        workers: their number.
        cost: time of scheduler and client for a task [s].
        apart: whether each item is a task.
    """
    server = 0.0
    free = [0.0] * workers  # when each worker has done all that it has
    given: list[list[float]] = [[] for _ in range(workers)]  # ends of its tasks
    under_way: list[tuple[float, list[tuple[int, float]]]] = []
    batches = Batches(durations, None if apart else [1.0] * len(durations))
    while True:
        # The worker whose oldest task ends first has room first.
        number = min(
            range(workers),
            key=lambda one: given[one][-IN_FLIGHT] if len(given[one]) >= IN_FLIGHT else 0.0,
        )
        own = given[number]
        ready = own[-IN_FLIGHT] if len(own) >= IN_FLIGHT else 0.0
        server = max(server, ready) + cost
        while under_way and under_way[0][0] <= server:
            _, batch = heapq.heappop(under_way)
            batches.learn(batch, sum(duration for _, duration in batch))
        batch = batches.take(workers)
        if not batch:
            return sum(durations) / (workers * max(free))
        free[number] = max(free[number], server) + sum(duration for _, duration in batch)
        own.append(free[number])
        heapq.heappush(under_way, (free[number], batch))


def measured(
    name: str,
    make: Callable[[], Callable[[Any], float]],
    bags: Sequence[Path],
    turns: int,
    apart: bool = False,
    first: int = 4,
) -> list[str]:
    """Returns table rows of runs that use one worker and two workers alternately.

    Args:
        name: of the work.
        make: returns the work on a bag, for each run anew.
        bags: all bags.
        turns: runs of which the median is taken.
        apart: whether each bag is a task.
        first: bags for each worker that are not counted: they load what later ones find loaded.
    """
    runs: dict[int, list[Run]] = {1: [], 2: []}
    rest = bags[first * max(runs) :]
    for _ in range(turns):
        for workers, own in runs.items():
            work = make()
            with cluster(workers) as client:
                run_all(work, bags[: first * workers], client, apart=True)
                own.append(run_all(work, rest, client, apart))
            say(f"{name}, {workers} workers: {own[-1]}, load {os.getloadavg()[0]:.1f}")
    middle = {n: statistics.median(run.seconds for run in own) for n, own in runs.items()}
    own_time = {
        n: 1e3 * statistics.median(run.processor for run in own) / len(rest)
        for n, own in runs.items()
    }
    rows = []
    for workers, own in runs.items():
        share = middle[1] / (workers * middle[workers])
        speed = len(rest) / middle[workers]
        first_memory, last_memory = (
            max(getattr(run, f) for run in own) for f in ("first_memory", "last_memory")
        )
        rows.append(
            f"| {name} | {len(bags)} | {workers} | {middle[workers]:.1f} | {speed:.3g} "
            f"| {share:.2f} | {own_time[workers]:.0f} | {own_time[1] / own_time[workers]:.2f} "
            f"| {first_memory:.0f} | {last_memory:.0f} |"
        )
    return rows


def main() -> int:
    """Runs the study; prints its tables or writes them to files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "out" / "fleet")
    parser.add_argument("--bags", type=int, default=1000)
    parser.add_argument("--replays", type=int, default=60, help="bags that are replayed, too")
    parser.add_argument("--discoveries", type=int, default=26, help="bags that are examined, too")
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--docs", action="store_true", help="write the tables in docs/")
    given = parser.parse_args()
    folder = given.output / "bags"
    bags = []
    for outcome in map_files(partial(make_bag, folder=folder), range(given.bags)):
        if outcome.value is None:
            raise SystemExit(f"bag {outcome.index}: {outcome.error}")
        bags.append(outcome.value)
    bags.sort()
    size = sum(file.stat().st_size for file in folder.rglob("*.mcap"))
    say(f"{len(bags)} bags, {1e-9 * size:.2f} GB, load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory(dir=given.output) as stores:

        def ingesting() -> Callable[[Any], float]:
            return partial(ingest_one, tempfile.mkdtemp(dir=stores))

        def discovering() -> Callable[[Any], float]:
            return partial(discover_one, tempfile.mkdtemp(dir=stores))

        rows = measured("ingest", ingesting, bags, given.turns)
        shutil.rmtree(stores)
        Path(stores).mkdir()
        rows += measured("replay", lambda: replay_one, bags[: given.replays], 1)
        examined = bags[: given.discoveries]
        rows += measured("discover", discovering, examined, 1, first=1)
        durations = [ingest_one(f"{stores}/own", bag) for bag in bags[:60]]
    cost = task_cost(2 * given.bags)
    middle = 1e3 * statistics.median(durations)
    say(f"a task costs {1e3 * cost:.2f} ms; ingest of a bag {middle:.0f} ms")
    rng = np.random.default_rng(1)
    drawn = rng.choice(durations, max(SIMULATED) * SIMULATED_BAGS).tolist()
    kinds = (("ingest, one bag a task", drawn, True), ("ingest", drawn, False))
    table = [
        "| work | bags | workers | time [s] | bags/s | of linear "
        "| processor [ms/bag] | its share of linear | MiB after 10 % | MiB |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|", *rows,
    ]  # fmt: skip
    wide = [
        f"| workers, simulated ({1e3 * cost:.1f} ms a task, {middle:.0f} ms a bag) | "
        + " | ".join(map(str, SIMULATED)) + " |",
        "|---|" + "--:|" * len(SIMULATED),
        *(
            f"| {name} | "
            + " | ".join(f"{simulated(every, n, cost, apart):.2f}" for n in SIMULATED) + " |"
            for name, every, apart in kinds
        ),
    ]  # fmt: skip
    print("\n".join([*table, "", *wide]))
    if given.docs:
        fill(PAGE, "fleet", "\n".join([*table, "", *wide]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
