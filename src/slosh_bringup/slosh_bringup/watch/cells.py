"""List of the cells on an operator's page: name, state, height, limit and page.

Time is an argument: the steady clock [s].
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

from slosh_bringup.cell_watch import NodeReport
from slosh_bringup.watch.state import Compared
from slosh_bringup.watch.verdict import judge
from slosh_estimator.limits import Source
from slosh_estimator.monitor_settings import MonitorSettings

MOST_CELLS = 40
"""Cells that are listed; more are ignored."""
PAGE_PORT = "page port"
"""Fact in the diagnostics of a node `watch` whose page other pages may link to."""
WORST = "worst container"


class _Cell:
    """The newest comparison, limits and page port received from one cell."""

    def __init__(self) -> None:
        self.compared: Compared | None = None
        self.at = -math.inf
        self.settings = MonitorSettings()
        self.port = 0
        self.worst = ""

    def row(self, name: str, now: float, *, own: bool) -> dict[str, Any]:
        """Returns the cell's line in the list of cells, for display."""
        compared = self.compared
        judgement = judge(
            compared.state if compared else None,
            now - self.at,
            compared.stale if compared else (),
            alone=bool(compared and compared.alone),
            disagree=bool(compared and compared.disagree),
        )
        height, limit = self._nearest()
        return {
            "name": name, "own": own, "verdict": judgement.verdict.value,
            "reason": judgement.reason, "height": height, "limit": limit,
            "worst": self.worst, "port": self.port,
        }  # fmt: skip

    def _nearest(self) -> tuple[float, float]:
        """The measured or estimated height nearest to its limit, and that limit [m], or NaN."""
        limits, compared = self.settings.limits, self.compared
        if compared is None:
            return math.nan, limits[Source.ESTIMATED]
        pairs = [
            (compared.measured, limits[Source.MEASURED]),
            (compared.estimated, limits[Source.ESTIMATED]),
        ]
        known = [(height, limit) for height, limit in pairs if math.isfinite(height)]
        return max(known, key=lambda pair: pair[0] / pair[1], default=(math.nan, pairs[1][1]))


class CellList:
    """Collects the messages of all cells for the list on the operator's page.

    Args:
        own: namespace of the cell whose page it is.
    """

    def __init__(self, own: str) -> None:
        self._own = own
        self._cells: dict[str, _Cell] = {own: _Cell()}

    def keep(self, names: Collection[str]) -> None:
        """Removes the cells that are not in `names`, except the one that the watch page shows."""
        for name in self._cells.keys() - {*names, self._own}:
            del self._cells[name]

    def take_comparison(self, name: str, compared: Compared, now: float) -> None:
        """Stores a cell's newest SloshComparison message (measured and estimated height)."""
        cell = self._cell(name)
        if cell is not None:
            cell.compared, cell.at = compared, now

    def take_parameters(self, name: str, node: str, parameters: Mapping[str, Any]) -> None:
        """Stores the height limits from the parameters of a cell's monitor."""
        cell = self._cell(name) if node == "monitor" else None
        if cell is not None:
            cell.settings = MonitorSettings.from_partial(parameters)

    def take_report(self, name: str, report: NodeReport) -> None:
        """Stores the port of a cell's watch page, and the tray container nearest to its limit."""
        cell = self._cells.get(name)
        if cell is None:
            return
        if report.node == "monitor":
            cell.worst = report.facts.get(WORST, "")
        elif report.node == "watch":
            port = report.facts.get(PAGE_PORT, "")
            cell.port = int(port) if port.isascii() and port.isdigit() and len(port) < 6 else 0

    @property
    def names(self) -> tuple[str, ...]:
        """Namespaces of the cells, sorted."""
        return tuple(sorted(self._cells))

    def rows(self, now: float) -> list[dict[str, Any]]:
        """Lines of the list of cells; empty if there is only one cell."""
        if len(self._cells) < 2:
            return []
        return [self._cells[name].row(name, now, own=name == self._own) for name in self.names]

    def _cell(self, name: str) -> _Cell | None:
        if name not in self._cells and len(self._cells) < MOST_CELLS:
            self._cells[name] = _Cell()
        return self._cells.get(name)
