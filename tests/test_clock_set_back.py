"""Tests a running cell while the system clock is set back and forward by an hour."""

import re
import shutil
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from slosh_bag.errors import SloshBagError
from slosh_bringup.processes import NodeGroup, NodeProcess
from slosh_replay.replay import replay_bag
from slosh_replay.split import split_bag
from slosh_testing.robot import RobotNode, nodes_and_robot, swing

LIBRARY = Path(__file__).with_name("set_clock.c")
HOUR = 3600
OK = 0
NODES = {"estimator", "monitor", "recorder"}


@pytest.fixture
def set_clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Returns a function that shifts the clock of processes started later, by seconds."""
    library, place = tmp_path / "set_clock.so", tmp_path / "clock"
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler, "no C compiler: apt install gcc"
    words = [compiler, "-O2", "-shared", "-fPIC", "-o", library, LIBRARY, "-ldl", "-lpthread"]
    subprocess.run(words, check=True)
    place.write_bytes(struct.pack("q", 0))
    monkeypatch.setenv("LD_PRELOAD", str(library))
    monkeypatch.setenv("SET_CLOCK_FILE", str(place))

    def set_by(seconds: int) -> None:
        # In place: the file is mapped.
        with place.open("r+b") as file:
            file.write(struct.pack("q", seconds * 1_000_000_000))

    return set_by


@pytest.fixture
def cell(
    set_clock: Callable[[int], None], tmp_path: Path, domain: int
) -> Iterator[tuple[NodeGroup, RobotNode]]:
    with nodes_and_robot(tmp_path, domain) as (group, robot):
        group.start(NodeProcess("recorder", (), {"output": str(tmp_path / "bag")}))
        start = time.monotonic()
        robot.push = lambda t: swing(0.5)(time.monotonic() - start)
        robot.until(lambda: robot.recorded >= NODES - {"recorder"}, "the nodes")
        robot.until(lambda: is_well(robot) and recorded(robot) > 600, "a cell that is well")
        yield group, robot


def is_well(robot: RobotNode) -> bool:
    return bool(robot.comparisons) and robot.health.get("estimator", (1,))[0] == OK


def recorded(robot: RobotNode) -> int:
    """Returns the number of recorded messages that the recorder reports."""
    told = re.match(r"(\d+) messages", robot.health["recorder"][1])
    return int(told[1]) if told else 0  # it may tell of a lost message first


@pytest.mark.long
def test_an_hour_back_and_forward_again(
    cell: tuple[NodeGroup, RobotNode], set_clock: Callable[[int], None], tmp_path: Path
) -> None:
    group, robot = cell
    before = max(estimate.nonlinear.msh for estimate in robot.estimates)
    for hours in (-1, 0):
        offset = hours * HOUR * 1_000_000_000
        count, first = recorded(robot), len(robot.estimates)
        set_clock(hours * HOUR)
        robot.time_ns = lambda offset=offset: time.time_ns() + offset
        # Of the timers that wait for the clock none may wait for an hour.
        robot.health.clear()
        robot.until(lambda: robot.health.keys() >= NODES, "news of all nodes")
        robot.until(lambda count=count: recorded(robot) > count + 300, "what is recorded")
        robot.until(lambda: is_well(robot), "a cell that is well again")
        unflagged = [one.nonlinear.msh for one in robot.estimates[first:] if not one.flags]
        assert max(unflagged) < 1.5 * before
    assert group.failed() is None
    group.stop()
    with pytest.raises(SloshBagError, match=r"go back .* `slosh recover --split"):
        replay_bag(tmp_path / "bag")
    parts = split_bag(tmp_path / "bag", tmp_path / "parts", lambda count: None)
    for part in parts:
        verification = replay_bag(part).verification
        assert verification.exact, verification.lines()
    assert len(parts) == 2
