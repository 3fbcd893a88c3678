"""A robot's ROS node that sends inputs no faster than the estimator follows."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor

from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.ready_wait import TELLING
from slosh_msgs.msg import SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.readiness import READY, RECORDED, STATE
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_testing.graph import Graph

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
