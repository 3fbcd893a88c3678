"""What a running cell does, in one line for its terminal."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from typing import Any

from slosh_bringup.cell_watch import NodeReport
from slosh_bringup.watch.verdict import judge
from slosh_estimator.limits import Source
from slosh_estimator.monitor_settings import MonitorSettings

RATES = {"camera": "measurement [Hz]", "estimator": "output [Hz]"}
"""Whose rates are shown, and the fact that tells it."""


class CellStatus:
    """Takes what the nodes say; gives the line."""

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
        """Takes the newest heights [m] and the monitor's state, at a steady time [s].

        Args:
            measured, estimated, state, now: see above.
            alone: there is no camera by choice.
            disagree: camera and model disagree.
        """
        self._measured, self._estimated = measured, estimated
        self._state, self._at = state, now
        self._alone, self._disagree = alone, disagree

    def take_report(self, report: NodeReport) -> None:
        """Takes what a node says of its rates."""
        if report.node in RATES:
            # Whoever speaks on that topic may say anything.
            with contextlib.suppress(KeyError, ValueError):
                self._rates[report.node] = float(report.facts[RATES[report.node]])

    def take_parameters(self, node: str, parameters: Mapping[str, Any]) -> None:
        """Takes the monitor's limits."""
        if node == "monitor":
            self._settings = MonitorSettings.from_told(parameters)

    def line(self, now: float) -> str:
        """State, heights, limit and rates at a steady time [s]."""
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
        """The limit that holds."""
        rim = " (rim)" if self._settings.at_rim(source) else ""
        return f"{_shown(self._settings.limits[source])} mm{rim}"


def _shown(height: float) -> str:
    return f"{1e3 * height:.1f}" if math.isfinite(height) else "–"
