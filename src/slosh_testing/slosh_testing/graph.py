"""Runs a test's own ROS node and the nodes under test in one executor."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from slosh_msgs_py import qos
from slosh_msgs_py.node.run import make_executor

PATIENCE = 60.0
N = TypeVar("N", bound=Node)


class Graph:
    """A test's ROS node and the nodes under test in one executor.

    Args:
        name, namespace: of the test's own node.
        executor: of all nodes; None: the product's.

    Attributes:
        node: the test's own.
        nodes: all of them.
    """

    def __init__(self, name: str = "probe", namespace: str = "/", executor: Any = None) -> None:
        self.executor = executor or make_executor()
        self.nodes: list[Node] = []
        self.node = self.add(Node(name, namespace=namespace))

    def add(self, node: N) -> N:
        """Adds a ROS node to the executor of the test."""
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def with_parameters(self, make: Callable[[], N], namespace: str = "/", **given: Any) -> N:
        """Adds a node whose parameters are set by overrides."""
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        original = Node.__init__

        def start(node: Node, name: str, **options: Any) -> None:
            own = {"parameter_overrides": overrides, "namespace": namespace, **options}
            original(node, name, **own)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Node, "__init__", start)
            return self.add(make())

    def publisher(self, kind: type, topic: str, profile: Any = qos.STREAM_OUT) -> Any:
        """Creates a publisher and waits until it has a subscriber."""
        publisher = self.node.create_publisher(kind, topic, profile)
        self.until(lambda: publisher.get_subscription_count() > 0)
        return publisher

    def listen(
        self, kind: type, topic: str, profile: Any = qos.STREAM_IN, *, raw: bool = False
    ) -> list[Any]:
        """Subscribes to a topic and returns the list to which its messages are added."""
        heard: list[Any] = []
        self.node.create_subscription(kind, topic, heard.append, profile, raw=raw)
        return heard

    def until(self, condition: Callable[[], object], what: str = "what was awaited") -> None:
        """Runs all nodes until a condition is met; fails after a timeout."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"{what} did not come"
            self.executor.spin_once(timeout_sec=0.05)

    def got(self, future: Any) -> Any:
        """Runs all nodes until a future is done, and returns its result."""
        self.until(future.done, "an answer")
        return future.result()

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Calls a service and returns its response."""
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready, name)
        answer = self.got(client.call_async(request))
        self.node.destroy_client(client)
        return answer

    def close(self) -> None:
        """Destroys all nodes; ROS itself stays initialised."""
        for node in self.nodes:
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()
