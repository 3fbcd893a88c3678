"""Runs commands in a shell and measures their time."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

_MARK = "\x1e"
"""Begins the line that ends an answer: no command prints it."""


class ShellError(Exception):
    """Error of a command that did not end; the text includes what it had printed."""


class Answer(NamedTuple):
    """Exit code, combined output and duration [s] of a command."""

    code: int
    said: str
    seconds: float


class Shell:
    """A bash process in its own session, used as a context manager; it keeps folder and variables.

    Args:
        folder: in which it starts.
        environment: of what it runs.
        patience: for a single command [s].
    """

    def __init__(self, folder: Path, environment: Mapping[str, str], patience: float) -> None:
        self._patience = patience
        self._bash = subprocess.Popen(
            ["bash", "--noprofile", "--norc"],
            cwd=folder,
            env=dict(environment),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
        )
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        # A command that dies of Ctrl-C does not take the shell along, as on a terminal.
        self.type("trap : INT")

    def __enter__(self) -> Shell:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # Whatever it has started, in the background too, is of its session.
        os.killpg(self._bash.pid, signal.SIGTERM if kind is None else signal.SIGKILL)
        self._bash.wait()

    def type(self, command: str, ctrl_c_after: str = "") -> Answer:
        """Runs a command in the shell until it ends.

        Args:
            command: as one would type it; there is nobody to answer its questions.
            ctrl_c_after: Ctrl-C is pressed once this has been printed; empty: never.

        Raises:
            ShellError: it did not end in time, or the shell has ended.
        """
        assert self._bash.stdin is not None
        began, said, pressed = time.monotonic(), "", False
        self._bash.stdin.write(f"{{ {command}\n}} < /dev/null\nprintf '{_MARK}%s\\n' $?\n")
        self._bash.stdin.flush()
        while True:
            line = self._next(command, began, said)
            before, mark, code = line.partition(_MARK)
            said += before
            if mark:
                return Answer(int(code), said, time.monotonic() - began)
            if ctrl_c_after and not pressed and ctrl_c_after in line:
                pressed = True
                os.killpg(self._bash.pid, signal.SIGINT)

    def _next(self, command: str, began: float, said: str) -> str:
        left = began + self._patience - time.monotonic()
        try:
            line = self._lines.get(timeout=max(left, 0.0))
        except queue.Empty:
            line = ""
        if not line:
            raise ShellError(f"{command}: did not end within {self._patience:g} s:\n{said}")
        return line

    def _read(self) -> None:
        assert self._bash.stdout is not None
        for line in self._bash.stdout:
            self._lines.put(line)
        self._lines.put("")
