"""Compares a camera's heights of one container on a tray with the estimates of that container."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.limits import Event, Source
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.tray import Tray


class ContainerMonitor:
    """Monitor of a tray's second or later container, which has its own camera.

    Limits of the estimated height are those of `TrayWatch`, which reports them for all containers;
    here they only count for the state of the comparisons.

    Args:
        tray: the tray.
        name: of the container.
        settings: of the monitor node; the container's own limit and rim replace those in it.
        number: gives each limit violation its number; None: they are counted here.

    Attributes:
        name: of the container.
        index: of it on the tray, from 0.
        tray: the newest one.
        core: compares the heights.

    Raises:
        SloshEstimatorError: the tray has no such container, or it is the first.
    """

    def __init__(
        self, tray: Tray, name: str, settings: MonitorSettings,
        number: Callable[[], int] | None = None,
    ) -> None:  # fmt: skip
        self.name, self.index = name, camera_place(tray, name)
        self.tray, self._settings = tray, settings
        self.core = Monitor(own_settings(tray, self.index, settings), number)

    def change_settings(self, settings: MonitorSettings, stamp_ns: int) -> None:
        """Changes the height limits for data after a stamp [ns]."""
        self._settings = settings
        self.core.change_settings(own_settings(self.tray, self.index, settings), stamp_ns)

    def carry(self, tray: Tray, stamp_ns: int) -> None:
        """Replaces the containers of the tray from a stamp [ns] on."""
        before, self.tray = self.tray, tray
        if before.containers[self.index] != tray.containers[self.index]:
            self.change_settings(self._settings, stamp_ns)
            self.core.motions.reset()  # what disagreed was another container

    def take_events(self) -> list[Event]:
        """Returns limit events of measured heights, and disagreements, since the last call."""
        return [
            replace(event, description=f"container {self.name}: {event.description}")
            for event in self.core.take_events()
            if event.source is not Source.ESTIMATED
        ]


def camera_place(tray: Tray, name: str) -> int:
    """Returns a container's index on the tray (1 or more) if it may have its own camera.

    Raises:
        SloshEstimatorError: the tray has no such container, or it is the first.
    """
    if not tray.containers or not tray.is_tray:
        raise SloshEstimatorError(f"camera of container {name!r:.60}: the cell carries no tray")
    if name not in tray.names:
        raise SloshEstimatorError(
            f"camera of container {name!r:.60}: no container of the tray ({', '.join(tray.names)})"
        )
    if name == tray.first.name:
        raise SloshEstimatorError(
            f"camera of container {name}: the first of the tray; its camera names no container"
        )
    return tray.names.index(name)


def own_settings(tray: Tray, index: int, settings: MonitorSettings) -> MonitorSettings:
    """Returns the monitor's settings for one container of a tray, with its own limit and rim."""
    one = tray.containers[index]
    own = replace(settings, camera=True)
    if one.limit == one.limit:
        own = replace(own, measured_limit=one.limit, estimated_limit=one.limit)
    return replace(own, rim=own.near_rim(one.model)[0])
