"""Shows and tells what the nodes of a live run say of themselves."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from slosh_bag.replay.settings import NodeStart
from slosh_bringup.cell_watch import CellWatch, NodeReport
from slosh_bringup.in_force import TELLING, in_force_lines, settings_document
from slosh_files import write_text


class Screen(Protocol):
    """Whoever watches a run."""

    def show(self, elapsed: float, text: str) -> None:
        """Is shown how long it has taken [s] and what is going on, ten times a second."""

    def tell(self, line: str) -> None:
        """Is told what has happened."""


class LiveWatch:
    """Takes what the nodes say.

    Args:
        settings: file of what the nodes work with, written anew whenever one tells.
        nodes: names of those that are expected to report.
        screen: of whoever watches.
    """

    def __init__(self, settings: Path, nodes: Sequence[str], screen: Screen) -> None:
        self._file, self._screen = settings, screen
        self._started = time.monotonic()
        self._watch = CellWatch(nodes, self._started)
        self._starts: dict[str, NodeStart] = {}

    @property
    def elapsed(self) -> float:
        """Since the start [s]."""
        return time.monotonic() - self._started

    @property
    def began(self) -> bool:
        """Whether all nodes are at work."""
        return self._starts.keys() >= set(TELLING)

    def take_settings(self, start: NodeStart) -> None:
        """Takes what a node works with, at its start or later."""
        began, self._starts[start.node] = self.began, start
        write_text(self._file, settings_document(self._starts))
        if self.began and not began:
            self._screen.tell("in force:")
            for line in in_force_lines(self._starts):
                self._screen.tell(f"  {line}")

    def take_report(self, report: NodeReport) -> None:
        """Takes what a node says of its health."""
        self._tell(self._watch.take(report, time.monotonic()))

    def look(self) -> None:
        """Looks at the clock; several times a second."""
        self._tell(self._watch.look(time.monotonic()))
        self._screen.show(self.elapsed, "")

    def _tell(self, lines: Sequence[str]) -> None:
        for line in lines:
            self._screen.tell(f"{self.elapsed:7.1f} s  {line}")
