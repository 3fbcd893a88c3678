"""Collects the messages of a cell's topics and makes updates for its watch page.

A frame holds what is new since the one before it, and what is true now. Heights are in metres,
azimuths in radians, times in seconds from the first stamp; NaN is null. Time is an argument: live
it is the steady clock, of a recording the time of its messages.
"""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.cell_watch import SILENT, NodeReport
from slosh_bringup.processes import known_nodes
from slosh_bringup.watch.verdict import SILENCE, judge
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.containers import Container
from slosh_model.wall import Wall
from slosh_report.json_values import plain

PERIOD = 0.1
"""Time between two frames [s]."""
KEPT_EVENTS, SLOW = 20, 10
"""Events that are shown; every so manieth frame holds events and nodes."""
MOST_NODES = 40
"""Nodes that are shown, and those of a cell whatever comes: each frame names them all."""
KEPT_FUSED, NEAR_NS = 200, SECOND // 50
"""Number of stored fused states, and largest distance of one from its drawn time [ns]."""
ALONE = SILENCE
"""After so long without a comparison the estimate is drawn by itself [s]."""
BACKWARDS = 3.0
"""A stamp so far before the newest one begins a new drawing [s]; less is a camera that is late."""
START = 0
"""Kind of a limit event."""


class Compared(NamedTuple):
    """Fields of a SloshComparison message that the operator's page displays."""

    stamp_ns: int
    measured: float
    stddev: float
    estimated: float
    residual: float
    sigma: float
    epsilon: float
    state: int
    stale: tuple[str, ...]
    alone: bool = False
    disagree: bool = False


class Surface(NamedTuple):
    """Fields of a FreeSurface message that the operator's page displays."""

    stamp_ns: int
    height: float
    azimuth: float
    line_azimuth: Sequence[float]
    line_height: Sequence[float]
    flags: int


class Estimated(NamedTuple):
    """Fields of a SloshEstimate message that the operator's page displays."""

    stamp_ns: int
    height: float
    azimuth: float


class Fused(NamedTuple):
    """Fields of a FusedEstimate message that the operator's page displays."""

    stamp_ns: int
    height: float
    stddev: float


class CalmNews(NamedTuple):
    """Fields of a Calm message that the operator's page displays."""

    calm: bool
    reason: int
    bound: float
    tolerance: float
    wait: float


class Figure(NamedTuple):
    """A figure of an add-on on the operator's page.

    Attributes:
        title: above it.
        value: the number; NaN: unknown.
        unit: behind it.
        words: below it.
    """

    title: str
    value: float
    unit: str
    words: str


class LimitNews(NamedTuple):
    """Fields of a LimitEvent message that the operator's page displays."""

    stamp_ns: int
    id: int
    kind: int
    source: int
    peak: float
    description: str


class WatchState:
    """Collects a cell's messages and makes updates for its watch page.

    Args:
        command: the command that finds why the two sides disagree; empty: none fits.

    Attributes:
        cells: lines of the list of cells; empty: there is one cell only.
    """

    def __init__(self, command: str = "") -> None:
        self.command = command
        self._origin = 0
        self._newest = 0
        self._drawing = 0
        self._count = 0
        self._compared: Compared | None = None
        self._compared_at = self._estimated_at = -math.inf
        self._surface: Surface | None = None
        self._estimated: Estimated | None = None
        self._fused: deque[Fused] = deque(maxlen=KEPT_FUSED)
        self._calm: tuple[CalmNews, float] | None = None
        self._figures: dict[str, tuple[Figure, float]] = {}
        self._settings = MonitorSettings()
        self._wall: Wall | None = None
        self._container: dict[str, Any] = {}
        self._events: deque[LimitNews] = deque(maxlen=KEPT_EVENTS)
        self._open: dict[int, LimitNews] = {}
        self._nodes: dict[str, tuple[NodeReport, float]] = {}
        self._rows: list[tuple[float, ...]] = []
        self.cells: list[dict[str, Any]] = []

    def is_alone(self, now: float) -> bool:
        """Whether only the estimate is drawn, since no measured height is compared with it."""
        compared = self._compared
        silent = compared is None or compared.alone or not math.isfinite(compared.estimated)
        return silent or now - self._compared_at > ALONE

    def take_comparison(self, compared: Compared, now: float) -> None:
        """Stores a comparison of measured and estimated height, with its arrival time [s]."""
        self._compared, self._compared_at = compared, now
        if math.isfinite(compared.measured) or math.isfinite(compared.estimated):
            self._add(compared.stamp_ns, compared.measured, compared.estimated)

    def take_surface(self, surface: Surface) -> None:
        """Stores the newest measured surface for the operator's page."""
        self._surface = surface

    def take_estimate(self, estimated: Estimated, now: float) -> None:
        """Stores the newest estimate, to be drawn if no measured height is compared with it."""
        self._estimated, self._estimated_at = estimated, now
        if self.is_alone(now):
            self._add(estimated.stamp_ns, math.nan, estimated.height)

    def take_fused(self, fused: Fused) -> None:
        """Stores a fused estimate, to be drawn at the stamps of measured or estimated heights."""
        self._fused.append(fused)

    def take_calm(self, calm: CalmNews, now: float) -> None:
        """Stores whether the liquid is calm, with the arrival time [s] (monotonic clock)."""
        self._calm = calm, now

    def take_figure(self, topic: str, figure: Figure, now: float) -> None:
        """Stores a topic's newest figure, with its arrival time [s] (monotonic clock)."""
        self._figures[topic] = figure, now

    def take_event(self, event: LimitNews) -> None:
        """Stores the start or the end of a limit violation for the operator's page."""
        self._events.append(event)
        if event.kind == START:
            self._open[event.id] = event
            if len(self._open) > KEPT_EVENTS:
                del self._open[next(iter(self._open))]
        else:
            self._open.pop(event.id, None)

    def take_parameters(
        self, node: str, parameters: Mapping[str, Any], *, goes_on: bool = False
    ) -> None:
        """Stores the monitor's limits; after its restart, no limit counts as exceeded.

        Args:
            node: its name.
            parameters: by name.
            goes_on: whether they changed while the node goes on.
        """
        if node != "monitor":
            return
        if not goes_on:
            self._open.clear()
        self._settings = MonitorSettings.from_partial(parameters)

    def take_container(self, container: Container) -> None:
        """Stores the shape of the container and the height of its rim, for drawing."""
        self._wall = container.wall
        along, across = (np.round(container.side_view(axis), 5).tolist() for axis in (0, 1))
        plan = np.round(container.corners * container.reaches, 5).tolist()
        self._container = {"outline": along, "rim": container.freeboard, "plan": plan}
        if across != along:
            self._container["across"] = across

    def take_report(self, report: NodeReport, now: float) -> None:
        """Stores a node's diagnostics; the number of unknown nodes is limited."""
        known = report.node in self._nodes or report.node in known_nodes()
        if not known and len(self._nodes) >= MOST_NODES:
            return
        self._nodes[report.node] = (report, now)

    def frame(self, now: float) -> str:
        """Returns the next update of the watch page as JSON; call it every PERIOD seconds."""
        compared = self._compared
        exceeded = "; ".join(event.description for event in self._open.values())
        judgement = judge(
            compared.state if compared else None,
            now - self._compared_at,
            compared.stale if compared else (),
            exceeded,
            alone=bool(compared and compared.alone),
            disagree=bool(compared and compared.disagree),
        )
        rows, self._rows = self._rows, []
        figures = self._figures.values()
        frame: dict[str, Any] = {
            "drawing": self._drawing,
            "verdict": judgement.verdict.value,
            "reason": judgement.reason + ("" if exceeded else self._worst(now)),
            "time": self._seconds(self._newest),
            "rows": [[None if v != v else round(v, 7) for v in row] for row in rows],
            "now": self._now(now),
            "surface": self._shown_surface(now),
            "calm": self._shown_news(self._calm, now),
            "figures": list(filter(None, (self._shown_news(one, now) for one in figures))),
        }
        if self._count % SLOW == 0:
            frame |= {"limits": self._shown_limits(), "nodes": self._shown_nodes(now)}
            frame |= {"events": self._shown_events(), "command": self._advice()}
            frame |= {"container": self._container, "cells": self.cells}
        self._count += 1
        return json.dumps(plain(frame), allow_nan=False, separators=(",", ":"))

    def _add(self, stamp_ns: int, measured: float, estimated: float) -> None:
        if not self._origin or stamp_ns < self._newest - BACKWARDS * SECOND:
            self._drawing, self._origin = self._drawing + 1, stamp_ns
            self._rows.clear()
        elif stamp_ns <= self._newest:
            return  # an estimate that a later comparison holds
        self._newest = stamp_ns
        fused, stddev = self._fused_at(stamp_ns)
        low = fused - 2.0 * stddev
        band = (fused, max(low, 0.0) if low == low else low, fused + 2.0 * stddev)
        self._rows.append((self._seconds(stamp_ns), measured, estimated, *band))

    def _fused_at(self, stamp_ns: int) -> tuple[float, float]:
        """Returns the fused height at a stamp and its standard deviation [m]; NaN if unknown."""
        near = min(self._fused, key=lambda one: abs(one.stamp_ns - stamp_ns), default=None)
        if near is None or abs(near.stamp_ns - stamp_ns) > NEAR_NS:
            return math.nan, math.nan
        return near.height, near.stddev

    def _seconds(self, stamp_ns: int) -> float:
        return round((stamp_ns - self._origin) * 1e-9, 4)

    def _now(self, now: float) -> dict[str, Any]:
        compared, estimated = self._compared, self._estimated
        shown: dict[str, Any] = {}
        if compared is not None:
            shown = compared._asdict() | {"age": round(now - self._compared_at, 2)}
            shown["time"] = self._seconds(compared.stamp_ns)
        if estimated is not None and self.is_alone(now):
            shown |= {"measured": math.nan, "residual": math.nan}
            shown["estimated"] = estimated.height
            if now - self._estimated_at > ALONE:
                shown["estimated"] = math.nan
        if self._wall is not None:
            place = self._wall.place
            shown["to_rim"] = {
                side: round(float(place(shown.get(side, math.nan)).distance_to_rim), 5)
                for side in ("measured", "estimated")
            }
        return shown

    def is_fresh(self, now: float) -> bool:
        """Whether the newest estimate is recent enough to be shown."""
        return now - self._estimated_at <= ALONE

    def _shown_news(
        self, news: tuple[CalmNews | Figure, float] | None, now: float
    ) -> dict[str, Any]:
        """Returns the newest message of a topic for display; empty if it is not recent."""
        return {} if news is None or now - news[1] > ALONE else news[0]._asdict()

    def _shown_surface(self, now: float) -> dict[str, Any]:
        surface, estimated = self._surface, self._estimated
        shown: dict[str, Any] = {}
        if surface is not None:
            pairs = list(zip(surface.line_azimuth, surface.line_height, strict=False))
            step = max(len(pairs) // 60, 1)
            shown["line"] = [[round(float(a), 3), round(float(h), 5)] for a, h in pairs[::step]]
            shown["measured"] = [surface.azimuth, surface.height]
            shown["flags"] = surface.flags
        if estimated is not None and self.is_fresh(now):
            shown["estimated"] = [estimated.azimuth, estimated.height]
        return shown

    def _shown_limits(self) -> dict[str, dict[str, Any]]:
        """Returns the limit in effect for each monitored quantity, for display."""
        settings = self._settings
        return {
            source.name.lower(): {"height": limit, "name": settings.limit_name(source)}
            for source, limit in settings.limits.items()
            if math.isfinite(limit)
        }

    def _shown_nodes(self, now: float) -> list[dict[str, Any]]:
        return [
            {
                "name": name,
                "level": "STALE" if now - at > SILENT else _LEVELS.get(report.level, "ERROR"),
                "sentence": report.sentence,
                "age": round(now - at, 1),
                "facts": dict(report.facts),
            }
            for name, (report, at) in sorted(self._nodes.items())
        ]

    def _shown_events(self) -> list[dict[str, Any]]:
        return [
            {
                "time": self._seconds(event.stamp_ns),
                "start": event.kind == START,
                "peak": event.peak,
                "text": event.description,
            }
            for event in reversed(self._events)
        ]

    def _worst(self, now: float) -> str:
        """Describes the tray's container nearest to its limit; empty if there is no tray."""
        report, at = self._nodes.get("monitor", (None, -math.inf))
        name = report.facts.get("worst container", "") if report is not None else ""
        if report is None or not name or now - at > SILENT:
            return ""
        return f"; worst container {name}: {report.facts.get(f'container {name}', '')}"

    def _advice(self) -> str:
        """Returns the command to run if model and camera disagree; empty if they agree."""
        limit, compared = self._settings.disagreement_limit, self._compared
        facts = self._nodes["monitor"][0].facts if "monitor" in self._nodes else {}
        disagreeing = facts.get("motions that disagree", "0") not in ("0", "")
        apart = bool(compared and abs(compared.residual) > limit > 0.0)
        return self.command if disagreeing or apart else ""


_LEVELS = {0: "OK", 1: "WARN", 2: "ERROR", 3: "STALE"}
