"""Restarts nodes of a live run that have ended or hang, while the other nodes continue."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence

from slosh_bringup.cell_watch import SILENT
from slosh_bringup.live.other_cells import OtherCells
from slosh_bringup.processes import (
    EXIT_WRONG_INPUT,
    LAST,
    NodeEnd,
    NodeGroup,
    NodeProcess,
    restarted,
)
from slosh_msgs_py.node.dead_ports import DeadPorts

ATTEMPTS, WITHIN = 5, 60.0
"""A node that ends so often within so long [s] is not started again."""
HANGS = 30.0
"""A process that says nothing for so long, though others are heard, is of no use [s].

It was stopped, it hangs, or nobody hears it since a neighbour was killed. A busy machine takes a
third of that to start one.
"""


class Supervision:
    """Monitors the node processes of a live run and restarts them.

    Args:
        group: the nodes.
        processes: how they were started.
        tell: is told what has happened, in a line.
        others: is told of each start.

    Attributes:
        problems: what was told, for the report.
    """

    def __init__(
        self,
        group: NodeGroup,
        processes: Sequence[NodeProcess],
        tell: Callable[[str], None],
        others: OtherCells,
    ) -> None:
        self._group, self._tell, self._others = group, tell, others
        self._processes = {process.name: process for process in processes}
        self._ends: dict[str, list[float]] = {}
        self._started: dict[str, float] = {}
        self._dead_ports = DeadPorts()
        self.problems: list[str] = []

    def look(self, *, began: bool, silences: Mapping[str, float]) -> NodeEnd | None:
        """Restarts a node that has ended and kills one that hangs; call it regularly.

        Args:
            began: whether all were at work before; if not, what keeps one from it keeps it again.
            silences: for how long each node has said nothing [s].

        Returns:
            an end that ends the run: of a node that was not at work yet or that refuses its
            parameters; None: the run goes on.
        """
        now = time.monotonic()
        end = self._group.failed()
        if end is None and began:
            self._end_hanging(silences, now)
        if end is None or not began or end.code == EXIT_WRONG_INPUT:
            return end
        self._dead_ports.look(close=True)
        self._ends.setdefault(end.name, []).append(now)
        recent = sum(now - at < WITHIN for at in self._ends[end.name])
        self._group.forget(end.name)
        if recent > ATTEMPTS:
            self._say(f"{end.text}; for the {recent}th time: the cell continues without it")
            return None
        process = restarted(self._processes[end.name], len(self._ends[end.name]))
        self._group.start(process)
        self._started[process.name] = now
        self._others.started(process.name, now)
        where = f", recording to {process.parameters['output']}" if end.name == LAST else ""
        self._say(f"{end.text}; it is restarted{where}")
        return None

    def end_deaf(self, deaf: Mapping[str, str]) -> None:
        """Kills nodes that fail to receive a topic that other subscribers receive.

        Args:
            deaf: the topic, by node.
        """
        for name, topic in deaf.items():
            if self._group.kill(name):
                self._say(
                    f"node {name} receives nothing on {topic}, although other nodes do: "
                    "it is killed"
                )

    def _end_hanging(self, silences: Mapping[str, float], now: float) -> None:
        """Kills nodes without recent diagnostics, unless none are received from any node."""
        if all(silence > SILENT for silence in silences.values()):
            return
        for name, silence in silences.items():
            mute = min(silence, now - self._started.get(name, -math.inf))
            if mute > HANGS and self._group.kill(name):
                # It counts from here, however long the end takes.
                self._started[name] = now
                self._say(
                    f"node {name} runs but has sent no diagnostics for {mute:.0f} s: it is killed"
                )

    def _say(self, line: str) -> None:
        self.problems.append(line)
        self._tell(line)
