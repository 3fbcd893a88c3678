"""Publishes a node's diagnostics at 1 Hz: rates, drops, latency and health."""

from __future__ import annotations

import os
from collections import Counter, deque
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType

from slosh_base.files.nanoseconds import SECOND
from slosh_base.files.plain_text import plain_line
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.hardware import HARDWARE_ID, hardware_id
from slosh_msgs_py.node.readiness import READY, STATE, Readiness

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)
PERIOD = 1.0
_KEPT = 2000  # latencies that the percentiles look back on
_LONGEST = 60 * SECOND  # ns
NO_CLOCK = (
    "simulated time does not advance: use_sim_time is set, but no advancing /clock is received"
)

Health = tuple[bytes, str]


class DiagnosticsReporter:
    """Counts a node's activity and publishes its diagnostics once a second.

    The timer runs on a steady clock: with use_sim_time and no /clock the node still reports, and
    says so in place of what follows from it.

    Args:
        node: the node.
        health: level and sentence at the moment of the report.
        facts: further key-value pairs at the moment of the report.
        readiness: where the node stands; before it is ready neither of the others is asked.

    Attributes:
        counts: how often each thing has come whose rate is reported: an input, an output.
    """

    def __init__(
        self,
        node: GuardedNode,
        health: Callable[[], Health],
        facts: Callable[[], Mapping[str, Any]] = dict,
        readiness: Readiness | None = None,
    ) -> None:
        self._node = node
        self._health = health
        self._facts = facts
        self._readiness = readiness or Readiness()
        # Counted in place: a call for each message of a fast input can be felt.
        self.counts: Counter[str] = Counter()
        self._reported: dict[str, int] = {}
        self._other_clock = 0
        self._latencies: deque[int] = deque(maxlen=_KEPT)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._last = self._steady.now().nanoseconds
        self._simulated = -1
        self._publisher = node.create_publisher(
            DiagnosticArray, topics.DIAGNOSTICS, qos.DIAGNOSTICS
        )
        self._hardware_id = hardware_id(node.get_namespace(), os.environ.get(HARDWARE_ID, ""))
        self._timer = node.create_timer(PERIOD, self.report, clock=self._steady)

    def latency(self, nanoseconds: int) -> None:
        """Adds a measured latency [ns], from a message's stamp to the published result.

        What is longer than a minute, or as much below zero, is no latency but another clock.
        """
        if -_LONGEST <= nanoseconds <= _LONGEST:
            self._latencies.append(nanoseconds)
        else:
            self._other_clock += 1

    def latency_percentiles(self) -> tuple[float, float]:
        """Returns median and maximum of recent latencies [s], NaN if there are none."""
        if not self._latencies:
            return float("nan"), float("nan")
        ordered = sorted(self._latencies)
        return ordered[len(ordered) // 2] * 1e-9, ordered[-1] * 1e-9

    def report(self) -> None:
        """Publishes the diagnostics now."""
        state = self._readiness.state
        if state != READY:
            sentence = f"not ready, {self._readiness.sentence}"
            self._publisher.publish(self._array(WARN, sentence, {STATE: state}))
            return
        level, sentence = self._judged()
        now = self._steady.now().nanoseconds
        elapsed = max((now - self._last) * 1e-9, 1e-9)
        pairs: dict[str, Any] = {STATE: state}
        for name, count in self.counts.items():
            pairs[f"{name} [Hz]"] = f"{(count - self._reported.get(name, 0)) / elapsed:.1f}"
            pairs[f"{name} total"] = count
        median, greatest = self.latency_percentiles()
        if median == median:
            pairs["latency median [ms]"] = f"{1e3 * median:.2f}"
            pairs["latency maximum [ms]"] = f"{1e3 * greatest:.2f}"
        if self._other_clock:
            pairs["stamps from another clock"] = self._other_clock
        pairs.update(self._facts())
        if self._node.faults.total:
            pairs["messages that could not be handled"] = self._node.faults.total
        self._reported, self._last = dict(self.counts), now
        self._publisher.publish(self._array(level, sentence, pairs))

    def _judged(self) -> Health:
        """Returns the node's health, or an error if callbacks have raised exceptions."""
        try:
            health = self._health()
        except Exception as error:
            health = (ERROR, self._node.faults.add("diagnostics", error))
        news = self._node.faults.news()
        if news:
            return ERROR, news
        if self._time_stands_still():
            return STALE, NO_CLOCK
        unheard = self._node.mismatches.look()
        if unheard:
            level, sentence = health
            return (WARN if level == OK else level), f"{sentence}; {unheard}"
        return health

    def _time_stands_still(self) -> bool:
        """Whether simulated time has stopped since the last diagnostics."""
        clock = self._node.get_clock()
        if not clock.ros_time_is_active:
            return False
        before, self._simulated = self._simulated, clock.now().nanoseconds
        return self._simulated in (before, 0)

    def _array(self, level: bytes, sentence: str, pairs: Mapping[str, Any]) -> DiagnosticArray:
        name = self._node.get_fully_qualified_name()
        status = DiagnosticStatus(
            level=level,
            name=name,
            message=plain_line(sentence),
            hardware_id=self._hardware_id,
            values=[
                KeyValue(key=key, value=plain_line(str(value))) for key, value in pairs.items()
            ],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        return message
