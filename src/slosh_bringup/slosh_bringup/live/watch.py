"""Processes and shows the diagnostics of a live run's nodes."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from slosh_base.files import write_text
from slosh_bringup.cell_watch import CellWatch, NodeReport
from slosh_bringup.ready_wait import TELLING, UNHEARD, ReadyWait, sentence
from slosh_bringup.watch.verdict import judge
from slosh_estimator.limits import Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_motion.recorded.settings import NodeStart, after
from slosh_msgs_py.node.readiness import COMPILING, READY, STATE, WAITING
from slosh_replay.in_force import in_force_lines, settings_document

LATE = 10.0
"""A node of which nothing was heard for so long is named in a log [s]."""

RATES = {"camera": "measurement [Hz]", "estimator": "output [Hz]"}
"""Whose rates are shown, and the fact that tells it."""


class Screen(Protocol):
    """Interface of the display of a live run, such as a terminal."""

    def show(self, elapsed: float, text: str, status: str = "") -> None:
        """Shows the elapsed time [s] and the cell's state; called ten times a second.

        A status is what holds at this moment, in place of the text: nothing for a log, which
        keeps what it is told.
        """

    def tell(self, line: str) -> None:
        """Shows a line of text permanently."""


class LiveWatch:
    """Processes the messages of a live run's nodes and updates the display.

    Before all are ready it tells who is waited for; from then on how their health changes.

    Args:
        settings: file of what the nodes work with, written anew whenever one tells.
        nodes: names of those that must be ready.
        screen: of whoever watches.
        ready: what to tell when they are.
    """

    def __init__(self, settings: Path, nodes: Sequence[str], screen: Screen, ready: str) -> None:
        self._file, self._screen, self._ready = settings, screen, ready
        self._started = self._began = time.monotonic()
        self._nodes = nodes
        self._wait = ReadyWait(nodes, self._started)
        self._health: CellWatch | None = None
        self._starts: dict[str, NodeStart] = {}
        self._told: dict[str, str] = {}
        self._status = CellStatus()

    @property
    def began(self) -> bool:
        """Whether all nodes have been ready, so that the run has begun."""
        return self._health is not None

    @property
    def waits_for(self) -> str:
        """Describes which nodes are not ready, and why."""
        return f"waiting for {sentence(self._wait.missing()) or 'the settings of the nodes'}"

    @property
    def given_up(self) -> str:
        """The reason why the run stopped waiting for its nodes; empty while it waits."""
        return "" if self.began else self._wait.given_up(time.monotonic())

    @property
    def silences(self) -> dict[str, float]:
        """Returns the time since each node's last diagnostics [s]; empty before all are ready."""
        return {} if self._health is None else self._health.silences(time.monotonic())

    @property
    def unheard(self) -> dict[str, str]:
        """Returns the topics that nodes do not receive, by node; empty before all are ready."""
        return {} if self._health is None else self._health.unheard()

    def take_settings(self, start: NodeStart) -> None:
        """Stores, displays and saves the settings that a node of this run publishes."""
        if start.node not in self._nodes:
            return
        self._starts[start.node] = after(self._starts.get(start.node), start)
        if start.changed and self._health is not None:
            values = ", ".join(f"{name} {start.parameters[name]}" for name in start.changed)
            self._tell([f"{start.node}: changed to {values}"])
        self._status.take_parameters(start.node, start.parameters)
        try:
            write_text(self._file, settings_document(self._starts))
        except OSError as error:  # a full disk ends no run: the recorder waits for room, too
            self._tell([f"{self._file}: {error.strerror}"])
        self._begin()

    def take_report(self, report: NodeReport) -> None:
        """Stores and evaluates the diagnostics of one node."""
        now = time.monotonic()
        self._status.take_report(report)
        if self._health is not None:
            self._tell(self._health.take(report, now))
            return
        self._wait.take(report, now)
        self._tell_readiness(report)
        self._begin()

    def take_comparison(self, comparison: Any) -> None:
        """Stores the newest SloshComparison message (measured, estimated height), for display."""
        heights = comparison.measured, comparison.estimated_nonlinear
        self._status.take_comparison(
            *heights, comparison.state, time.monotonic(),
            alone=comparison.without_camera, disagree=comparison.sides_disagree,
        )  # fmt: skip

    def look(self) -> None:
        """Updates status line and timeouts; call this several times a second."""
        now = time.monotonic()
        if self._health is None:
            self._screen.show(0.0, self._waits_for_in_short(now), self.waits_for)
            return
        self._tell(self._health.look(now))
        self._screen.show(now - self._began, "", self._status.line(now))

    def tell(self, line: str) -> None:
        """Shows a permanent line of text for another part of the program."""
        self._tell([line])

    def _tell_readiness(self, report: NodeReport) -> None:
        """Shows which nodes take long to become ready, and when they are ready."""
        state = report.facts.get(STATE, READY)
        text = "compiling, once on this machine" if state == COMPILING else ""
        text = report.sentence if state == WAITING else text
        before, self._told[report.node] = self._told.get(report.node, ""), text
        if text != before:
            self._tell([f"{report.node}: {text or 'ready'}"])

    def _waits_for_in_short(self, now: float) -> str:
        """Returns a short description of the nodes that are not ready."""
        missing = self._wait.missing() if now - self._started > LATE else {}
        silent = {node: why for node, why in missing.items() if why == UNHEARD}
        return f"waiting for {sentence(silent) or 'the nodes'}"

    def _begin(self) -> None:
        """Shows the settings in effect once all nodes are ready."""
        if (
            self.began
            or self._wait.missing()
            or not self._starts.keys() >= {*TELLING} & {*self._nodes}
        ):
            return
        self._began = time.monotonic()
        self._health = CellWatch(self._nodes, self._began)
        self._screen.tell("parameters in effect:")
        for line in in_force_lines(self._starts):
            self._screen.tell(f"  {line}")
        self._tell([self._ready])
        if self._wait.unrecorded:
            names = ", ".join(self._wait.unrecorded)
            self._tell(
                [
                    f"the recorder has not received the settings of {names}: the bag cannot be "
                    "replayed"
                ]
            )

    def _tell(self, lines: Sequence[str]) -> None:
        for line in lines:
            self._screen.tell(f"{time.monotonic() - self._started:7.1f} s  {line}")


class CellStatus:
    """Formats the state of a cell in one line, from its nodes' messages."""

    def __init__(self) -> None:
        self._state: int | None = None
        self._alone = self._disagree = False
        self._measured = self._estimated = math.nan
        self._settings = MonitorSettings()
        self._at = -math.inf
        self._rates: dict[str, float] = {}

    def take_comparison(
        self,
        measured: float,
        estimated: float,
        state: int,
        now: float,
        *,
        alone: bool = False,
        disagree: bool = False,
    ) -> None:
        """Stores the newest measured and estimated heights [m] and the monitor's state.

        Args:
            measured, estimated, state, now: see above.
            alone: there is no camera by choice.
            disagree: camera and model disagree.
        """
        self._measured, self._estimated = measured, estimated
        self._state, self._at = state, now
        self._alone, self._disagree = alone, disagree

    def take_report(self, report: NodeReport) -> None:
        """Stores the message rates in a node's diagnostics."""
        if report.node in RATES:
            # Whoever speaks on that topic may say anything.
            with contextlib.suppress(KeyError, ValueError):
                self._rates[report.node] = float(report.facts[RATES[report.node]])

    def take_parameters(self, node: str, parameters: Mapping[str, Any]) -> None:
        """Stores the height limits from a node's parameters if the node is the monitor."""
        if node == "monitor":
            self._settings = MonitorSettings.from_partial(parameters)

    def line(self, now: float) -> str:
        """Formats state, heights, limit and message rates in one line."""
        verdict, reason = judge(
            self._state, now - self._at, alone=self._alone, disagree=self._disagree
        )
        words = [verdict.value.upper()]
        if now - self._at > 1.0:
            words.append(reason)
        elif self._alone:
            limit = self._limit(Source.ESTIMATED)
            words.append(f"estimated {_shown(self._estimated)} of {limit}, no camera")
        else:
            heights = f"measured {_shown(self._measured)}, estimated {_shown(self._estimated)}"
            words.append(f"{heights} of {self._limit(Source.MEASURED)}")
        rates = [f"{node} {rate:.0f} Hz" for node, rate in self._rates.items()]
        return " · ".join([*words, *rates])

    def _limit(self, source: Source) -> str:
        """Formats the height limit in effect for a source of heights, such as measured."""
        rim = f" ({self._settings.limit_name(source)})" * self._settings.at_rim(source)
        return f"{_shown(self._settings.limits[source])} mm{rim}"


def _shown(height: float) -> str:
    return f"{1e3 * height:.1f}" if math.isfinite(height) else "–"
