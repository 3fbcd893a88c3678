"""A robot's ROS node that sends inputs no faster than the estimator follows."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock

from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.ready_wait import TELLING
from slosh_msgs.msg import SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.readiness import READY, RECORDED, STATE
from slosh_msgs_py.node.run import make_executor
from slosh_msgs_py.stamps import to_nanoseconds, to_time

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


class SteppedGraph(Graph):
    """A test's nodes whose simulated time goes on by whole steps, however busy the machine is.

    The node under test publishes one message at each step of its timer.

    Args:
        make: creates the node under test.
        period: of its timer [s].
        kind, topic: of what it publishes at each step.
        given: its parameters.

    Attributes:
        tested: the node under test.
        now_ns: simulated time [ns].
        moved: what it has published.
    """

    def __init__(
        self, make: Callable[[], Node], period: float, kind: type, topic: str, **given: Any
    ) -> None:
        super().__init__(executor=SingleThreadedExecutor())
        self.now_ns, self._period_ns = 1000 * SECOND, round(period * SECOND)
        self.tested: Any = self.with_parameters(make, use_sim_time=True, **given)
        self.moved = self.listen(kind, topic)
        self._clock = self.publisher(Clock, "/clock")
        self.go_on(0.0)

    def go_on(self, periods: float = 1.0) -> None:
        """Lets some periods pass at once."""
        self.now_ns += round(periods * self._period_ns)
        clock = self.tested.get_clock()

        def has_gone_on() -> bool:
            # The same time again changes nothing, and one message may be lost.
            self._clock.publish(Clock(clock=to_time(self.now_ns)))
            return bool(clock.now().nanoseconds == self.now_ns)

        self.until(has_gone_on, "the simulated time")

    def step(self, periods: float = 1.0) -> Any:
        """Lets some periods pass at once; returns what the node publishes then."""
        count = len(self.moved)
        self.go_on(periods)
        self.until(lambda: len(self.moved) > count, "a step")
        return self.moved[-1]

    def step_until(self, condition: Callable[[], object], most: int = 1000) -> None:
        """Makes steps until a condition is met; fails after too many."""
        for _ in range(most):
            if condition():
                return
            self.step()
        pytest.fail(f"what was awaited did not come in {most} steps")

    def send(self, publisher: Any, message: Any, counted: str) -> None:
        """Publishes a message and waits until the node under test has counted it."""
        counts = self.tested._report.counts
        before = counts[counted]
        publisher.publish(message)
        self.until(lambda: counts[counted] > before, f"the {counted}")


BEHIND_NS = SECOND // 2
"""How far the estimates may be behind what is played [ns]."""
DELAY_NS = SECOND // 4
"""How far the last of them is behind at most: half a window of the filter [ns]."""


class HearingRobot(Graph):
    """Publishes a robot's topics and receives the estimator's messages.

    Args:
        name: of its node.

    Attributes:
        estimates: what has come.
        health: last sentence and facts of each node.
    """

    def __init__(self, name: str = "robot") -> None:
        super().__init__(name, "/slosh", SingleThreadedExecutor())
        self.estimates: list[SloshEstimate] = self.listen(SloshEstimate, topics.ESTIMATE)
        self.health: dict[str, tuple[str, dict[str, str]]] = {}
        self.node.create_subscription(
            DiagnosticArray, topics.DIAGNOSTICS, self._take, qos.DIAGNOSTICS
        )

    def _take(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            self.health[status.name.rpartition("/")[2]] = status.message, values

    def fact(self, node: str, key: str) -> str:
        """Returns a fact of a node's last diagnostics; empty: it is not told."""
        return self.health.get(node, ("", {}))[1].get(key, "")

    def await_ready(self, *nodes: str) -> None:
        """Waits until nodes are ready and the recorder, if it is one, has the others' settings."""
        for node in nodes:
            self.until(lambda node=node: self.fact(node, STATE) == READY, node)
        if "recorder" in nodes:
            self.await_settings(*(node for node in nodes if node in TELLING))

    def await_settings(self, *nodes: str) -> None:
        """Waits until the recorder has the settings of nodes.

        The middleware may bring settings to a late reader only after three seconds, or a multiple
        of it. A recording that ends before cannot be replayed.
        """
        self.until(
            lambda: set(nodes) <= set(self.fact("recorder", RECORDED).split(", ")),
            f"the recorder's settings of {', '.join(sorted(nodes))}",
        )

    @property
    def newest_ns(self) -> int:
        """Stamp of the newest estimate [ns]; 0 before the first one."""
        return to_nanoseconds(self.estimates[-1].header.stamp) if self.estimates else 0

    def pace(self, number: int, stamp_ns: int) -> None:
        """Waits at every tenth sample until the estimates have nearly reached its stamp [ns]."""
        if number % 10 == 0 and self.estimates:
            self.until(lambda: self.newest_ns >= stamp_ns - BEHIND_NS, "the estimates to follow")
        else:
            self.executor.spin_once(timeout_sec=0.002)

    def finish(self, stamp_ns: int) -> None:
        """Waits for the estimate of the last message, which has this stamp [ns]."""
        self.until(lambda: self.newest_ns > stamp_ns - DELAY_NS, "the last one")
