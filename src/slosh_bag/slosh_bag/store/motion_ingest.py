"""Adds the motions of a finished recording to a fleet store by running `slosh ingest`.

A bag library knows no motions: a process of the command does the work. It goes on where the one
that started it is killed, and what it does can be repeated.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from slosh_bag.black_box.event_bags import event_bags

PARAMETER: Final = "store_motions"
"""Name of the recorder's parameter and of the key in cell.yaml."""
LONGEST: Final = 120.0
"""Time for which a recorder waits for the command at its end [s]."""
COMMAND: Final = (sys.executable, "-m", "slosh_bringup.cli", "ingest")


class MotionIngest:
    """Runs `slosh ingest` on a finished recording and reports how the command ended.

    Args:
        store: folder or fsspec URL of the fleet store; empty: nothing is ever stored.
        folder: of the recording: a bag or event bags.
        command: program and arguments in front of the bags.

    Attributes:
        complaint: why motions are not stored, in one line; empty: nothing has failed.
    """

    def __init__(self, store: str, folder: Path, command: Sequence[str] = COMMAND) -> None:
        self._store, self._folder, self._command = store, folder, tuple(command)
        self._state = ""
        self.complaint = ""

    def facts(self) -> dict[str, Any]:
        """Returns the values for the diagnostics; empty if no store is configured."""
        return {"motions": self._state or f"to {self._store} at the end"} if self._store else {}

    def run(self, tell: Callable[[], object], longest: float = LONGEST) -> None:
        """Runs the command and waits for its end; a failure is reported, not raised.

        Args:
            tell: is called about once a second meanwhile, and once at the end.
            longest: time to wait [s]; the command goes on afterwards.
        """
        is_complete = any(self._folder.glob("*.mcap"))
        bags = [self._folder] if is_complete else event_bags(self._folder)
        if not (self._store and bags):
            return
        words = [*self._command, *map(str, bags), "--store", self._store]
        # A file, not a pipe: where this process is killed, the command can still write.
        with tempfile.TemporaryFile() as said:
            try:
                # Its own session: Ctrl-C and the end of this process do not reach it.
                process = subprocess.Popen(
                    words, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT,
                    start_new_session=True,
                )  # fmt: skip
            except OSError as error:
                self._failed(f"{words[0]}: {error.strerror}")
            else:
                self._state = f"being added to {self._store}"
                code = _waited(process, tell, longest)
                said.seek(0)
                self._ended(process.pid, code, said.read().decode(errors="replace"))
        tell()

    def _ended(self, pid: int, code: int | None, text: str) -> None:
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        if code is None:
            self._state = f"still being added to {self._store} by process {pid}"
        elif code == 0:
            self._state = lines[-1] if lines else f"added to {self._store}"
        else:
            told = [line for line in lines if line.startswith("slosh")]  # else it is a traceback
            self._failed([*told[:1], *lines[-1:], f"exit code {code}"][0])

    def _failed(self, why: str) -> None:
        self._state = f"not added to {self._store}"
        self.complaint = (
            f"the recording is kept, but its motions are not in {self._store}: {why}; "
            f"`slosh ingest {self._folder} --store {self._store}` adds them"
        )


def _waited(
    process: subprocess.Popen[bytes], tell: Callable[[], object], longest: float
) -> int | None:
    """Waits for a process and returns its exit code, or None if `longest` [s] has passed."""
    waited = 0.0
    while waited < longest:
        step = min(1.0, longest - waited)
        try:
            return process.wait(step)
        except subprocess.TimeoutExpired:
            waited += step
            tell()
    return process.poll()
