"""Runs `slosh demo` and `slosh cell` as processes, and finds their nodes."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from slosh_bringup.processes import NodeProcess, config_folder, node_environment

PATIENCE = 100.0
"""A machine that is busy with other things starts five nodes slowly [s]."""
SPARING = 9.0
"""What is waited for is looked at for a tenth of the time."""


def until(
    condition: Callable[[], object],
    what: str = "it",
    patience: float = 60.0,
    act: Callable[[], object] = lambda: time.sleep(0.01),
) -> None:
    """Waits until a condition is met, at most for `patience` [s]."""
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        act()


class LiveProcess:
    """A running `slosh` command with its output and its nodes.

    Attributes:
        process: of the command.
        words: what it prints to stdout and stderr goes here.
    """

    def __init__(self, words: Sequence[str], output: Path, environment: dict[str, str]) -> None:
        self.words = output
        self._nodes: dict[str, int] = {}
        with output.open("wb") as stream:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "slosh_bringup.cli", *words],
                stdout=stream,
                stderr=subprocess.STDOUT,
                env=environment,
            )

    @property
    def said(self) -> str:
        """Returns all output of the command so far."""
        return self.words.read_text(errors="replace")

    def nodes(self) -> dict[str, int]:
        """Returns the process ids of all nodes that were started so far, by name."""
        self._nodes |= nodes_of(self.process.pid)
        return self._nodes

    def wait_for(self, condition: Callable[[], object], what: str) -> None:
        """Waits until a condition is met; fails if the command ends before."""
        deadline = time.monotonic() + PATIENCE
        while True:
            asked = time.monotonic()
            if condition():
                return
            assert self.process.poll() is None, f"ended before {what}: {self.said}"
            assert time.monotonic() < deadline, f"waited in vain for {what}: {self.said}"
            # One that reads a growing bag would take the cell's time.
            time.sleep(max(0.02, SPARING * (time.monotonic() - asked)))

    def wait_for_nodes(self, count: int) -> dict[str, int]:
        """Waits until a number of nodes run; returns their process ids by name."""
        self.wait_for(lambda: len(self.nodes()) >= count, f"{count} nodes")
        return self.nodes()

    def wait_until_ready(self) -> None:
        """Waits until the command reports that all nodes are ready."""
        self.wait_for(lambda: "ready: recording to" in self.said, "all nodes to be ready")

    def wait_for_recording(self, bag: Path, size: int = 400_000) -> None:
        """Waits until the bag is larger than a number of bytes."""
        self.wait_for(lambda: recorded(bag) > size, "a recording")

    def end(self) -> int:
        """Waits for the end of the command and returns its exit code."""
        return self.process.wait(PATIENCE)

    def clean_up(self) -> None:
        """Kills the command and all its nodes."""
        for pid in self.nodes().values():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.kill()
        self.process.wait()


@contextlib.contextmanager
def live_process(
    *words: str, output: Path, environment: dict[str, str] | None = None
) -> Iterator[LiveProcess]:
    """Starts `slosh` with given arguments; kills its processes at the end."""
    running = LiveProcess(words, output, {**os.environ, **(environment or {})})
    try:
        yield running
    finally:
        running.clean_up()


@contextlib.contextmanager
def robot(domain: int, **parameters: str) -> Iterator[subprocess.Popen[bytes]]:
    """Runs the simulated cell in place of a robot and a camera; yields its process."""
    given = {"model": str(config_folder() / "truth.yaml"), **parameters}
    command = NodeProcess("cell", parameters=given).command("/slosh")
    process = subprocess.Popen(command, env=node_environment(domain))
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def free_port() -> int:
    """Returns an unused network port."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return int(taken.getsockname()[1])


def recorded(bag: Path) -> int:
    """Returns the size of a bag that is being recorded [bytes]."""
    return sum(file.stat().st_size for file in bag.glob("*.mcap"))


def children(pid: int) -> list[int]:
    """Returns the ids of the processes that a process has started."""
    found = []
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            found += [int(word) for word in (task / "children").read_text().split()]
    return found


def node_name(pid: int) -> str:
    """Returns a process's ROS node name from its command line; empty if it is no node."""
    with contextlib.suppress(OSError):
        words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
        return next((word[8:] for word in words if word.startswith("__node:=")), "")
    return ""


def nodes_of(parent: int) -> dict[str, int]:
    """Returns the process ids of the nodes that a process has started, by name."""
    return {name: child for child in children(parent) if (name := node_name(child))}


def alive(pid: int) -> bool:
    """Returns whether a process runs; ended processes in the zombie state do not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
