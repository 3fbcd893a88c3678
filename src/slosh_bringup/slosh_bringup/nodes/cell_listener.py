"""Hears what the nodes of a cell say of themselves, for a process that is none of them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from types import TracebackType

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from slosh_bag.replay.settings import NodeStart, node_start
from slosh_msgs.msg import NodeSettings
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.run import initialise, make_heard


class CellListener:
    """Listens while it is asked to; a context manager.

    The process must have the nodes' environment when it is made: domain, discovery, profiles.

    Args:
        namespace: of the cell.
        on_settings: gets what a node says that it works with.
    """

    def __init__(self, namespace: str, on_settings: Callable[[NodeStart], None]) -> None:
        self._namespace = namespace
        self._on_settings = on_settings

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
        return node

    def _take_settings(self, message: NodeSettings) -> None:
        self._on_settings(node_start(message, time.time_ns(), topics.SETTINGS))
