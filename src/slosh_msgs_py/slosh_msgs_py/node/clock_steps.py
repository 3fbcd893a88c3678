"""A system clock that is set back must not stop a node's timers.

The condition variables of libraries that were built for old systems wait until a moment of the
system's clock, even where a steady one was asked for; rclpy and Fast DDS as wheels are among them.
Set back by an hour meanwhile, by a time server say, the executor's timers wait an hour longer:
no diagnostics, and a recorder that takes nothing. So the clock is watched by a wait that is
steady, and the timers are set anew, which wakes whoever waits for them.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable

from rclpy.exceptions import InvalidHandle
from rclpy.node import Node

PERIOD = 0.25
"""How long it takes at most until a step is noticed [s]."""
STEP_NS = 50_000_000
"""From here on it is a step [ns]: a clock that is slewed goes wrong by a thousandth at most."""


def watch_clock(set_back: Callable[[], None]) -> None:
    """Calls a function, in a thread of its own, whenever the system's clock was set back."""
    threading.Thread(target=_watch, args=(set_back,), name="clock steps", daemon=True).start()


def wake_timers(node: Node) -> None:
    """Has all of a node's timers wait anew, a whole period each."""
    for timer in list(node.timers):
        with contextlib.suppress(InvalidHandle):  # the node has ended meanwhile
            timer.reset()


def _watch(set_back: Callable[[], None]) -> None:
    never = threading.Event()
    before = _ahead()
    while not never.wait(PERIOD):
        now = _ahead()
        if now < before - STEP_NS:
            set_back()
        before = now


def _ahead() -> int:
    """By how much the system's clock is ahead of the steady one [ns]."""
    return time.time_ns() - time.monotonic_ns()
