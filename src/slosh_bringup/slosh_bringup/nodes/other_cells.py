"""Subscribes to the other cells in the ROS graph, for the list on the operator's page."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from slosh_bag.errors import SloshBagError
from slosh_bringup.cell_watch import reports
from slosh_bringup.watch import hearing
from slosh_bringup.watch.cells import CellList
from slosh_msgs.msg import NodeSettings, SloshComparison
from slosh_msgs_py import qos, topics
from slosh_replay.recording.settings import node_start

LOOK_EVERY = 2.0
"""Time between two looks at the graph [s]."""
_TYPE = "slosh_msgs/msg/SloshComparison"
Subscribe = Callable[[Any, str, QoSProfile], Subscription]
Take = Callable[[Subscription, Any, int], Iterator[Any]]


class OtherCells:
    """Finds cells by their SloshComparison topics and receives the newest messages of each.

    Args:
        node: the node.
        subscribe: makes a subscription that no executor serves.
        drop: ends it.
        take: yields its messages.

    Attributes:
        cells: the list, with the node's own cell.
    """

    def __init__(
        self, node: Node, subscribe: Subscribe, drop: Callable[[Subscription], None], take: Take
    ) -> None:
        self._node, self._subscribe, self._drop, self._take = node, subscribe, drop, take
        self._own = node.get_namespace()
        self.cells = CellList(self._own)
        self._heard: dict[str, tuple[Subscription, Subscription]] = {}
        self._looked = -LOOK_EVERY

    def look(self, now: float) -> None:
        """Processes the received messages; searches for new cells at intervals."""
        if now - self._looked >= LOOK_EVERY:
            self._looked = now
            self._find()
        for name, (comparisons, settings) in self._heard.items():
            for message in self._take(comparisons, SloshComparison, 1):
                self.hear_comparison(name, message, now)
            for message in self._take(settings, NodeSettings, 100):
                self.hear_settings(name, message)

    def hear_comparison(self, name: str, message: SloshComparison, now: float) -> None:
        """Updates a cell's entry in the list from its SloshComparison message."""
        self.cells.take_comparison(name, hearing.compared(message), now)

    def hear_settings(self, name: str, message: NodeSettings) -> None:
        """Passes the settings of a cell's node to the list of cells."""
        with contextlib.suppress(SloshBagError):  # a stranger's; ours can be read
            start = node_start(message, time.time_ns(), topics.SETTINGS)
            self.cells.take_parameters(name, start.node, start.parameters)

    def hear_diagnostics(self, message: Any) -> None:
        """Passes the diagnostics of the nodes of all known cells to the list of cells."""
        for name in self.cells.names:
            for report in reports(message, name):
                self.cells.take_report(name, report)

    def _names(self, topic: str) -> set[str]:
        """Returns the namespaces of the cells that publish SloshComparison messages on a topic."""
        name = topics.cell_name(topic, _TYPE)
        if name is not None:
            return {name.namespace or "/"}
        return {one.node_namespace for one in self._node.get_publishers_info_by_topic(topic)}

    def _find(self) -> None:
        found: dict[str, str] = {}
        for topic, types in self._node.get_topic_names_and_types():
            if _TYPE in types and self._node.count_publishers(topic):
                found |= dict.fromkeys(self._names(topic), topic)
        found.pop(self._own, None)
        for name in self._heard.keys() - found.keys():
            for subscription in self._heard.pop(name):
                self._drop(subscription)
        for name in found.keys() - self._heard.keys():
            settings = f"{name.rstrip('/')}/{topics.SETTINGS}"
            self._heard[name] = (
                self._subscribe(SloshComparison, found[name], qos.NEWEST_IN),
                self._subscribe(NodeSettings, settings, qos.EVENT),
            )
        self.cells.keep(found)
