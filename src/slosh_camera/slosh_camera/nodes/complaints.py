"""Error lines of a node that may have the same to say sixty times a second."""

from __future__ import annotations

from collections.abc import Callable

from slosh_base.files.nanoseconds import SECOND

PERIOD_NS = 5 * SECOND
_MOST = 5


class Complaints:
    """Tells each complaint once in a period, and no more than a few different ones.

    Args:
        tell: takes a line.
    """

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._told: set[str] = set()
        self._begin_ns: int | None = None
        self.last = ""

    def add(self, complaint: str, now_ns: int) -> None:
        """Tells a complaint, unless it has just been told.

        Args:
            complaint: one line.
            now_ns: by a clock that never jumps [ns].
        """
        self.last = complaint
        if self._begin_ns is None or now_ns - self._begin_ns >= PERIOD_NS:
            self._begin_ns, self._told = now_ns, set()
        if complaint not in self._told and len(self._told) < _MOST:
            self._told.add(complaint)
            self._tell(complaint)
