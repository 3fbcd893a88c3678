"""Compares the heights from a tray container's own camera with a replay's estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np

from slosh_estimator.container_monitor import ContainerMonitor, own_settings
from slosh_estimator.limits import Event
from slosh_msgs_py.topics import COMPARISON, FREE_SURFACE, TRAY_ESTIMATE, of_container
from slosh_replay.recording.heights import WAVE_FIELDS, measurements
from slosh_replay.recording.settings import NodeStart
from slosh_replay.recording.sources import COMPARISON as COMPARISON_TYPE
from slosh_replay.recording.sources import SURFACE
from slosh_replay.recording.sources import TRAY as TRAY_TYPE
from slosh_replay.replay.monitor_feed import MonitoredHeights, MonitorFeed
from slosh_replay.replay.nodes import (
    NO_MEASUREMENTS,
    Moment,
    NodeTopic,
    ReplayedNode,
    Setting,
    recorded_name,
)
from slosh_replay.replay.replayed_estimator import TRAY_HEIGHT_FIELDS, TRAY_HEIGHTS
from slosh_replay.replay.verification import (
    COMPARED,
    ESTIMATED,
    Messages,
    comparison_columns,
    with_an_image,
)

_TOLD: Final = recorded_name(TRAY_ESTIMATE)
"""Of all estimates of a tray the live monitor heard those that were published."""


class ReplayedContainerMonitor:
    """Compares the heights from a tray container's own camera with the replayed estimates.

    Args:
        setting: of the replay; it has a tray.
        name: of the container.

    Attributes:
        events: limit events so far.
    """

    def __init__(self, setting: Setting, name: str) -> None:
        assert setting.tray is not None
        tray, self._monitor = setting.tray, ContainerMonitor(setting.tray, name, setting.limits)
        self._feed = MonitorFeed(
            self._monitor.core.settings,
            [
                (stamp, own_settings(tray, self._monitor.index, limits))
                for stamp, limits in setting.limit_changes
            ],
            self._monitor.core,
        )
        self._surface = of_container(FREE_SURFACE, name)
        self._comparison = of_container(COMPARISON, name)
        self._trays, self._carried = setting.trays, 0
        self.events: list[Event] = []

    def update(self, moment: Moment) -> Mapping[str, Messages]:
        """Processes estimates and measured heights; returns comparisons of the two."""
        for last_ns, tray in self._trays[self._carried :]:
            self._monitor.carry(tray, last_ns)
        self._carried = len(self._trays)
        heights, surfaces = moment.messages[TRAY_HEIGHTS], moment.messages[self._surface]
        heights = heights.rows(np.isin(heights.stamps, moment.messages[_TOLD].stamps))
        measured = NO_MEASUREMENTS
        if len(surfaces.stamps):
            read = measurements(surfaces.columns)
            measured = read._replace(heights=read.usable_heights)
        found = self._feed.add(_monitored(heights, self._monitor.index), measured)
        if moment.final:
            found += self._feed.finish()
        self.events += self._monitor.take_events()
        return {self._comparison: comparison_columns(found)} if found else {}


def _monitored(heights: Messages, index: int) -> MonitoredHeights:
    """Converts the estimates of one container of a tray to the input format of a monitor."""
    if not len(heights.stamps):
        none, whole = np.empty(0), np.empty(0, dtype=np.int64)
        return MonitoredHeights(whole, none, none, whole)
    of = {name: heights.columns[f"{name}[{index}]"] for name in TRAY_HEIGHT_FIELDS}
    return MonitoredHeights(
        heights.stamps, of["linear_msh"], of["msh"], of["flags"],
        np.column_stack((of["linear_reading"], of["reading"])),
        of["delay"] if of["delay"].any() else None,
        of["azimuth"],
        np.column_stack([heights.columns[f"acceleration[{axis}]"] for axis in range(3)]),
    )  # fmt: skip


def container_nodes(
    starts: Sequence[NodeStart], tray_names: Sequence[str]
) -> tuple[ReplayedNode, ...]:
    """Returns a replayed node for each container of a tray that has a camera of its own.

    Args:
        starts: of the recorded nodes.
        tray_names: names of the tray's containers.
    """
    told = [one.parameters.get("cameras", "") for one in starts if one.node == "monitor"]
    names = [part.strip() for part in str(told[-1] if told else "").split(",")]
    return tuple(_node(name) for name in names if name in tray_names[1:])


def _node(name: str) -> ReplayedNode:
    comparison = NodeTopic(
        of_container(COMPARISON, name), COMPARISON_TYPE, ("measured_stale", *COMPARED),
        can_lack=ESTIMATED, known=with_an_image,
    )  # fmt: skip
    return ReplayedNode(
        f"monitor of {name}",
        partial(ReplayedContainerMonitor, name=name),
        inputs=(
            NodeTopic(TRAY_HEIGHTS, ""),
            NodeTopic(_TOLD, TRAY_TYPE),
            NodeTopic(of_container(FREE_SURFACE, name), SURFACE, WAVE_FIELDS),
        ),
        outputs=(comparison,),
        tolerance=None,  # a live monitor has deadlines
    )
