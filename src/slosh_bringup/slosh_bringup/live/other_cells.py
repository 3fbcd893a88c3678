"""Detects another cell in this cell's namespace, whose messages would mix with this cell's.

The graph tells: each name of a node that is there once more than this cell has started it. It may
tell late on a busy machine, and the other cell may come later, so it is asked as long as the cell
runs, and nobody waits for the answer.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from slosh_msgs_py.node.rivals import FORGOTTEN

PERIOD = 1.0
"""How often to look [s]."""


class OtherCells:
    """Compares the nodes found in the namespace with the nodes of this cell."""

    def __init__(self) -> None:
        self._starts: dict[str, deque[float]] = {}
        self._seen: frozenset[str] = frozenset()
        self._told: frozenset[str] = frozenset()

    def started(self, name: str, now: float) -> None:
        """Records the monotonic time [s] at which a node of this cell was started."""
        self._starts.setdefault(name, deque()).append(now)

    def look(self, running: Mapping[str, int], now: float) -> list[str]:
        """Returns names of newly found nodes in this namespace that are not of this cell.

        Two looks in a row have to agree: nodes appear one after the other, and are told together.

        Args:
            running: how often each name is in the graph.
            now: steady time [s].
        """
        foreign = frozenset(
            name for name, count in running.items() if count > self._own(name, now)
        )
        before, self._seen = self._seen, foreign
        if foreign != before or foreign == self._told:
            return []
        news, self._told = foreign - self._told, foreign
        return sorted(foreign) if news else []

    def _own(self, name: str, now: float) -> int:
        """Returns how many nodes of a name belong to this cell, counting recently killed ones."""
        starts = self._starts.get(name)
        if not starts:
            return 0
        while len(starts) > 1 and now - starts[1] > FORGOTTEN:
            starts.popleft()
        return len(starts)
