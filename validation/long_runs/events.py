"""Runs the event recorder for an hour; checks bags, their replays and the nodes' memory.

    tools/run python -m validation.long_runs.events [--events 100] [--every 36] [-o FOLDER]

Estimator, monitor and recorder run as processes of their own; a robot and a camera beside them
make a limit event every so often. In the end: how many events have a bag of their own, whether
each bag replays bit for bit, and what each node's memory did. A shorter `--every` is a shorter
soak; an event within the window of the one before would lengthen its bag.

On an overloaded machine messages do not reach the recorder. A bag that says so cannot replay bit
for bit: it is counted apart, with its losses, and more than OVERLOADED of such bags fail, since
then nothing is shown. The load is printed with the result.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tqdm import tqdm

from slosh_bag.black_box.black_box import Cause
from slosh_bag.black_box.event_bags import event_bags, noted_events
from slosh_bag.errors import SloshBagError
from slosh_base.files import new_folder
from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_bringup.replay.by_journal import checked_by_journal
from slosh_motion.recorded.sources import lost_messages
from slosh_msgs.msg import SloshComparison
from slosh_msgs_py.node.domain import own_domain
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import replay_bag
from slosh_testing.robot import RobotNode, nodes_and_robot, swing
from validation.long_runs.long_cell import resident

BEFORE, AFTER = 2.0, 1.0  # s
HIGH, LOW, LONGEST = 0.03, 1e-4, 0.3  # m; s; how long a wave is high
PATIENCE = 20.0  # s, for the monitor on a busy machine
NODES = ("estimator", "monitor", "recorder")
GROWTH, BUFFERS = 1.05, 3.0  # 1, MB; what memory may grow from the first half to the second one
WARM = 180.0  # s, in which a node's memory still grows to its usual size
OVERLOADED = 0.1
"""Greatest part of the bags that may not be judged, for lost messages."""
EXACT = ("estimate", "fused_estimate", "comparison")
"""What a replay gives bit for bit."""


def main() -> int:
    """Runs the test; returns 1 if a bag is missing or differs, or a node's memory grew."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--events", type=int, default=100, help="number of events")
    parser.add_argument("--every", type=float, default=36.0, help="time between events [s]")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/events"))
    given = parser.parse_args()
    if given.every < BEFORE + AFTER + 1.0:
        parser.error(f"--every must be at least {BEFORE + AFTER + 1.0:g} s: bags would overlap")
    with own_domain() as domain, new_folder(given.output) as folder:
        os.environ.update(node_environment(domain), ROS_DOMAIN_ID=str(domain))
        memory, told = soak(folder, domain, given.events, given.every)
        code = report(folder / "bags", given, memory, told)
    load, cores = os.getloadavg()[2], os.cpu_count()
    print(f"load of the last quarter of an hour {load:.1f} on {cores} cores")
    return code


def soak(
    folder: Path, domain: int, count: int, every: float
) -> tuple[dict[str, list[float]], int]:
    """Plays limit events; returns the nodes' memory [MB] and the number of reported events.

    Returns:
        each node's memory at each event [MB], and how many limit events the monitor told of.
    """
    recorder = {
        "output": str(folder / "bags"), "mode": "events", "event_before": str(BEFORE),
        "event_after": str(AFTER), "bags_per_cause": str(10 * count),
    }  # fmt: skip
    memory: dict[str, list[float]] = {name: [] for name in NODES}
    told = 0
    with nodes_and_robot(folder, domain) as (group, robot):
        robot.push = swing(0.05)
        group.start(NodeProcess("recorder", (), recorder))
        robot.until(lambda: "recorder" in robot.health, "the recorder")
        due = time.monotonic()
        for _ in tqdm(range(count), unit="event"):
            due += every
            play_until(robot, lambda due=due: time.monotonic() >= due)
            told += high_wave(robot)
            look(group, memory)
        play_until(robot, lambda due=due: time.monotonic() >= due + AFTER + 3.0)
    return memory, told


def high_wave(robot: RobotNode) -> bool:
    """Publishes a high wave until the monitor reports it; returns whether it did."""
    assert robot.surface is not None
    robot.surface.msh, end = HIGH, time.monotonic() + PATIENCE

    def is_told() -> bool:
        state = robot.comparisons[-1].state if robot.comparisons else None
        return state == SloshComparison.STATE_ERROR or time.monotonic() > end

    play_until(robot, is_told, forget=False)
    robot.surface.msh = LOW
    return time.monotonic() <= end


def play_until(robot: RobotNode, done: Callable[[], bool], *, forget: bool = True) -> None:
    """Publishes inputs until a condition holds; discards received messages."""
    while not done():
        end = time.monotonic() + LONGEST
        robot.until(lambda end=end: done() or time.monotonic() >= end, "the next event")
        if forget:
            robot.estimates.clear()
            del robot.comparisons[:-1]


def look(group: NodeGroup, memory: dict[str, list[float]]) -> None:
    """Adds each node's present private memory to the lists."""
    for name, sizes in memory.items():
        sizes.append(resident(group.pid(name), own=True))


def report(
    folder: Path, given: argparse.Namespace, memory: dict[str, list[float]], told: int
) -> int:
    """Replays all event bags and prints the result; returns the exit code."""
    bags, wanted = event_bags(folder), given.events
    differing: list[str] = []
    overloaded: list[str] = []
    limits = with_limit = unjudged = 0
    for bag in tqdm(bags, unit="bag", desc="replayed", leave=False):
        run = RecordedRun(bag)
        causes = [one.cause for one in noted_events(run.facts.get("events", ""))]
        limits += causes.count(Cause.LIMIT)
        with_limit += Cause.LIMIT in causes
        try:
            found = checked_by_journal(replay_bag(run), run).verified
        except SloshBagError as error:
            differing.append(f"{bag.name}: {error}")
            continue
        compared = {name: found[name] for name in EXACT if name in found}
        wrong = [
            f"{bag.name}: {name}" for name, one in compared.items() if one.total and not one.exact
        ]
        # One that begins before the first state of a node has nothing to compare.
        unjudged += not all(name in found and found[name].recorded for name in EXACT[:2])
        lost = lost_messages(run.facts)
        if wrong and lost:
            overloaded.append(
                f"{bag.name}: lost {sum(lost.values())} messages on {len(lost)} topics"
            )
        else:
            differing += wrong
    print(f"events {wanted}, told by the monitor {told}; in bags {limits}")
    print(f"bags {len(bags)}, {with_limit} with a limit event; in replay differ {len(differing)}")
    for line in differing:
        print(f"  {line}")
    print(f"bags with nothing to compare, before a node's first state: {unjudged}")
    print(f"bags not judged, for messages that an overloaded machine lost: {len(overloaded)}")
    for line in overloaded:
        print(f"  {line}")
    grown = [name for name, sizes in memory.items() if has_grown(name, sizes, given.every)]
    blind = len(overloaded) + unjudged > max(OVERLOADED * wanted, 1)
    return int(with_limit != wanted or told != wanted or bool(differing or grown) or blind)


def has_grown(name: str, sizes: list[float], every: float) -> bool:
    """Prints a node's memory at each event [MB]; returns whether the memory still grows."""
    # At first buffers are filled and code is read.
    settled = sizes[max(len(sizes) // 4, math.ceil(WARM / every)) :]
    half = len(settled) // 2
    if not half:
        print(f"{name:<10} memory not judged: the soak is shorter than {WARM:g} s and two events")
        return False
    early, late = (sum(part) / len(part) for part in (settled[:half], settled[half:]))
    print(f"{name:<10} memory {sizes[0]:6.1f} MB at first, {early:6.1f}, then {late:6.1f}")
    return late > GROWTH * early + BUFFERS


if __name__ == "__main__":
    sys.exit(main())
