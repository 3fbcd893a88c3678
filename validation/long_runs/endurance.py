"""Runs a cell for half an hour, kills its nodes in turn and counts lost messages.

    tools/run python -m validation.long_runs.endurance [--minutes 30] [-o OUT]

The simulated robot sends accelerations at 1 kHz and images at 60 per second. Each minute one node
is killed, and started again by the cell. In the end: gaps in what was recorded, and whether the
kills explain them, or an estimator that refused inputs which came too late, or a robot that was
too slow for its images; for how long the liquid's state was not known; how each node's memory
went; whether each bag replays bit for bit. Kills and memory are in `endurance.json` of the run.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.processes import node_environment
from slosh_bringup.replay.by_journal import checked_by_journal
from slosh_estimator.validity import EstimateFlag
from slosh_msgs_py.node.domain import own_domain
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import replay_bag
from slosh_testing.live_processes import nodes_of
from validation.long_runs.long_cell import long_cell, sizes

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from bench_watch import Viewer

PORT = 8799
EVERY = 60.0
"""A node is killed so often [s]."""
SAMPLED = 5.0
"""Memory is looked at so often [s]."""
MOTION = 3.9
"""The robot's motion lasts a little longer [s]; how often it is repeated is said beforehand."""
BACK = 30.0
"""So long after its kill a node speaks again [s], and the others have found it."""
PATIENCE = 3600.0
"""All of it is replayed in the end [s]."""
WARM = 60.0
"""A process fills its buffers and reads code for so long [s]: no slope is taken from it."""
TURNS = ("camera", "estimator", "monitor", "watch", "recorder")
ACCELERATIONS, FPS = 1000.0, 60.0
"""Accelerations and images that the robot is to send [1/s]."""
SHOWN = 10
"""Of each stream so many gaps are printed."""
NEEDED = {
    "accel": {"recorder"},
    "estimate": {"recorder", "estimator"},
    "free_surface": {"recorder", "camera"},
    "comparison": {"recorder", "camera", "monitor"},
}
"""The nodes without which a stream is not recorded."""
STAMP = ("header.stamp.sec", "header.stamp.nanosec")
FIELDS = {
    "accel": STAMP,
    "estimate": (*STAMP, "samples_dropped", "flags"),
    "free_surface": STAMP,
    "comparison": STAMP,
    "cell/truth": STAMP,
}
"""What is read of the bags."""
SLACK = 1.0
"""Between the last message that is kept and the kill [s]: the recorder's buffer, a late frame."""

Integers = NDArray[np.int64]


@dataclass(slots=True)
class Observed:
    """What was observed while the cell ran: kills, memory use and viewers' page updates.

    Attributes:
        kills: moment [ns] and node.
        memory: by node and process id moments [s] and sizes of its own memory [MB].
        frames: that each viewer got.
        ended: whether the cell ended by itself.
    """

    kills: list[tuple[int, str]] = field(default_factory=list)
    memory: dict[tuple[str, int], list[tuple[float, float]]] = field(default_factory=dict)
    frames: list[int] = field(default_factory=list)
    ended: bool = False


def main() -> int:
    """Runs the test; returns 1 for unexplained losses or a bag whose replay differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--viewers", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/endurance"))
    given = parser.parse_args()
    seconds = 60.0 * given.minutes
    repeat = str(round(seconds / MOTION) + 10)
    robot = {"motion": "l", "repeat": repeat, "rate": str(ACCELERATIONS), "fps": str(FPS)}
    with own_domain() as domain:
        os.environ.update(node_environment(domain))
        with long_cell(given.output, robot, PATIENCE, ["--watch", str(PORT)]) as cell:
            seen = observe(cell.process, seconds, given.viewers)
    print(f"the cell ended by itself: {seen.ended}; exit code {cell.code} (1: nodes had ended)")
    run = (given.output / "latest").resolve()
    write_seen(run / "endurance.json", seen)
    bags = sorted(run.glob("bag*"), key=_number)
    lost = print_gaps(bags, seen.kills)
    print_memory(seen.memory)
    print(f"messages that each viewer got: {', '.join(map(str, seen.frames))}")
    otherwise = sum(not print_replay(bag) for bag in bags)
    return int(seen.ended or lost > 0 or otherwise > 0)


def observe(cell: subprocess.Popen[bytes], seconds: float, viewers: int) -> Observed:
    """Samples memory and kills nodes in turn for a time [s]; reconnects viewers."""
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
            for node, size in sizes(cell.pid, own=True).items():
                seen.memory.setdefault(node, []).append((time.monotonic() - begun, size))
        # Not in the last moments: what is killed comes back before the end.
        if strike <= time.monotonic() < begun + seconds - EVERY / 2:
            strike = next(strikes)
            name = next(turns)
            os.kill(nodes_of(cell.pid)[name], signal.SIGKILL)
            seen.kills.append((time.time_ns(), name))
            print(f"{seen.kills[-1][0]} ns: {name} killed", flush=True)
    seen.ended = cell.poll() is not None
    seen.frames += [len(viewer.ages) for viewer in watching]
    for viewer in watching:
        viewer.close()
    return seen


def _moments(begun: float, every: float) -> Iterator[float]:
    return (begun + every * number for number in itertools.count(1))


def _kept(watching: list[Viewer], wanted: int, seen: Observed) -> list[Viewer]:
    """Returns the connected viewers, with new viewers in place of disconnected ones."""
    left = [viewer for viewer in watching if viewer.is_alive()]
    seen.frames += [len(viewer.ages) for viewer in watching if not viewer.is_alive()]
    while len(left) < wanted:
        try:
            left.append(Viewer())
        except OSError:
            break
        left[-1].start()
    return left


def write_seen(path: Path, seen: Observed) -> None:
    """Writes the kills, and each process's memory over time, to a JSON file."""
    memory = [
        {"node": node, "process": process, "sizes": sizes_of}
        for (node, process), sizes_of in seen.memory.items()
    ]
    path.write_text(json.dumps({"kills": seen.kills, "memory": memory}))


class Stream(NamedTuple):
    """Recorded stamps of a stream of messages, and the stamps that were expected.

    Attributes:
        stamps: (N,) of its messages, rising [ns].
        sent: (M,) stamps that it should have, rising [ns].
        refused: (N,) how many of these are rightly left out up to each message.
        reason: why those are.
    """

    stamps: Integers
    sent: Integers
    refused: Integers | None = None
    reason: str = ""


def print_gaps(bags: Sequence[Path], kills: Sequence[tuple[int, str]]) -> int:
    """Prints the gaps of each stream; returns the number of unexplained missing messages.

    A height is missing, too, where the camera on a busy machine took the next image in its place:
    that is told, and counted only where it was silent for a second.
    """
    lost = 0
    read = read_columns(bags)
    streams = recorded_streams(read)
    for name, stream in streams.items():
        own = [moment for moment, node in kills if node in NEEDED[name]]
        by_kill, refused, other = gaps(stream, own)
        missing = sum(count for _, count in other)
        lost += sum(count for _, count in other if name != "free_surface" or count > FPS)
        why = f", {refused} {stream.reason}" if stream.reason else ""
        print(f"{name:<13} {len(stream.stamps)} recorded; missing after a kill {by_kill}{why}, "
              f"else {missing}")  # fmt: skip
        for moment, count in sorted(other, key=lambda gap: -gap[1])[:SHOWN]:
            print(f"  {moment} ns: {count} messages missing, nothing explains them")
        if len(other) > SHOWN:
            print(f"  and {len(other) - SHOWN} more gaps")
    images, taken = len(streams["free_surface"].sent), streams["accel"].sent
    asked = round(FPS * float(taken[-1] - taken[0]) / SECOND) if len(taken) else 0
    print(f"images sent by the robot: {images} of {asked}")
    unknown = read["estimate"]["flags"] & int(EstimateFlag.SETTLING) != 0
    seconds = np.count_nonzero(unknown) / ACCELERATIONS
    print(f"liquid's state not known (SETTLING): {seconds:.0f} s of the estimates")
    return lost


def recorded_streams(read: Mapping[str, Mapping[str, NDArray[np.int64]]]) -> dict[str, Stream]:
    """Returns each stream's recorded stamps, and those expected from the recorded inputs."""
    accel, surface, comparison, image = (
        np.unique(stamps_of(read[name]))
        for name in ("accel", "free_surface", "comparison", "cell/truth")
    )
    step = round(SECOND / ACCELERATIONS)
    grid = np.arange(accel[0], accel[-1] + 1, step) if len(accel) else accel
    estimate, first = np.unique(stamps_of(read["estimate"]), return_index=True)
    dropped = read["estimate"]["samples_dropped"][first]
    return {
        "accel": Stream(accel, grid),
        "estimate": Stream(
            estimate, grid, dropped, "refused by the estimator as they came too late"
        ),
        "free_surface": Stream(surface, image),
        # A monitor that hears no height says so at moments of its own: these are of no height.
        "comparison": Stream(np.intersect1d(comparison, surface), surface),
    }


def gaps(stream: Stream, kills: Sequence[int]) -> tuple[int, int, list[tuple[int, int]]]:
    """Finds messages that are missing between recorded ones, and those that a kill explains.

    Args:
        stream: what was recorded, and what should have been.
        kills: moments at which a node was killed that the stream needs [ns].

    Returns:
        how many are missing after a kill, how many were rightly left out, and of every other gap
        the last stamp before it [ns] and how many are missing.
    """
    stamps, sent = stream.stamps, stream.sent
    after = np.searchsorted(sent, stamps[1:])
    missing = after - np.searchsorted(sent, stamps[:-1], side="right")
    by_kill = left_out = 0
    other = []
    for row in np.flatnonzero(missing > 0).tolist():
        count = int(missing[row])
        start, end = stamps[row] - SLACK * SECOND, stamps[row + 1]
        if any(start <= kill <= end <= kill + BACK * SECOND for kill in kills):
            by_kill += count
            continue
        if stream.refused is not None:
            refused = min(count, max(0, int(stream.refused[row + 1] - stream.refused[row])))
            left_out, count = left_out + refused, count - refused
        if count:
            other.append((int(stamps[row]), count))
    return by_kill, left_out, other


def read_columns(bags: Sequence[Path]) -> dict[str, dict[str, NDArray[np.int64]]]:
    """Reads integer columns of the streams' messages from all bags in one pass."""
    wanted = {f"/slosh/{name}": fields for name, fields in FIELDS.items()}
    found: dict[str, list[dict[str, NDArray[np.int64]]]] = {topic: [] for topic in wanted}
    for bag in bags:
        try:
            reader = BagReader(bag)
            for block in reader.blocks(list(wanted)):
                columns = reader.columns(block, wanted[block.topic])
                found[block.topic].append({n: c.astype(np.int64) for n, c in columns.items()})
        except SloshBagError as error:
            print(error)
    none = np.empty(0, np.int64)
    return {
        name: {field: np.concatenate([none, *(part[field] for part in found[topic])])
               for field in fields}
        for (topic, fields), name in zip(wanted.items(), FIELDS, strict=True)
    }  # fmt: skip


def stamps_of(columns: Mapping[str, NDArray[np.int64]]) -> Integers:
    """Returns the header stamps of messages [ns]."""
    return columns["header.stamp.sec"] * SECOND + columns["header.stamp.nanosec"]


def print_memory(memory: Mapping[tuple[str, int], Sequence[tuple[float, float]]]) -> None:
    """Prints each node's private memory at the end of its runs, and its growth."""
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
    """Replays a bag and prints the result; returns whether all estimates were reproduced."""
    try:
        run = RecordedRun(bag)
        verification = checked_by_journal(replay_bag(run), run).verification
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
