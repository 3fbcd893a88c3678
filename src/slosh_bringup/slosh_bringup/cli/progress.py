"""Shows the progress of long operations on standard error.

A terminal gets a bar, whose numbers and unit stay whole on narrow ones. A pipe, a file and a dumb
terminal get a plain line now and then: they keep all that they are told.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TextIO

from tqdm import tqdm
from tqdm.std import Bar
from tqdm.utils import disp_len, disp_trim

LINE_PERIOD = 10.0
"""Seconds from one plain line to the next, at least."""
LINE_SHARE = 0.1
"""And so much is done between them, of the whole or, where it is not known, of what was done."""
SHORT = 1.0
"""What ends or fails within so many seconds needs no progress."""
STOPPING = "stopping"
_DRAW_PERIOD = 0.1
_LONGEST_BAR, _SHORTEST_BAR = 30, 3
_COLUMNS = 80

Tell = Callable[[float, str], None]


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit in which the progress of an operation is shown.

    Attributes:
        name: e.g. 's'; empty: only the share is told.
        digits: behind the point.
        scale: of the number that is told to the amount.
    """

    name: str
    digits: int = 0
    scale: float = 1.0

    def amount(self, done: float, total: float | None) -> str:
        """Formats an amount, e.g. '2.0/13.4 s', or '2.0 s' if the total is unknown."""
        if not self.name:
            return ""
        numbers = [done] if total is None else [done, total]
        told = "/".join(f"{number * self.scale:.{self.digits}f}" for number in numbers)
        return f"{told} {self.name}"


IN_SECONDS, IN_MEGABYTES, SHARE = Unit("s", 1), Unit("MB", 1, 1e-6), Unit("")
MESSAGES = Unit("messages")


class Progress:
    """Progress of an operation, used as a context manager.

    Args:
        title: what is done.
        total: the amount in all; None: not known.
        unit: of the amount.
        delay: nothing is shown before so many seconds.
        quiet: nothing is shown at all.

    Attributes:
        done: the amount so far.
        text: what is being done, beside the title.
    """

    def __init__(
        self,
        title: str,
        total: float | None,
        unit: Unit,
        *,
        delay: float = SHORT,
        quiet: bool = False,
    ) -> None:
        self.title, self.total, self.unit = title, total, unit
        self.done, self.text = 0.0, ""
        self._view: _Bar | _Lines | None = None
        if not quiet:
            draws = can_draw(sys.stderr)
            self._view = _Bar(self, delay) if draws else _Lines(self, sys.stderr, delay)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        if self._view is not None:
            self._view.end(failed=kind is not None)

    def add(self, amount: float = 1.0) -> None:
        """Adds to the amount of work done, and updates the display."""
        self.reach(self.done + amount)

    def reach(self, done: float, text: str = "") -> None:
        """Sets the amount of work done so far and describes the current activity."""
        changed, self.done, self.text = text != self.text, done, text
        if self._view is not None:
            self._view.show(at_once=changed)

    def of(self, done: float, total: float) -> None:
        """Sets both the amount of work done and the total amount of work."""
        self.total = total
        self.reach(done)

    @property
    def share(self) -> float | None:
        """Fraction of the total work that is done, at most 1, or None if the total is unknown."""
        if self.total is None:
            return None
        return min(max(self.done / self.total, 0.0), 1.0) if self.total else 1.0

    @property
    def head(self) -> str:
        """Title of the operation and the current activity."""
        return f"{self.title}: {self.text}" if self.text else self.title

    @property
    def numbers(self) -> list[str]:
        """Fraction done and amount done, as text; unknown values are left out."""
        # Rounded down: what says 100% is done.
        share = [] if self.share is None else [f"{math.floor(100.0 * self.share + 1e-9):3}%"]
        amount = self.unit.amount(self.done, self.total)
        return [*share, amount] if amount else share


def can_draw(stream: TextIO) -> bool:
    """Whether the stream is a terminal that can show a progress bar."""
    return stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def say(line: str) -> None:
    """Prints a line on standard error without disturbing a progress bar."""
    tqdm.write(line, file=sys.stderr)


class _Bar(tqdm):
    """Progress display that draws a bar in one line, using tqdm."""

    def __init__(self, progress: Progress, delay: float) -> None:
        self._progress = progress
        super().__init__(file=sys.stderr, mininterval=_DRAW_PERIOD, miniters=0, delay=delay)

    def show(self, *, at_once: bool) -> None:
        self.update(self._progress.done - self.n)
        if at_once:
            self.refresh()

    def end(self, *, failed: bool) -> None:
        self.n = self._progress.done
        self.close()

    def __str__(self) -> str:
        progress = self._progress
        charset = Bar.ASCII if self.ascii else Bar.UTF
        # In the last column a terminal may break the line.
        columns = _columns(self.fp) - 1
        return bar_line(progress.head, progress.share, progress.numbers, columns, charset)


def bar_line(
    head: str, share: float | None, numbers: list[str], columns: int, charset: str = Bar.UTF
) -> str:
    """Formats a progress line of limited width; drops the bar first, then the title.

    Args:
        head: what is done.
        share: for the bar; None: there is none.
        numbers: stand behind the head and behind the bar.
        columns: of the terminal.
        charset: what a bar is made of, from empty to full.
    """
    first, *rest = numbers
    room = columns - disp_len(": ".join([head, " ".join(numbers)]))
    bar = ""
    if share is not None and room >= _SHORTEST_BAR + 2:
        bar = f"|{Bar(share, min(_LONGEST_BAR, room - 2), charset)}|"
    told = " ".join([first + bar, *rest])
    head_room = max(columns - disp_len(told) - 2, 0)
    if disp_len(head) > head_room:
        head = disp_trim(head, head_room - 2) + ".." if head_room > 2 else ""
    return str(disp_trim(f"{head}: {told}" if head else told, max(columns, 1)))


class _Lines:
    """Prints progress as plain lines: at the start, at the end and sometimes in between."""

    def __init__(self, progress: Progress, stream: TextIO, delay: float) -> None:
        self._progress, self._stream = progress, stream
        self._due = time.monotonic() + delay
        self._told: tuple[str, float] | None = None
        if not delay:
            self._print()

    def show(self, *, at_once: bool) -> None:
        # At once: what is being done has changed, which it does a few times at most.
        due = time.monotonic() >= self._due
        if at_once or (due and (self._told is None or self._has_grown(self._told[1]))):
            self._print()

    def end(self, *, failed: bool) -> None:
        if self._told is not None and not failed and self._line() != self._told[0]:
            self._print()

    def _has_grown(self, before: float) -> bool:
        progress = self._progress
        whole = before if progress.total is None else progress.total
        return abs(progress.done - before) >= LINE_SHARE * whole

    def _print(self) -> None:
        self._told = self._line(), self._progress.done
        self._due = time.monotonic() + LINE_PERIOD
        print(self._told[0], file=self._stream, flush=True)

    def _line(self) -> str:
        told = ", ".join(number.strip() for number in self._progress.numbers)
        return f"{self._progress.head}: {told}"


def _columns(stream: Any) -> int:
    try:
        return os.get_terminal_size(stream.fileno()).columns or _COLUMNS
    except (OSError, ValueError):
        return _COLUMNS


@contextmanager
def progress_bar(title: str, length: float, *, quiet: bool = False) -> Iterator[Tell]:
    """Shows progress over an expected duration [s]; completes the bar at a normal end."""
    stopped = False
    with Progress(title, length, IN_SECONDS, delay=0.0, quiet=quiet) as progress:

        def tell(elapsed: float, text: str) -> None:
            nonlocal stopped
            stopped = text == STOPPING
            progress.reach(min(elapsed, length), "" if stopped else text)

        yield tell
        if not stopped:
            progress.reach(length)


@contextmanager
def clock(title: str) -> Iterator[Tell]:
    """Shows the elapsed time of an operation of unknown duration."""
    with Progress(title, None, Unit("s"), delay=0.0) as progress:
        yield lambda elapsed, text: progress.reach(elapsed, "" if text == STOPPING else text)


@contextmanager
def share_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """Shows progress given as a fraction from 0 to 1, with the current activity."""
    with Progress(title, 1.0, SHARE, delay=0.0) as progress:
        yield lambda text, share: progress.reach(share, text)


def item_progress(title: str, count: int, unit: str) -> Progress:
    """Shows progress over a number of items; shows nothing for a single item."""
    return Progress(title, count, Unit(unit), quiet=count <= 1)
