"""`slosh demo` and `slosh cell` as processes of their own, and the nodes that they start."""

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
    """Waits until something has happened, so long at most [s]; does something meanwhile."""
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        act()


class LiveProcess:
    """A command, its words, and its nodes.

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
        """All that it has printed."""
        return self.words.read_text(errors="replace")

    def nodes(self) -> dict[str, int]:
        """Process ids of the nodes that it has started so far, by name."""
        self._nodes |= nodes_of(self.process.pid)
        return self._nodes

    def wait_for(self, condition: Callable[[], object], what: str) -> None:
        """Waits until something has happened; the command must not end before."""
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
        """Waits until so many nodes run; returns their process ids by name."""
        self.wait_for(lambda: len(self.nodes()) >= count, f"{count} nodes")
        return self.nodes()

    def wait_until_ready(self) -> None:
        """Waits until all nodes are ready; what the robot says before is recorded, too."""
        self.wait_for(lambda: "ready: recording to" in self.said, "all nodes to be ready")

    def wait_for_recording(self, bag: Path, size: int = 400_000) -> None:
        """Waits until so many bytes are in the bag: the cell is in motion."""
        self.wait_for(lambda: recorded(bag) > size, "a recording")

    def end(self) -> int:
        """Waits for the command's end; returns its exit code."""
        return self.process.wait(PATIENCE)

    def clean_up(self) -> None:
        """Leaves nothing behind, whatever the test found out."""
        for pid in self.nodes().values():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.kill()
        self.process.wait()


@contextlib.contextmanager
def live_process(
    *words: str, output: Path, environment: dict[str, str] | None = None
) -> Iterator[LiveProcess]:
    """Starts `slosh WORDS`; in the end nothing is left of it."""
    running = LiveProcess(words, output, {**os.environ, **(environment or {})})
    try:
        yield running
    finally:
        running.clean_up()


@contextlib.contextmanager
def robot(domain: int, **parameters: str) -> Iterator[subprocess.Popen[bytes]]:
    """The simulated cell in the place of a robot and its camera; gives its process."""
    given = {"model": str(config_folder() / "truth.yaml"), **parameters}
    command = NodeProcess("cell", parameters=given).command("/slosh")
    process = subprocess.Popen(command, env=node_environment(domain))
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def free_port() -> int:
    """A port that nobody uses yet."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return int(taken.getsockname()[1])


def recorded(bag: Path) -> int:
    """Bytes in the files of a bag that is being recorded."""
    return sum(file.stat().st_size for file in bag.glob("*.mcap"))


def children(pid: int) -> list[int]:
    """Processes that a process has started."""
    found = []
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            found += [int(word) for word in (task / "children").read_text().split()]
    return found


def node_name(pid: int) -> str:
    """The name of a node, from its command line; empty: the process is none."""
    with contextlib.suppress(OSError):
        words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
        return next((word[8:] for word in words if word.startswith("__node:=")), "")
    return ""


def nodes_of(parent: int) -> dict[str, int]:
    """Process ids of the nodes that a process has started, by name."""
    return {name: child for child in children(parent) if (name := node_name(child))}


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and waits for its parent does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
