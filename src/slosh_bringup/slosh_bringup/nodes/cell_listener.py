"""Receives the settings and diagnostics of a cell's nodes in another process."""

from __future__ import annotations

import contextlib
import os
import time
from collections import Counter
from collections.abc import Collection
from typing import Any, Protocol

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from slosh_bag.errors import SloshBagError
from slosh_bringup.cell_watch import NodeReport, reports
from slosh_motion.recorded.settings import NodeStart, node_start
from slosh_msgs.msg import NodeSettings, SloshComparison
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import find_type
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.run import initialise, make_heard

_READ = ("geometry_msgs", "sensor_msgs", "slosh_msgs")
"""Packages whose messages the cell's nodes read."""


class Hearer(Protocol):
    """Interface of an object that processes a cell's messages."""

    def take_settings(self, start: NodeStart) -> None:
        """Processes the settings that a node has published."""

    def take_report(self, report: NodeReport) -> None:
        """Processes the diagnostics that a node has published."""

    def take_comparison(self, comparison: SloshComparison) -> None:
        """Processes a SloshComparison message (measured and estimated height)."""


class TopicProbe:
    """Temporary subscription to a topic of any type, which counts messages.

    Args:
        node: that listens.
        topic: in full.
        message_type: its class.

    Attributes:
        count: of the messages so far.
    """

    def __init__(self, node: Node, topic: str, message_type: Any) -> None:
        self.count = 0
        self._node = node
        self._subscription = node.create_subscription(
            message_type, topic, self._take, qos.NEWEST_IN, raw=True
        )

    def close(self) -> None:
        """Removes the temporary subscription."""
        self._node.destroy_subscription(self._subscription)

    def _take(self, message: bytes) -> None:
        self.count += 1


class CellListener:
    """Subscriptions to a cell's diagnostics, settings and compared heights; a context manager.

    The process must have the nodes' environment when it is made: domain, discovery, profiles.

    Args:
        namespace: of the cell.
        hearer: is given what is heard.
        comparison: topic of the monitor's comparisons; None: as it is by itself.
        diagnostics: topic of the nodes' health.
    """

    def __init__(
        self,
        namespace: str,
        hearer: Hearer,
        comparison: str | None = None,
        diagnostics: str = topics.DIAGNOSTICS,
    ) -> None:
        self._namespace = namespace
        self._hearer = hearer
        self._comparison = comparison or topics.COMPARISON
        self._diagnostics = diagnostics

    def __enter__(self) -> CellListener:
        initialise([])
        self._node = make_heard(self._make)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown()

    def listen(self, seconds: float) -> None:
        """Receives and processes messages for a given time [s]."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def running(self, names: Collection[str]) -> Counter[str]:
        """Counts the discovered nodes of each given name in the namespace."""
        found = self._node.get_node_names_and_namespaces()
        return Counter(name for name, space in found if space == self._namespace and name in names)

    def probe(self, topic: str, type_name: str) -> TopicProbe | None:
        """Subscribes to a topic and counts its messages, or returns None for an unknown type."""
        package, _, _ = type_name.partition("/")
        if package not in _READ:  # a name from the network: nothing else is imported for it
            return None
        try:
            return TopicProbe(self._node, topic, find_type(type_name))
        except (AttributeError, ImportError, ValueError):
            return None

    def _make(self) -> Node:
        # A name that begins like this is hidden from lists of nodes.
        # Guarded: what a stranger says on these topics must not end the cell.
        node = GuardedNode(
            f"_slosh_{os.getpid()}",
            namespace=self._namespace,
            enable_rosout=False,
            start_parameter_services=False,
        )
        node.create_subscription(NodeSettings, topics.SETTINGS, self._take_settings, qos.EVENT)
        node.create_subscription(
            DiagnosticArray, self._diagnostics, self._take_diagnostics, qos.DIAGNOSTICS
        )
        node.create_subscription(
            SloshComparison, self._comparison, self._hearer.take_comparison, qos.NEWEST_IN
        )
        return node

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        for report in reports(message, self._namespace):
            self._hearer.take_report(report)

    def _take_settings(self, message: NodeSettings) -> None:
        with contextlib.suppress(SloshBagError):  # a stranger's; ours can be read
            self._hearer.take_settings(node_start(message, time.time_ns(), topics.SETTINGS))
