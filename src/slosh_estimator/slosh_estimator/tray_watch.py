"""Checks the limits of a tray's containers and finds the one nearest to its limit."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from slosh_estimator.limits import Event, Hysteresis, LimitTracker, Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.tray import Tray, TrayContainer


class TrayWatch:
    """Monitors the estimated height of each container on a tray.

    Each has its own limit, or that of the estimated height, and its own rim.

    Args:
        tray: the tray.
        settings: of the monitor.
        number: gives each excess its number.

    Attributes:
        tray: the tray.
    """

    def __init__(self, tray: Tray, settings: MonitorSettings, number: Callable[[], int]) -> None:
        self.tray, self._number, self._settings = tray, number, settings
        self._changes: deque[tuple[int, Tray]] = deque()
        self._heights: Sequence[float] = [math.nan] * len(tray.containers)
        self._trackers = [
            LimitTracker(Source.ESTIMATED, *_limit(one, settings)) for one in tray.containers
        ]

    def change_settings(self, settings: MonitorSettings, stamp_ns: int) -> list[Event]:
        """Changes the height limits for data after a stamp; see `Monitor.change_settings`."""
        self._settings = settings
        return self._judge_anew(stamp_ns)

    def carry(self, tray: Tray, stamp_ns: int) -> None:
        """Replaces the containers of the tray from a stamp [ns] on."""
        self._changes.append((stamp_ns, tray))

    def _judge_anew(self, stamp_ns: int) -> list[Event]:
        found = []
        for one, tracker in zip(self.tray.containers, self._trackers, strict=True):
            limit, hysteresis, name = _limit(one, self._settings)
            found.append(tracker.change(stamp_ns, limit, hysteresis, name))
        return self._named(found)

    def _reach(self, stamp_ns: int) -> list[Event]:
        """Applies container changes due before a stamp; ends violations of removed containers."""
        found: list[Event] = []
        while self._changes and self._changes[0][0] < stamp_ns:
            last_ns, tray = self._changes.popleft()
            pairs = zip(self.tray.containers, tray.containers, strict=True)
            closed = [
                tracker.close(last_ns, "no container" if new.empty else "another container")
                if (old.model, old.empty) != (new.model, new.empty)
                else None
                for tracker, (old, new) in zip(self._trackers, pairs, strict=True)
            ]
            found += self._named(closed)
            self.tray = tray
            found += self._judge_anew(last_ns)
        return found

    def update(self, stamp_ns: int, heights: Sequence[float]) -> list[Event]:
        """Adds the height of each container [m], NaN if unknown; returns limit events."""
        ended, self._heights = self._reach(stamp_ns), heights
        found = []
        for tracker, height in zip(self._trackers, heights, strict=True):
            if not tracker.active and height > tracker.limit:
                tracker.identifier = self._number()
            found.append(tracker.update(stamp_ns, height))
        return ended + self._named(found)

    def close(self, stamp_ns: int, reason: str) -> list[Event]:
        """Ends all limit violations and returns their events."""
        return self._named([tracker.close(stamp_ns, reason) for tracker in self._trackers])

    @property
    def active(self) -> bool:
        """Whether any container is above its limit."""
        return any(tracker.active for tracker in self._trackers)

    @property
    def worst(self) -> int:
        """Index of the container that is nearest to its limit, or farthest above it."""
        return int(np.argmax(self._shares))

    @property
    def share(self) -> float:
        """Height of the worst container divided by its limit; 0 if unknown."""
        return max(self._shares)

    @property
    def text(self) -> str:
        """Describes height and limit of the worst container in words."""
        worst = self.worst
        height = self._heights[worst]
        if math.isnan(height):
            return ""
        limit = self._trackers[worst].limit_text
        return f"worst container {self.tray.names[worst]}: {1e3 * height:.1f} mm, {limit}"

    def facts(self) -> dict[str, str]:
        """Returns each container's height and the worst container, for the diagnostics."""
        tray = self.tray
        rows = zip(tray.names, self._heights, self._trackers, tray.containers, strict=True)
        heights = {
            f"container {name}": "none"
            if one.empty
            else f"{1e3 * height:.1f} mm, {tracker.limit_text}"
            for name, height, tracker, one in rows
        }
        return {"worst container": tray.names[self.worst], **heights}

    @property
    def _shares(self) -> list[float]:
        return [
            height / tracker.limit if height == height else 0.0
            for height, tracker in zip(self._heights, self._trackers, strict=True)
        ]

    def _named(self, events: Sequence[Event | None]) -> list[Event]:
        pairs = zip(self.tray.names, events, strict=True)
        return [
            replace(event, description=f"container {name}: {event.description}")
            for name, event in pairs
            if event is not None
        ]


def _limit(one: TrayContainer, settings: MonitorSettings) -> tuple[float, Hysteresis, str]:
    """Returns a container's height limit [m], its hysteresis and the limit's name."""
    limit = settings.estimated_limit if math.isnan(one.limit) else one.limit
    own = replace(settings, estimated_limit=limit)
    own = replace(own, rim=own.near_rim(one.model)[0])
    return own.limits[Source.ESTIMATED], own.hysteresis, own.limit_name(Source.ESTIMATED)
