"""Ends nodes when their parent process ends for any reason.

Whoever starts nodes holds the writing end of a pipe, each node reads the other end: the pipe ends
with its last writer, killed or not. (PR_SET_PDEATHSIG tells the end of the parent's thread, not of
its process, and is silent about a parent that died before the call; a pipe has no such race, and
open files also outlive the second start of the interpreter by which the wheels load rclpy.)
A recorder must end last: the others hold the writing end of a second pipe, which it reads, too.
A node started by hand has no such pipe and watches nobody.
"""

from __future__ import annotations

import contextlib
import os
import select
import stat
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

VARIABLE = "SLOSH_LIFELINES"
"""File descriptors, with commas: the starting process's pipe; for who ends last the others'."""
PATIENCE = 20.0
"""How long the others are waited for once the starting process has ended [s]."""


class Inheritance(NamedTuple):
    """Pipe ends that a node process inherits from its parent.

    Attributes:
        descriptors: files that it inherits.
        environment: variables beside its usual ones.
    """

    descriptors: tuple[int, ...]
    environment: Mapping[str, str]


class Lifelines:
    """Pipes through which node processes notice the end of the process that started them."""

    def __init__(self) -> None:
        # Python opens files for this process alone: what it starts beside the nodes holds no end.
        self._starter, self._starter_end = os.pipe()
        self._others, self._others_end = os.pipe()

    def of_node(self, *, last: bool) -> Inheritance:
        """Returns the pipe ends that a node process inherits.

        Args:
            last: it ends after all that are not.
        """
        reads = [self._starter, self._others] if last else [self._starter]
        holds = [] if last else [self._others_end]
        return Inheritance((*reads, *holds), {VARIABLE: ",".join(map(str, reads))})

    def close(self) -> None:
        """Closes the pipes, which makes all nodes end that still run."""
        for descriptor in (self._starter, self._starter_end, self._others, self._others_end):
            os.close(descriptor)


def watch_lifelines(ended: Callable[[], None]) -> None:
    """Starts a thread that calls `ended` when the parent process has ended.

    Who ends last is called when the others have ended, too, or after PATIENCE.
    """
    # Not for what this process starts itself: it does not inherit the files.
    descriptors = _pipes(os.environ.pop(VARIABLE, ""))
    if not descriptors:
        return

    def wait() -> None:
        starter, *others = descriptors
        _until_end(starter, None)
        deadline = time.monotonic() + PATIENCE
        for descriptor in others:
            _until_end(descriptor, deadline)
        ended()

    threading.Thread(target=wait, name="lifeline", daemon=True).start()


def _pipes(text: str) -> Sequence[int]:
    """Parses pipe descriptors from a text; empty if any of them is not a pipe."""
    with contextlib.suppress(OSError, ValueError):
        descriptors = [int(word) for word in text.split(",")]
        if all(stat.S_ISFIFO(os.fstat(descriptor).st_mode) for descriptor in descriptors):
            return descriptors
    return ()


def _until_end(descriptor: int, deadline: float | None) -> None:
    """Waits until the other end of a pipe is closed, or until a deadline [s]."""
    poll = select.poll()
    poll.register(descriptor, 0)  # an end is told unasked
    left = None if deadline is None else 1e3 * max(deadline - time.monotonic(), 0.0)
    poll.poll(left)
