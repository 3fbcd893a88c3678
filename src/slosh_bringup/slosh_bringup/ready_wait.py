"""Tracks which nodes of a cell are not ready, why, and how long to wait for them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

from slosh_bringup.cell_watch import NodeReport
from slosh_msgs_py.node.readiness import READY, RECORDED, STATE

TELLING = ("estimator", "camera", "sensor", "monitor")
"""The nodes that publish their settings."""

PATIENCE = 60.0
"""So long a node may say nothing before it is ready [s]: it may have to share a busy machine."""
STUCK = 10.0
"""So many times as long it may say the same: one step of a compilation takes minutes there."""
RECORDING = 15.0
"""So long all may wait for the recorder to hear what they work with, without which no bag replays.

A busy machine's middleware takes three seconds, and as long again for each message it lost [s].
"""
UNHEARD = "no diagnostics received yet"
_INCOMPLETE = "incomplete"


class _Word(NamedTuple):
    """A node's last diagnostics: level, text, and when it was first and last received [s]."""

    state: str
    sentence: str
    first: float
    last: float


class ReadyWait:
    """Tracks the diagnostics of a cell's nodes until all are ready.

    Args:
        nodes: names of those that must be ready. Others are waited for once they have been heard
            of, until they are ready, too.
        now: steady time [s].
        patience: as PATIENCE.

    Attributes:
        unrecorded: nodes that are at work and whose settings the recorder has not heard.
    """

    def __init__(self, nodes: Collection[str], now: float, patience: float = PATIENCE) -> None:
        self._patience = patience
        self._words = {node: _Word("", UNHEARD, now, now) for node in nodes}
        self._at_work: float | None = None
        self.unrecorded: tuple[str, ...] = ()

    def take(self, report: NodeReport, now: float) -> None:
        """Stores a node's diagnostics, received at a monotonic time [s]."""
        state, said = report.facts.get(STATE, READY), report.sentence
        if RECORDED in report.facts and self._is_incomplete(report, now):
            state, said = (
                _INCOMPLETE,
                f"has not received the settings of {', '.join(self.unrecorded)}",
            )
        before = self._words.get(report.node)
        same = before is not None and (before.state, before.sentence) == (state, said)
        first = before.first if before is not None and same else now
        self._words[report.node] = _Word(state, said, first, now)

    def _is_incomplete(self, recorder: NodeReport, now: float) -> bool:
        """Whether the recorder still lacks settings of other nodes and it is worth waiting."""
        recorded = recorder.facts[RECORDED].split(", ")
        self.unrecorded = tuple(
            node for node in TELLING if node in self._words and node not in recorded
        )
        if self._at_work is None and self.missing().keys() <= {recorder.node}:
            self._at_work = now
        waited = 0.0 if self._at_work is None else now - self._at_work
        return bool(self.unrecorded) and waited < RECORDING

    def missing(self) -> dict[str, str]:
        """Returns the reasons why nodes are not ready, by node name; ready nodes are left out."""
        return {
            node: word.sentence.removeprefix("not ready, ")
            for node, word in self._words.items()
            if word.state != READY
        }

    def given_up(self, now: float) -> str:
        """Returns why further waiting for the nodes is pointless; empty while waiting makes sense.

        Args:
            now: steady time [s].
        """
        for node in self.missing():
            word = self._words[node]
            if now - word.last > self._patience:
                said = f": {word.sentence}" if word.state else ""
                return f"{node} has sent no diagnostics for {now - word.last:.0f} s{said}"
            if now - word.first > STUCK * self._patience:
                return f"{node} has reported for {now - word.first:.0f} s: {word.sentence}"
        return ""


def sentence(missing: Mapping[str, str]) -> str:
    """Lists the nodes that are not ready in one sentence, grouped by reason."""
    together: dict[str, list[str]] = {}
    for node, why in missing.items():
        together.setdefault(why, []).append(node)
    return ", ".join(f"{', '.join(nodes)} ({why})" for why, nodes in together.items())
