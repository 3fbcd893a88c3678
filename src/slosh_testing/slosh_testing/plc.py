"""For tests: PLC servers with a state that the test sets, and a local MQTT broker."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from slosh_plc.broker_client import lost_state
from slosh_plc.cell_state import SIGNALS, CellState, Quality, Reading
from slosh_plc.server import Server, ServerThread

WHY = "Mosquitto is not installed (apt install mosquitto)"
PATIENCE = 30.0


def find_mosquitto() -> str | None:
    """Returns the path of the broker's program, or None if it is not installed.

    A user's PATH has the folders `bin`, and often not the folders `sbin` beside them.
    """
    folders = os.environ.get("PATH", os.defpath).split(os.pathsep)
    beside = [str(Path(folder).parent / "sbin") for folder in folders if folder]
    return shutil.which("mosquitto", path=os.pathsep.join([*folders, *beside]))


def free_port() -> int:
    """Returns a TCP port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Broker:
    """A Mosquitto process; a context manager that can be entered repeatedly.

    Args:
        folder: for its configuration.
        port: on which it listens.
        lines: further lines of its configuration.
    """

    def __init__(self, folder: Path, port: int, *lines: str) -> None:
        self.port = port
        self._file = folder / "mosquitto.conf"
        own = [f"listener {port} 127.0.0.1", *(lines or ("allow_anonymous true",))]
        self._file.write_text("\n".join(own) + "\n")

    def __enter__(self) -> Broker:
        self._process = subprocess.Popen(
            [str(find_mosquitto()), "-c", str(self._file)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1.0).close()
                return self
            except OSError:
                assert time.monotonic() < deadline, "the broker did not start"
                time.sleep(0.02)

    def pause(self) -> None:
        """Stops the process: connections stay, and nobody answers."""
        self._process.send_signal(signal.SIGSTOP)

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()


def good_state(**values: Any) -> CellState:
    """Returns a cell state with given values, all of good quality."""
    names = [signal.name for signal in SIGNALS]
    return CellState(False, **{n: Reading(values.get(n, 1), Quality.GOOD) for n in names})


class ServedCell:
    """Servers of a cell's state in their own thread, with the state that they serve.

    Attributes:
        state: the state; a test sets it.
    """

    def __init__(self) -> None:
        self.state = good_state()

    @contextmanager
    def serve(self, *servers: Server) -> Iterator[ServerThread]:
        """Runs the servers while a `with` block is executed."""
        thread = ServerThread(servers, lambda: self.state)
        thread.start()
        try:
            yield thread
        finally:
            thread.stop()

    def lose(self) -> None:
        """Changes the served state to that of a cell whose messages have stopped."""
        self.state = lost_state()
