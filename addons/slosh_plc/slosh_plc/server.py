"""Base class of all servers of a cell's state, and the thread that runs the servers.

The servers ask for the state themselves: a node whose own thread stands still cannot leave them
with the last good one.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import threading
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

from slosh_plc.cell_state import CellState
from slosh_plc.errors import SloshPlcError
from slosh_plc.tuning import TUNING

State = Callable[[], CellState]
"""Returns the cell's state of this moment."""
LOOPBACK = ("127.0.0.1", "::1", "localhost")
INSTALL = "pip install -r requirements/plc.txt"


class ServerHealth(NamedTuple):
    """Whether a server works, and a sentence that describes its state."""

    is_good: bool
    sentence: str


class Server(Protocol):
    """Interface of a server of a cell's state; its coroutines run in one event loop."""

    async def start(self, state: State) -> None:
        """Starts to serve; raises SloshPlcError if that is impossible."""

    async def update(self, state: CellState) -> None:
        """Passes a new cell state to the server; called every TUNING.period."""

    async def stop(self) -> None:
        """Stops the server; values retained by a broker are then marked as no longer valid."""

    def health(self) -> ServerHealth:
        """Returns whether the server works; may be called from any thread."""


class ServerThread:
    """Runs servers in the event loop of a separate thread.

    Args:
        servers: that run.
        state: returns the cell's state; called in that thread.
    """

    def __init__(self, servers: Sequence[Server], state: State) -> None:
        self._servers, self._state = servers, state
        self._loop = asyncio.new_event_loop()
        self._loop.set_exception_handler(_tell_of_errors)
        self._task: asyncio.Task[None] | None = None
        self._started = threading.Event()
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="plc servers", daemon=True)

    def start(self) -> None:
        """Starts all servers; returns when all of them accept clients.

        Raises:
            SloshPlcError: one cannot: its port is taken, or a file does not fit.
        """
        self._thread.start()
        if not self._started.wait(TUNING.starting):
            raise SloshPlcError(f"the servers did not start within {TUNING.starting:.0f} s")
        if self._failure is not None:
            raise self._failure

    def stop(self) -> None:
        """Stops all servers and waits until the thread has ended."""
        with contextlib.suppress(RuntimeError):  # the loop has ended already
            self._loop.call_soon_threadsafe(lambda: self._task and self._task.cancel())
        self._thread.join(TUNING.starting)

    def health(self) -> list[ServerHealth]:
        """Returns the state of each server: whether it works, and a sentence."""
        return [server.health() for server in self._servers]

    @property
    def failure(self) -> str:
        """Error that ended the thread, as text; empty while the thread runs."""
        return f"the servers have ended: {self._failure!r}" if self._failure else ""

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._task = self._loop.create_task(self._serve())
        try:
            self._loop.run_until_complete(self._task)
        except asyncio.CancelledError:
            pass
        except Exception as error:
            self._failure = error
        finally:
            self._started.set()
            self._loop.close()

    async def _serve(self) -> None:
        running: list[Server] = []
        try:
            for server in self._servers:
                await server.start(self._state)
                running.append(server)
            self._started.set()
            while True:
                state = self._state()
                for server in self._servers:
                    await server.update(state)
                await asyncio.sleep(TUNING.period)
        finally:
            for server in running:
                await server.stop()


def _tell_of_errors(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Handles exceptions in callbacks; ignores those of sockets that have just closed."""
    if not isinstance(context.get("exception"), OSError):
        loop.default_exception_handler(context)


def check_port(name: str, host: str, port: int) -> None:
    """Raises an error if the port is in use, so that no server could listen.

    Args:
        name: of the parameter that gives it.
        host: address on which it listens.
        port: its number.

    Raises:
        SloshPlcError: it cannot; the text says why.
    """
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        other = "; choose another port for each cell" if error.errno else ""
        raise SloshPlcError(f"{name} = {port} on {host}: {error.strerror}{other}") from None


def quiet(library: str) -> None:
    """Silences a library's logger, whose tracebacks of invalid client data would fill the log."""
    logging.getLogger(library).setLevel(logging.CRITICAL + 1)


def missing(module: str) -> SloshPlcError:
    """Returns the error to raise if an optional library is not installed."""
    return SloshPlcError(f"{module} is not installed ({INSTALL})")
