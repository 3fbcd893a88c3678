"""What a running cell does, in one line for its terminal."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from typing import Any

from slosh_bringup.cell_watch import NodeReport
from slosh_bringup.watch.verdict import judge

RATES = {"camera": "measurement [Hz]", "estimator": "output [Hz]"}
"""Whose rates are shown, and the fact that tells it."""


class CellStatus:
    """Takes what the nodes say; gives the line."""

    def __init__(self) -> None:
        self._state: int | None = None
        self._alone = self._disagree = False
        self._measured = self._estimated = math.nan
        self._limits = {"measured_limit": math.nan, "estimated_limit": math.nan}
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
        for name in self._limits:
            limit = parameters.get(name)
            if node == "monitor" and isinstance(limit, int | float):
                self._limits[name] = float(limit)

    def line(self, now: float) -> str:
        """State, heights, limit and rates at a steady time [s]."""
        verdict, reason = judge(
            self._state, now - self._at, alone=self._alone, disagree=self._disagree
        )
        words = [verdict.value.upper()]
        if now - self._at > 1.0:
            words.append(reason)
        elif self._alone:
            limit = self._limits["estimated_limit"]
            words.append(f"estimated {_shown(self._estimated)} of {_shown(limit)} mm, no camera")
        else:
            heights = f"measured {_shown(self._measured)}, estimated {_shown(self._estimated)}"
            words.append(f"{heights} of {_shown(self._limits['measured_limit'])} mm")
        rates = [f"{node} {rate:.0f} Hz" for node, rate in self._rates.items()]
        return " · ".join([*words, *rates])


def _shown(height: float) -> str:
    return f"{1e3 * height:.1f}" if math.isfinite(height) else "–"
