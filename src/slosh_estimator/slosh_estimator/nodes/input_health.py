"""Reports faults of the estimator's input since the last check."""

from __future__ import annotations

from rclpy.node import Node

from slosh_base.files.nanoseconds import SECOND
from slosh_motion.checks.input_faults import FaultKind
from slosh_motion.checks.message_checks import UNSTAMPED_REMEDY
from slosh_motion.inputs.gate import DROPPED, SampleGate, SampleVerdict
from slosh_motion.inputs.inputs import AnyInput
from slosh_motion.inputs.pose_input import PoseInput
from slosh_motion.inputs.sampling import gap_sentence
from slosh_msgs_py.node.diagnostics import ERROR, STALE, WARN, Health
from slosh_msgs_py.node.silence import SilentTopic

_HINTS = {
    SampleVerdict.STALE: ": their stamps are older than max_age, so they are late or stamped by "
    "another clock",
    SampleVerdict.IMPOSSIBLE: ": inputs must be in m/s^2, rad/s and m",
    SampleVerdict.UNSTAMPED: f": {UNSTAMPED_REMEDY}",
    SampleVerdict.AHEAD: " by more than max_age, so by another clock",
}


TOLD_NS = 30 * SECOND
"""So long after it was found a fault of the input is a warning; it stays among the facts."""


class InputHealth:
    """Monitors an input for silence, dropped samples and faults.

    Args:
        node: the node.
        topic: that it reads.
        type_name: of its messages, e.g. 'geometry_msgs/msg/AccelStamped'.
    """

    def __init__(self, node: Node, topic: str, type_name: str) -> None:
        self._topic = SilentTopic(node, topic, type_name)
        self._used = 0
        self._dropped = dict.fromkeys(DROPPED, 0)
        self._restarts = 0
        self._faults: list[str] = []
        self._faulty_since = 0

    def facts(self, total: int) -> dict[str, str]:
        """Returns diagnostic values on input messages that are published but do not arrive.

        Args:
            total: messages that it has heard.
        """
        return self._topic.facts(total)

    def faults(self, source: AnyInput) -> str:
        """Describes recent faults of sensor, driver or network; empty if there are none.

        Args:
            source: that reads the input.
        """
        watch = source.check.faults
        watch.look()
        texts = [one.text() for one in watch.faults if one.kind is not FaultKind.MISSING]
        if texts and texts != self._faults:
            self._faults, self._faulty_since = texts, source.gate.last_ns or 0
        told = (source.gate.last_ns or 0) - self._faulty_since < TOLD_NS
        return "; ".join(texts) if texts and told else ""

    def look(self, gate: SampleGate) -> Health | None:
        """Returns the input's current fault for the diagnostics; None if it has no fault.

        Args:
            gate: that judges the input.
        """
        if gate.unit.text:
            return ERROR, gate.unit.text
        used, self._used = gate.used - self._used, gate.used
        restarts = gate.counts[SampleVerdict.RESTART] - self._restarts
        self._restarts += restarts
        counts = {verdict: gate.counts[verdict] for verdict in DROPPED}
        dropped = {verdict: counts[verdict] - self._dropped[verdict] for verdict in DROPPED}
        self._dropped, total = counts, sum(dropped.values())
        if used:
            self._topic.heard()
            apart = gap_sentence(gate, used, restarts)
            if apart:
                return ERROR, apart
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


def fault_facts(source: AnyInput) -> dict[str, str]:
    """Returns all faults of sensor, driver or network since the start."""
    texts = source.check.faults.texts()
    return {"input faults": "; ".join(texts)} if texts else {}


def rate_facts(source: AnyInput) -> dict[str, str]:
    """Returns the input's rate, and its differentiation's delay and gain per sloshing mode."""
    sampling = source.sampling
    if not sampling.interval_ns:
        return {}
    found = {"input rate [Hz]": f"{1.0 / sampling.seconds:.4g}"}
    for number, gain in sampling.gains().items():
        found[f"gain at mode {number}"] = f"{gain:.3f}"
    if isinstance(source, PoseInput):
        found["delay of the pose window [ms]"] = f"{1e3 * source.delay:.0f}"
    return found
