"""Handles SIGINT, SIGTERM and SIGHUP as requests to stop: nodes end, the report is written."""

from __future__ import annotations

import contextlib
import errno
import math
import os
import select
import signal
import time
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any, NoReturn

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
READER_GONE = (errno.EIO, errno.EPIPE, errno.EBADF)
"""Errors of a write to a terminal or a pipe that has gone; a full disk is another matter."""
_STREAMS = (0, 1, 2)
_GONE = select.POLLHUP | select.POLLERR | select.POLLNVAL
_SAME_HANG_UP = 1.0  # s; a closed terminal is told by the kernel and again by the shell


class StopRequest:
    """Records stop signals inside a `with` block, without interrupting the run.

    Attributes:
        reason: what asked for the end, as a user knows it; empty: nothing yet.
    """

    def __init__(self) -> None:
        self.reason = ""
        self._leave: Callable[[], NoReturn] | None = None
        self._hung_up = -math.inf
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> StopRequest:
        for number in SIGNALS:
            # nohup has SIGHUP ignored, and means it.
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                self._before[number] = signal.signal(number, self._take)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @contextlib.contextmanager
    def finishing(self, leave: Callable[[], NoReturn]) -> Iterator[None]:
        """Lets a second stop signal end the process at once while the report is written.

        An exception would not do: raised while a library loads compiled code, it is lost there
        or takes the process down with SIGSEGV (measured: 41 and 1 of 300 signals in the first
        50 ms).

        Args:
            leave: ends the process; called by the signal, between any two steps of the work.
        """
        self._leave = leave
        try:
            yield
        finally:
            self._leave = None

    def written_in_vain(self, error: OSError) -> None:
        """Handles a failed write; it counts as a stop request if the output's reader is gone.

        Over ssh without a terminal there is no signal that tells it.
        """
        if error.errno in READER_GONE:
            self._hang_up()

    def _hang_up(self) -> None:
        self.reason = self.reason or signal.SIGHUP.name
        forget_readers()

    def _take(self, number: int, frame: FrameType | None) -> None:
        asked = bool(self.reason)
        if number == signal.SIGHUP:
            before, self._hung_up = self._hung_up, time.monotonic()
            asked = asked and self._hung_up - before > _SAME_HANG_UP
            self._hang_up()
        self.reason = self.reason or signal.Signals(number).name
        if self._leave is not None and asked:
            self._leave()


def forget_readers() -> None:
    """Redirects standard streams whose terminal or reader is gone to /dev/null.

    Writing to them fails from then on, and a run must not end by its last words.
    """
    poll = select.poll()
    for stream in _STREAMS:
        poll.register(stream, 0)
    gone = [stream for stream, event in poll.poll(0) if event & _GONE]
    if not gone:
        return
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in gone:
        os.dup2(nowhere, stream)
    os.close(nowhere)
