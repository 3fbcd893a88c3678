"""Who of a cell's nodes is not ready yet, why, and how long they are waited for."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

from slosh_bringup.cell_watch import NodeReport
from slosh_msgs_py.node.readiness import READY, STATE

PATIENCE = 60.0
"""So long a node may say nothing before it is ready [s]: it may have to share a busy machine."""
STUCK = 10.0
"""So many times as long it may say the same: one step of a compilation takes minutes there."""


class _Word(NamedTuple):
    """What a node has said last: its state, its sentence, when it said so first and last [s]."""

    state: str
    sentence: str
    first: float
    last: float


class ReadyWait:
    """Takes the nodes' reports until all are ready.

    Args:
        nodes: names of those that must be ready. Others are waited for once they have been heard
            of, until they are ready, too.
        now: steady time [s].
        patience: as PATIENCE.
    """

    def __init__(self, nodes: Collection[str], now: float, patience: float = PATIENCE) -> None:
        self._patience = patience
        self._words = {node: _Word("", "not heard of yet", now, now) for node in nodes}

    def take(self, report: NodeReport, now: float) -> None:
        """Takes a report at a moment of the steady clock [s]."""
        state = report.facts.get(STATE, READY)
        before = self._words.get(report.node)
        same = before is not None and (before.state, before.sentence) == (state, report.sentence)
        first = before.first if before is not None and same else now
        self._words[report.node] = _Word(state, report.sentence, first, now)

    def missing(self) -> dict[str, str]:
        """Why each node that is not ready is not."""
        return {
            node: word.sentence.removeprefix("not ready, ")
            for node, word in self._words.items()
            if word.state != READY
        }

    def given_up(self, now: float) -> str:
        """Why there is no sense in waiting longer; empty: there is.

        Args:
            now: steady time [s].
        """
        for node in self.missing():
            word = self._words[node]
            if now - word.last > self._patience:
                said = f": {word.sentence}" if word.state else ""
                return f"{node} has not been heard of for {now - word.last:.0f} s{said}"
            if now - word.first > STUCK * self._patience:
                return f"{node} has said for {now - word.first:.0f} s: {word.sentence}"
        return ""


def sentence(missing: Mapping[str, str]) -> str:
    """Who is waited for, and why; those of one reason together."""
    together: dict[str, list[str]] = {}
    for node, why in missing.items():
        together.setdefault(why, []).append(node)
    return ", ".join(f"{', '.join(nodes)} ({why})" for why, nodes in together.items())
