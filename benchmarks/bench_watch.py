"""Measures what the operator's web page costs the cell, with 0, 3 and 20 viewers.

All nodes of the simulated cell run as processes, with the page; viewers come and go in turns, so
that a busy machine disturbs all alike. Told are the processor time of the other nodes as a ratio
to that without viewers, that of the watch node as a share of a core, and the time from a
comparison's stamp to the viewer that has it.

    tools/run python benchmarks/bench_watch.py [--seconds 8] [--turns 3] [--docs]
"""

from __future__ import annotations

import argparse
import json
import socket
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import psutil
from measuring import parsed
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from slosh_bringup.live.cell_setup import default_setup
from slosh_bringup.processes import NodeGroup, NodeProcess, config_folder, node_environment
from slosh_msgs_py.node.domain import own_domain

VIEWERS = (0, 3, 20)
PORT = 8799
SETTLE = 1.5
"""After viewers have come or gone [s]."""
PATIENCE = 90.0
NEITHER = ("watch", "cell")
"""Not among the others: the page itself, and what plays the robot."""
START, END = "<!-- table watch -->", "<!-- end watch -->"
PAGE = Path(__file__).resolve().parent.parent / "docs" / "watch.md"


class Viewer(threading.Thread):
    """A viewer of the web page, which records the age of each comparison that it receives."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.ages: list[float] = []
        self._socket = connect(f"ws://127.0.0.1:{PORT}/frames", max_size=None).__enter__()

    def run(self) -> None:
        """Receives page updates until the connection is closed."""
        try:
            for message in self._socket:
                if isinstance(message, str):
                    newest = json.loads(message)[-1]["now"]
                    if "stamp_ns" in newest:
                        self.ages.append(time.time() - newest["stamp_ns"] * 1e-9)
        except (WebSocketException, OSError):
            return

    def close(self) -> None:
        """Closes the viewer's connection."""
        self._socket.__exit__(None, None, None)


def deaf_viewer() -> socket.socket:
    """Opens a connection that requests page updates but never reads them."""
    viewer = socket.create_connection(("127.0.0.1", PORT))
    viewer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    viewer.sendall(
        f"GET /frames HTTP/1.1\r\nHost: 127.0.0.1:{PORT}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    return viewer


Turn = tuple[dict[str, float], list[float]]
"""Processor time of each node per second, and the ages that viewers noted."""


def turn(nodes: dict[str, psutil.Process], count: int, seconds: float) -> Turn:
    """Returns each node's processor time per second with a number of viewers, and data ages."""
    viewers = [Viewer() for _ in range(max(count - 1, 0))]
    deaf = [deaf_viewer()] if count else []
    for viewer in viewers:
        viewer.start()
    time.sleep(SETTLE)
    before, began = {name: used(node) for name, node in nodes.items()}, time.monotonic()
    time.sleep(seconds)
    elapsed = time.monotonic() - began
    shares = {name: (used(node) - before[name]) / elapsed for name, node in nodes.items()}
    for viewer in viewers:
        viewer.close()
    for one in deaf:
        one.close()
    return shares, [age for viewer in viewers for age in viewer.ages[10:]]


def used(process: psutil.Process) -> float:
    """Returns the processor time that a process has used so far [s]."""
    times = process.cpu_times()
    return float(times.user + times.system)


def wait_for_page(group: NodeGroup) -> None:
    """Waits until the web page shows that the cell compares heights."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and not group.ended():
        try:
            with connect(f"ws://127.0.0.1:{PORT}/frames", max_size=None) as viewer:
                for message in viewer:
                    if isinstance(message, str) and json.loads(message)[-1]["verdict"] != "blind":
                        return
        except OSError:
            time.sleep(0.2)
    raise SystemExit(f"the cell did not get to work: {group.ended()}")


def measure(seconds: float, turns: int) -> list[str]:
    """Runs the cell with different numbers of viewers; returns the table's lines."""
    setup = default_setup()
    with ExitStack() as stack:
        domain = stack.enter_context(own_domain())
        room = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        group = stack.enter_context(NodeGroup("/slosh", room / "logs", node_environment(domain)))
        processes = setup.processes(room / "bag")
        processes.append(NodeProcess("watch", parameters={"port": str(PORT)}))
        given = {"motion": "c3", "repeat": "30", "model": str(config_folder() / "truth.yaml")}
        given["calibration"] = str(setup.calibration)
        processes.append(NodeProcess("cell", [setup.parameters], given))
        for process in processes:
            group.start(process)
        wait_for_page(group)
        nodes = {entry.name: psutil.Process(group.pid(entry.name)) for entry in processes}
        rounds = [[turn(nodes, count, seconds) for count in VIEWERS] for _ in range(turns)]
        return table(rounds)


def table(rounds: Sequence[Sequence[Turn]]) -> list[str]:
    """Formats medians over all turns as lines of a Markdown table."""
    lines = [
        "| viewers | the other nodes, cores | ratio to none "
        "| the watch node, share of a core | stamp to viewer, median [s] |",
        "|--:|--:|--:|--:|--:|",
    ]
    others = [
        [sum(used for name, used in shares.items() if name not in NEITHER) for shares, _ in turns]
        for turns in zip(*rounds, strict=True)
    ]
    for column, count in enumerate(VIEWERS):
        turns = [entry[column] for entry in rounds]
        ratio = statistics.median(a / b for a, b in zip(others[column], others[0], strict=True))
        own = statistics.median(shares["watch"] for shares, _ in turns)
        ages = [age for _, found in turns for age in found]
        late = f"{statistics.median(ages):.3f}" if ages else "–"
        lines.append(
            f"| {count} | {statistics.median(others[column]):.3f} | {ratio:.3f} | {own:.3f} "
            f"| {late} |"
        )
    return lines


def main() -> int:
    """Measures and prints the table; writes it to docs/watch.md if requested."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--docs", action="store_true", help="write docs/watch.md")
    given = parsed(parser, seconds=0.2, turns=1)
    lines = measure(given.seconds, given.turns)
    print("\n".join(lines))
    if given.docs:
        head, rest = PAGE.read_text(encoding="utf-8").split(START)
        tail = rest.split(END)[1]
        text = "\n".join(lines)
        PAGE.write_text(f"{head}{START}\n{text}\n{END}{tail}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
