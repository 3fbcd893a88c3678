"""Half an hour of a cell whose nodes are killed in turn, with viewers at its page: what is lost?

    tools/run python -m tests.endurance [--minutes 30] [--viewers 2] [-o out/endurance]

The simulated robot sends accelerations at 1 kHz and images at 60 per second. Each minute one node
is killed, and started again by the cell. In the end: gaps in what was recorded, and whether the
kills explain them; how each node's memory went; whether each bag replays bit for bit.
"""

from __future__ import annotations

import argparse
import itertools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_bag.replay import replay_bag
from slosh_bringup.processes import node_environment
from slosh_files.nanoseconds import SECOND
from slosh_msgs_py.node.domain import own_domain
from tests.live_processes import nodes_of
from tests.long_cell import long_cell, sizes

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "benchmarks"))

from bench_watch import Viewer

PORT = 8799
EVERY = 60.0
"""A node is killed so often [s]."""
SAMPLED = 5.0
"""Memory is looked at so often [s]."""
MOTION = 3.9
"""The robot's motion lasts a little longer [s]; how often it is repeated is said beforehand."""
PATIENCE = 3600.0
"""All of it is replayed in the end [s]."""
WARM = 60.0
"""A process fills its buffers and reads code for so long [s]: no slope is taken from it."""
TURNS = ("camera", "estimator", "monitor", "watch", "recorder")
RATES = {"accel": 1000.0, "estimate": 1000.0, "free_surface": 60.0, "comparison": 60.0}
"""Of the recorded streams [1/s]."""
NEEDED = {
    "accel": {"recorder"},
    "estimate": {"recorder", "estimator"},
    "free_surface": {"recorder", "camera"},
    "comparison": {"recorder", "camera", "monitor"},
}
"""The nodes without which a stream is not recorded."""
SLACK = 1.0
"""Between the last message that is kept and the kill [s]: the recorder's buffer, a late frame."""

Integers = NDArray[np.int64]


@dataclass(slots=True)
class Observed:
    """What was seen while the cell ran.

    Attributes:
        kills: moment [ns] and node.
        memory: by node and process id moments [s] and sizes [MB].
        frames: that each viewer got.
        ended: whether the cell ended by itself.
    """

    kills: list[tuple[int, str]] = field(default_factory=list)
    memory: dict[tuple[str, int], list[tuple[float, float]]] = field(default_factory=dict)
    frames: list[int] = field(default_factory=list)
    ended: bool = False


def main() -> int:
    """Runs it; 1 where messages were lost that no kill explains, or a bag replays otherwise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--viewers", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/endurance"))
    given = parser.parse_args()
    seconds = 60.0 * given.minutes
    repeat = str(round(seconds / MOTION) + 10)
    robot = {"motion": "l", "repeat": repeat, "rate": "1000.0", "fps": "60.0"}
    with own_domain() as domain:
        os.environ.update(node_environment(domain))
        with long_cell(given.output, robot, PATIENCE, ["--watch", str(PORT)]) as cell:
            seen = observe(cell.process, seconds, given.viewers)
    print(f"the cell ended by itself: {seen.ended}; exit code {cell.code} (1: nodes had ended)")
    bags = sorted((given.output / "latest").resolve().glob("bag*"), key=_number)
    lost = print_gaps(bags, seen.kills)
    print_memory(seen.memory)
    print(f"messages that each viewer got: {', '.join(map(str, seen.frames))}")
    otherwise = sum(not print_replay(bag) for bag in bags)
    return int(seen.ended or lost > 0 or otherwise > 0)


def observe(cell: subprocess.Popen[bytes], seconds: float, viewers: int) -> Observed:
    """Looks at memory and kills, for so long [s]; viewers come back as a browser's page does."""
    seen = Observed()
    begun = time.monotonic()
    looks, strikes = _moments(begun, SAMPLED), _moments(begun, EVERY)
    look, strike, turns = next(looks), next(strikes), itertools.cycle(TURNS)
    watching: list[Viewer] = []
    while time.monotonic() < begun + seconds and cell.poll() is None:
        time.sleep(0.1)
        watching = _kept(watching, viewers, seen)
        if time.monotonic() >= look:
            look = next(looks)
            for node, size in sizes(cell.pid).items():
                seen.memory.setdefault(node, []).append((time.monotonic() - begun, size))
        # Not in the last moments: what is killed comes back before the end.
        if strike <= time.monotonic() < begun + seconds - EVERY / 2:
            strike = next(strikes)
            name = next(turns)
            os.kill(nodes_of(cell.pid)[name], signal.SIGKILL)
            seen.kills.append((time.time_ns(), name))
    seen.ended = cell.poll() is not None
    seen.frames += [len(viewer.ages) for viewer in watching]
    for viewer in watching:
        viewer.close()
    return seen


def _moments(begun: float, every: float) -> Iterator[float]:
    return (begun + every * number for number in itertools.count(1))


def _kept(watching: list[Viewer], wanted: int, seen: Observed) -> list[Viewer]:
    """The viewers that are left, and new ones in the place of those whose page ended."""
    left = [viewer for viewer in watching if viewer.is_alive()]
    seen.frames += [len(viewer.ages) for viewer in watching if not viewer.is_alive()]
    while len(left) < wanted:
        try:
            left.append(Viewer())
        except OSError:
            break
        left[-1].start()
    return left


def print_gaps(bags: Sequence[Path], kills: Sequence[tuple[int, str]]) -> int:
    """Prints each stream's gaps; returns how many messages no kill explains."""
    lost = 0
    for stream, rate in RATES.items():
        stamps = np.unique(np.concatenate([stamps_of(bag, f"/slosh/{stream}") for bag in bags]))
        own = [moment for moment, name in kills if name in NEEDED[stream]]
        by_kill, other = gaps(stamps, rate, own)
        lost += other
        print(f"{stream:<13} {len(stamps)} recorded; missing after a kill {by_kill}, else {other}")
    return lost


def gaps(stamps: Integers, rate: float, kills: Sequence[int]) -> tuple[int, int]:
    """Messages that are missing between recorded ones: after a kill, and without one.

    Args:
        stamps: of the recorded messages, rising [ns].
        rate: of the stream [1/s].
        kills: moments at which a node was killed that the stream needs [ns].
    """
    steps = np.diff(stamps)
    explained = unexplained = 0
    for row in np.flatnonzero(steps > 1.5 * SECOND / rate):
        missing = round(float(steps[row]) / SECOND * rate) - 1
        start, end = stamps[row] - SLACK * SECOND, stamps[row + 1]
        if any(start <= kill <= end for kill in kills):
            explained += missing
        else:
            unexplained += missing
    return explained, unexplained


def stamps_of(bag: Path, topic: str) -> Integers:
    """The headers' stamps of a topic [ns]."""
    found = [np.empty(0, np.int64)]
    try:
        reader = BagReader(bag)
        for block in reader.blocks([topic]):
            columns = reader.columns(block, ["header.stamp.sec", "header.stamp.nanosec"])
            seconds, rest = (column.astype(np.int64) for column in columns.values())
            found.append(seconds * SECOND + rest)
    except SloshBagError as error:
        print(error)
    return np.concatenate(found)


def print_memory(memory: Mapping[tuple[str, int], Sequence[tuple[float, float]]]) -> None:
    """Prints each node's memory: at the end of its lives, and the slope within them."""
    for node in sorted({name for name, _ in memory}):
        lives = [np.array(rows) for (name, _), rows in memory.items() if name == node]
        settled = [rows[rows[:, 0] > rows[0, 0] + WARM] for rows in lives]
        centred = [rows - rows.mean(axis=0) for rows in settled if len(rows) > 2]
        if not centred:
            continue
        moments, size = np.concatenate(centred).T
        slope = 60.0 * float(moments @ size / (moments @ moments))
        last = max(rows[-1, 1] for rows in lives)
        print(f"{node:<10} {len(lives)} lives, at most {last:.0f} MB, {slope:+.2f} MB/min")


def print_replay(bag: Path) -> bool:
    """Prints what a bag's replay says; whether every estimate came out again, bit for bit."""
    try:
        verification = replay_bag(bag).verification
    except SloshBagError as error:
        print(error)
        return False
    for line in verification.lines() if verification else ("no estimates",):
        print(f"{bag.name}: {line}")
    return verification is not None and verification.exact


def _number(bag: Path) -> int:
    digits = bag.name.removeprefix("bag").strip("_")
    return int(digits) if digits else 1


if __name__ == "__main__":
    sys.exit(main())
