"""Reports to systemd that a cell, run as a service, is ready, alive or stopping (sd_notify(3))."""

from __future__ import annotations

import contextlib
import os
import socket
import time
from collections.abc import MutableMapping

from slosh_base.files.plain_text import plain_line

SOCKET = "NOTIFY_SOCKET"
PERIOD = 1.0
"""Between two signs of life [s]; the unit's WatchdogSec is many times as long."""


class ServiceManager:
    """Connection to systemd; does nothing if systemd has not started this process.

    Args:
        environment: variables of this process; the socket's name is taken out of them, since nodes
            speak for nobody but themselves.
    """

    def __init__(self, environment: MutableMapping[str, str] = os.environ) -> None:
        address = environment.pop(SOCKET, "")
        # An @ stands for the zero byte before the names of sockets that are no files.
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self._is_ready = False
        self._told = 0.0

    def look(self, *, is_ready: bool, status: str) -> None:
        """Reports once that the cell is ready, and once a second that this process is alive.

        Args:
            is_ready: whether all nodes have been ready.
            status: what `systemctl status` shows until then.
        """
        now = time.monotonic()
        if not self._address or (now - self._told < PERIOD and is_ready == self._is_ready):
            return
        self._told = now
        lines = ["WATCHDOG=1", f"STATUS={'running' if is_ready else plain_line(status)}"]
        if is_ready and not self._is_ready:
            self._is_ready = True
            lines.insert(0, "READY=1")
        self._tell(lines)

    def stopping(self) -> None:
        """Reports that the cell is stopping, which ends systemd's watchdog."""
        self._tell(["STOPPING=1", "STATUS=stopping the nodes, writing the report"])

    def _tell(self, lines: list[str]) -> None:
        if not self._address:
            return
        # A manager that is being restarted takes nothing; the next sign of life comes anyway.
        with (
            contextlib.suppress(OSError),
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as connection,
        ):
            connection.sendto("\n".join(lines).encode(), self._address)
