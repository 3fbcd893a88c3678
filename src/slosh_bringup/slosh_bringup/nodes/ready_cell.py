"""Waits until the other nodes of a cell are ready before the simulated motion begins."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from threading import Event

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from slosh_bringup.cell_watch import reports
from slosh_bringup.ready_wait import ReadyWait, sentence
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.rivals import node_of

GROUPS: Mapping[str, tuple[str, ...]] = {
    topics.ACCEL: tuple(row.name for row in topics.DRIVING.values() if not row.is_absolute),
    topics.IMAGE: (topics.IMAGE, topics.IMAGE_COMPRESSED),
    topics.ESTIMATE: (topics.ESTIMATE,),
    topics.FREE_SURFACE: (topics.FREE_SURFACE,),
}
"""Topics that must be read before there is a motion, by the name of their kind."""
OF_CAMERA = (topics.IMAGE, topics.FREE_SURFACE)
"""Those that nobody reads where there is no camera."""
SETTLED = 1.0  # s; for so long nobody new has come: a recorder finds its topics one by one
POLL = 0.05


class ReadyCell:
    """Tracks whether the other nodes of a cell are ready and subscribed.

    Args:
        node: of the simulated cell.
        names: of the nodes that must be ready.
        readers: how many nodes must read each of GROUPS.
        patience: after so long without news it is given up [s].
        camera: whether images are published.
        commands: topics that must be read, too.
    """

    def __init__(
        self,
        node: Node,
        names: list[str],
        readers: int,
        patience: float,
        *,
        camera: bool = True,
        commands: Sequence[str] = (),
    ) -> None:
        self._node, self._readers, self._patience = node, readers, patience
        unread = () if camera else OF_CAMERA
        groups = {kind: names for kind, names in GROUPS.items() if kind not in unread}
        self._groups = groups | {name: (name,) for name in commands}
        self._namespace = node.get_namespace()
        self._wait = ReadyWait(names, time.monotonic(), patience)
        self._own = node.get_name()
        self._unread = ""
        node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, self._take, qos.DIAGNOSTICS)

    @property
    def waits_for(self) -> str:
        """Describes which nodes are not ready, and why."""
        return sentence(self._wait.missing()) or self._unread or "readers"

    def wait(self, stop: Event) -> str:
        """Waits until all nodes are ready and have subscribed to their topics.

        Args:
            stop: ends the waiting.

        Returns:
            why there is no sense in waiting longer; empty: all are ready, or it was stopped.
        """
        while not stop.wait(POLL) and self._wait.missing():
            given_up = self._wait.given_up(time.monotonic())
            if given_up:
                return given_up
        return self._wait_for_readers(stop)

    def _wait_for_readers(self, stop: Event) -> str:
        began = settled = time.monotonic()
        before: Mapping[str, set[str]] = {}
        while not stop.wait(POLL):
            now, there = time.monotonic(), {kind: self._reading(kind) for kind in self._groups}
            if there != before:
                before, settled = there, now
            self._unread = self._lacking(there)
            if not self._unread and now - settled >= (SETTLED if self._readers else 0.0):
                return ""
            if self._unread and now - began > self._patience:
                return self._unread
        return ""

    def _lacking(self, there: Mapping[str, set[str]]) -> str:
        for kind, names in there.items():
            if len(names) < self._readers:
                topic = self._node.resolve_topic_name(kind)
                known = f" ({', '.join(sorted(names))})" if names else ""
                return f"{topic} has {len(names)} of {self._readers} readers{known}"
        return ""

    def _reading(self, kind: str) -> set[str]:
        """Returns the names of the nodes that subscribe to a kind of topics, such as images."""
        return {
            node_of(info)
            for topic in self._groups[kind]
            for info in self._node.get_subscriptions_info_by_topic(
                self._node.resolve_topic_name(topic)
            )
        }

    def _take(self, message: DiagnosticArray) -> None:
        for report in reports(message, self._namespace):
            if report.node != self._own:
                self._wait.take(report, time.monotonic())
