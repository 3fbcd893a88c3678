"""What has become of the estimator's input since it was last asked."""

from __future__ import annotations

from rclpy.node import Node

from slosh_estimator.gate import DROPPED, SampleGate, Verdict
from slosh_msgs_py.node.diagnostics import STALE, WARN, Health
from slosh_msgs_py.node.silence import SilentTopic

_HINTS = {
    Verdict.STALE: ": older than max_age by their stamps, so late or of another clock",
    Verdict.IMPOSSIBLE: ": inputs are in m/s^2, rad/s and m",
    Verdict.AHEAD: " by more than max_age, so of another clock",
}


class InputHealth:
    """Watches the counts of a gate.

    Args:
        node: the node.
        topic: that it reads.
        type_name: of its messages, e.g. 'geometry_msgs/msg/AccelStamped'.
    """

    def __init__(self, node: Node, topic: str, type_name: str) -> None:
        self._topic = SilentTopic(node, topic, type_name)
        self._used = 0
        self._dropped = dict.fromkeys(DROPPED, 0)

    def facts(self, gate: SampleGate) -> dict[str, str]:
        """What others may hear, and this node does not."""
        return self._topic.facts(gate.used + gate.dropped)

    def look(self, gate: SampleGate) -> Health | None:
        """What is wrong; None: nothing.

        Args:
            gate: that judges the input.
        """
        used, self._used = gate.used - self._used, gate.used
        counts = {verdict: gate.counts[verdict] for verdict in DROPPED}
        dropped = {verdict: counts[verdict] - self._dropped[verdict] for verdict in DROPPED}
        self._dropped, total = counts, sum(dropped.values())
        if used:
            self._topic.heard()
            if not total:
                return None
            return WARN, f"{total} input samples dropped since the last report, see below"
        if not total:
            return (
                STALE,
                f"no usable input for {self._topic.seconds:.0f} s: {self._topic.reason()}",
            )
        worst = max(dropped, key=lambda verdict: dropped[verdict])
        return STALE, (
            f"no usable input for {self._topic.seconds:.0f} s: of {total} messages on "
            f"{self._topic.full_name} {dropped[worst]} are {worst.value}{_HINTS.get(worst, '')}"
        )
