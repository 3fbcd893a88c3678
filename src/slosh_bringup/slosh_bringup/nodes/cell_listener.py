"""Hears what the nodes of a cell say of themselves, for a process that is none of them."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from types import TracebackType

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from slosh_bag.errors import SloshBagError
from slosh_bag.recording.settings import NodeStart, node_start
from slosh_bringup.cell_watch import NodeReport
from slosh_msgs.msg import NodeSettings
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.run import initialise, make_heard


class CellListener:
    """Listens while it is asked to; a context manager.

    The process must have the nodes' environment when it is made: domain, discovery, profiles.

    Args:
        namespace: of the cell.
        on_settings: gets what a node says that it works with.
        on_report: gets what it says of its health.
        diagnostics: topic of that.
    """

    def __init__(
        self,
        namespace: str,
        on_settings: Callable[[NodeStart], None],
        on_report: Callable[[NodeReport], None],
        diagnostics: str = topics.DIAGNOSTICS,
    ) -> None:
        self._namespace = namespace
        self._on_settings, self._on_report = on_settings, on_report
        self._diagnostics = diagnostics

    def __enter__(self) -> CellListener:
        initialise([])
        self._node = make_heard(self._make)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown()

    def listen(self, seconds: float) -> None:
        """Takes what comes for so long [s]."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def _make(self) -> Node:
        # A name that begins like this is hidden from lists of nodes.
        node = Node(
            f"_slosh_{os.getpid()}",
            namespace=self._namespace,
            enable_rosout=False,
            start_parameter_services=False,
        )
        node.create_subscription(NodeSettings, topics.SETTINGS, self._take_settings, qos.EVENT)
        node.create_subscription(
            DiagnosticArray, self._diagnostics, self._take_diagnostics, qos.DIAGNOSTICS
        )
        return node

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        for report in reports(message, self._namespace):
            self._on_report(report)

    def _take_settings(self, message: NodeSettings) -> None:
        with contextlib.suppress(SloshBagError):  # a stranger's; ours can be read
            self._on_settings(node_start(message, time.time_ns(), topics.SETTINGS))


def reports(message: DiagnosticArray, namespace: str) -> Iterator[NodeReport]:
    """What the nodes of a namespace say; a robot's other nodes speak on the same topic."""
    prefix = f"{namespace.rstrip('/')}/"
    for status in message.status:
        name = status.name.removeprefix(prefix)
        if status.name.startswith(prefix) and "/" not in name:
            facts = {pair.key: pair.value for pair in status.values}
            yield NodeReport(name, ord(status.level), status.message, facts)
