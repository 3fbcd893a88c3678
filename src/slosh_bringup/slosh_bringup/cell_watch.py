"""Follows the diagnostics of a running cell's nodes and selects lines to print."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from slosh_base.files.plain_text import plain_line
from slosh_msgs_py.node.silence import UNHEARD

OK, WARN, ERROR, STALE = range(4)
"""Levels of diagnostic_msgs/DiagnosticStatus."""
SILENT = 5.0
"""A node that reports once a second has not done so for this long [s]."""
_NUMBER = re.compile(r"\d+(\.\d+)?")


class NodeReport(NamedTuple):
    """The diagnostics that one node publishes about itself.

    Attributes:
        node: its name, without namespace.
        level: OK, WARN, ERROR or STALE.
        sentence: on its health.
        facts: the rest.
    """

    node: str
    level: int
    sentence: str
    facts: Mapping[str, str]


class _Heard:
    """The last diagnostics received from a node, and when."""

    def __init__(self, now: float) -> None:
        self.at = now
        self.newest = self.told = self.unheard = ""
        self.silent = False


class CellWatch:
    """Converts the diagnostics of a cell's nodes to lines to print.

    A change of health is told once two reports in a row agree on it, whatever their numbers: what
    comes and goes within a second fills screens and helps nobody.

    Args:
        nodes: names of those that are expected.
        now: steady time [s].
    """

    def __init__(self, nodes: Sequence[str], now: float) -> None:
        self._heard = {node: _Heard(now) for node in nodes}

    def take(self, report: NodeReport, now: float) -> list[str]:
        """Stores a node's diagnostics at a monotonic time [s]; returns the lines to print."""
        heard = self._heard.get(report.node)
        if heard is None:
            return []
        heard.at, heard.silent = now, False
        heard.unheard = report.facts.get(UNHEARD, "")
        # Health that is good has many sentences, and none is news.
        kind = "" if report.level == OK else _NUMBER.sub("#", f"{report.level} {report.sentence}")
        before, heard.newest = heard.newest, kind
        if kind != before or kind == heard.told:
            return []
        heard.told = kind
        return [f"{report.node}: {report.sentence if kind else f'OK again: {report.sentence}'}"]

    def silences(self, now: float) -> dict[str, float]:
        """Returns the time since the last diagnostics of each node [s], by node name."""
        return {node: now - heard.at for node, heard in self._heard.items()}

    def unheard(self) -> dict[str, str]:
        """Returns, by node name, the topic and type whose messages the node does not receive."""
        return {node: heard.unheard for node, heard in self._heard.items() if heard.unheard}

    def look(self, now: float) -> list[str]:
        """Returns lines to print about nodes that have stopped publishing diagnostics."""
        lines = []
        for node, heard in self._heard.items():
            if not heard.silent and now - heard.at > SILENT:
                heard.silent = True
                lines.append(f"{node}: no diagnostics for {now - heard.at:.0f} s")
        return lines


def reports(message: Any, namespace: str) -> Iterator[NodeReport]:
    """Yields the diagnostics of the nodes in one namespace from a DiagnosticArray."""
    prefix = f"{namespace.rstrip('/')}/"
    for status in message.status:
        name = status.name.removeprefix(prefix)
        if status.name.startswith(prefix) and "/" not in name:
            facts = {plain_line(pair.key): plain_line(pair.value) for pair in status.values}
            yield NodeReport(name, _number(status.level), plain_line(status.message), facts)


def _number(level: bytes | int) -> int:
    """Converts a diagnostic level to an int; rclpy gives bytes, bag readers give a number."""
    return ord(level) if isinstance(level, bytes) else int(level)
