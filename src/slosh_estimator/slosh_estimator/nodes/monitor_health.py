"""Diagnostics of the monitor node."""

from __future__ import annotations

from collections.abc import Mapping

from rclpy.node import Node

from slosh_estimator.comparison import Condition
from slosh_estimator.monitor import Monitor
from slosh_motion.inputs.sampling import TOO_SLOW
from slosh_msgs_py import topics
from slosh_msgs_py.node.diagnostics import ERROR, OK, STALE, WARN, Health
from slosh_msgs_py.node.rivals import Rivals
from slosh_msgs_py.node.silence import SilentTopic

_TYPES = {row.name: row.type for row in topics.TOPICS}


class MonitorHealth:
    """Evaluates the health of the monitor once a second.

    Args:
        node: the node.
        core: the monitor; it is told who else speaks on its inputs.
        surfaces, estimates: topics of measured and estimated heights.
    """

    def __init__(
        self, node: Node, core: Monitor, surfaces: str = topics.FREE_SURFACE,
        estimates: str = topics.ESTIMATE,
    ) -> None:  # fmt: skip
        self._core, self._surfaces, self._estimates = core, surfaces, estimates
        inputs = {estimates: _TYPES[estimates]}
        if core.settings.camera:
            inputs[surfaces] = _TYPES[topics.FREE_SURFACE]
        self._topics = {topic: SilentTopic(node, topic, kind) for topic, kind in inputs.items()}
        self._rivals = [Rivals(node, topic, kind) for topic, kind in inputs.items()]
        self._measured = self._unmatched = 0

    def watch(self, core: Monitor) -> None:
        """Sets another Monitor object as the one to evaluate."""
        self._core, self._unmatched = core, 0

    def look(self, now_ns: int, measured: int) -> Health:
        """Returns the level and the text of the most serious finding.

        Args:
            now_ns: the monitor's time [ns].
            measured: measurements so far.
        """
        self._core.obstruction = "; ".join(filter(None, (rival.look() for rival in self._rivals)))
        mismatch = self._mismatch(measured)
        return self._silence(now_ns) or self._blindness(now_ns) or self._state(now_ns, mismatch)

    def facts(self, counts: Mapping[str, int]) -> dict[str, str]:
        """Returns diagnostic values on topics whose messages are published but do not arrive.

        Args:
            counts: messages so far, by topic.
        """
        found: dict[str, str] = {}
        for topic, silent in self._topics.items():
            found.update(silent.facts(counts[topic]))
        return found

    def _silence(self, now_ns: int) -> Health | None:
        measured_stale, estimate_stale = self._core.silent_sides(now_ns)
        sides = ((self._surfaces, measured_stale), (self._estimates, estimate_stale))
        silent = [topic for topic, stale in sides if stale]
        if not silent:
            return None
        condition = self._core.condition(now_ns)
        level = ERROR if condition is Condition.ERROR else STALE
        why = "; ".join(self._topics[topic].reason() for topic in silent)
        above = self._core.at_rim
        return (
            level,
            f"{condition.name}: {above}{above and '; '}no {' and no '.join(silent)}: {why}",
        )

    def _blindness(self, now_ns: int) -> Health | None:
        blindness = self._core.blindness(now_ns)
        if not blindness:
            return None
        exceeded = self._core.condition(now_ns) is Condition.ERROR
        what = self._core.at_rim or "a limit is exceeded"
        return ERROR, f"{what}, and BLIND: {blindness}" if exceeded else f"BLIND: {blindness}"

    def _state(self, now_ns: int, mismatch: Health | None) -> Health:
        condition, disagreement = self._core.condition(now_ns), self._core.motions.warning
        if condition is Condition.WARN and self._core.too_slow:
            return WARN, f"WARN: {TOO_SLOW}; see the estimator's diagnostics"
        level = self._core.level.text
        if condition is Condition.WARN and level:
            return WARN, f"WARN: {level}"
        if condition is Condition.WARN and disagreement:
            return WARN, disagreement
        watch = self._core.tray
        others = watch is not None and bool(watch.tray.present)
        if self._core.vacant and condition is Condition.OK and not others:
            return OK, "OK: the gripper is empty"
        tray = watch.text if watch is not None else ""
        alone = f"; {tray}" if tray else ""
        alone += "" if self._core.settings.camera else "; no camera configured"
        if condition is not Condition.OK:
            level = ERROR if condition is Condition.ERROR else WARN
            above = self._core.at_rim
            return level, f"{condition.name}{above and ': '}{above}{alone}"
        apart = self._core.motions.clocks.text()
        if apart:
            return WARN, apart
        return mismatch or (OK, f"{condition.name}{alone}")

    def _mismatch(self, measured: int) -> Health | None:
        """Reports if many measurements since the last call have no matching estimate."""
        unmatched = self._core.unmatched
        came, self._measured = measured - self._measured, measured
        failed, self._unmatched = unmatched - self._unmatched, unmatched
        if not failed or 2 * failed < came:
            return None
        return WARN, f"{failed} of {came} measurements have no estimate at their time"
